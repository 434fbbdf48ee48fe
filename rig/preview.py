"""The newest triplet for people to look at: one slot in shared memory between the recorder and the service.

The memory is an anonymous memfd that the recorder inherits. The recorder alone writes the image, the service alone
writes how long it wants images; neither ever waits for the other. The image is guarded by a sequence number that is
odd while the recorder writes: whoever has read between two equal even numbers has read one image, not two halves.
Like `rig.ring` this relies on x86-64, which keeps loads and stores of one processor in order.

```
page 0: header words | statuses       pages 1..: pixels
```
"""

import mmap
import os
import struct
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import BadInputError
from rig.frame import FrameStatus

_MAGIC: Final = 0x3156_4552_5056_5653  # "SVVPREV1" read as a little-endian word
_HEADER: Final = struct.Struct("<QQQQ")  # magic, rows, columns, cameras
_SEQUENCE, _WANTED_UNTIL, _PULSE, _TIME = 16, 24, 32, 40  # word numbers, a cache line each
_STATUSES: Final = 1024
_KINDS: Final = tuple(FrameStatus)
_TRY_S: Final = 0.2
_PAUSE_S: Final = 0.0005

MAX_PER_S: Final = 10


@dataclass(frozen=True, slots=True)
class PreviewImage:
    """A triplet to look at.

    Attributes:
        pulse: number of the pulse since the recorder was started, not that in a recording.
        time: of the pulse.
        statuses: by camera, left to right.
        pixels: (rows, columns), uint8; a copy of its own.
    """

    pulse: int
    time: HostNs
    statuses: tuple[FrameStatus, ...]
    pixels: NDArray[np.uint8]


class PreviewSlot:
    """The slot in this process's address space.

    Attributes:
        fd: the memfd; the recorder inherits it.
        shape: rows and columns of the triplet.
        cameras: how many there are.
    """

    def __init__(self, fd: int) -> None:
        self.fd = fd
        magic, rows, columns, self.cameras = _HEADER.unpack(os.pread(fd, _HEADER.size, 0))
        if magic != _MAGIC:
            raise BadInputError(f"file descriptor {fd} is no preview slot: start the process through svev")
        self.shape = (rows, columns)
        self._map = mmap.mmap(fd, mmap.PAGESIZE + rows * columns)
        self._view = memoryview(self._map)
        self._words = self._view[: mmap.PAGESIZE].cast("Q")
        self._pixels = np.frombuffer(self._map, np.uint8, offset=mmap.PAGESIZE).reshape(self.shape)
        self._next = HostNs(0)

    @classmethod
    def create(cls, shape: tuple[int, int], cameras: int) -> "PreviewSlot":
        """Make the shared memory for triplets of this shape."""
        fd = os.memfd_create("svev-preview", os.MFD_CLOEXEC)
        os.ftruncate(fd, mmap.PAGESIZE + shape[0] * shape[1])
        os.pwrite(fd, _HEADER.pack(_MAGIC, *shape, cameras), 0)
        return cls(fd)

    def close(self) -> None:
        """Give the mapping and the descriptor back."""
        del self._pixels
        self._words.release()
        self._view.release()
        self._map.close()
        os.close(self.fd)

    # The service's side. Several threads may read.

    def want(self, seconds: float) -> None:
        """Ask for images for so long from now on; ask again in time for more."""
        self._words[_WANTED_UNTIL] = host_now() + round(seconds * NS_PER_S)

    def newest(self) -> int:
        """Pulse number of the image that stands there, 0 if there never was one; tells whether `read` is worthwhile."""
        return self._words[_PULSE]

    def read(self) -> PreviewImage | None:
        """The image that stands there; None if there never was one, or the recorder died while it wrote."""
        deadline = time.monotonic() + _TRY_S
        while True:
            before = self._words[_SEQUENCE]
            if before % 2 == 0:
                if self.newest() == 0:
                    return None
                image = self._copy()
                if self._words[_SEQUENCE] == before:
                    return image
            if time.monotonic() > deadline:
                return None
            time.sleep(_PAUSE_S)

    # The recorder's side

    def take_over(self) -> None:
        """Become the writer, also of a slot whose writer died while it wrote; there is no image yet."""
        self._words[_SEQUENCE] += 1 + self._words[_SEQUENCE] % 2  # odd: being written
        self._words[_PULSE] = 0
        self._words[_SEQUENCE] += 1

    def due(self, now: HostNs) -> bool:
        """Whether an image is wanted and the last one is old enough."""
        return self._next <= now < self._words[_WANTED_UNTIL]

    def write(
        self, pulse: int, time_: HostNs, statuses: Sequence[FrameStatus], pixels: NDArray[np.uint8] | None, now: HostNs
    ) -> None:
        """Put an image there.

        Args:
            pulse: number of the pulse since the recorder was started.
            time_: of the pulse.
            statuses: by camera.
            pixels: (rows, columns), uint8; None: black.
            now: the next image is due `1 / MAX_PER_S` seconds later.
        """
        self._next = HostNs(now + NS_PER_S // MAX_PER_S)
        self._words[_SEQUENCE] += 1
        self._words[_PULSE], self._words[_TIME] = pulse, time_
        self._view[_STATUSES : _STATUSES + self.cameras] = bytes(_KINDS.index(status) for status in statuses)
        if pixels is None:
            self._pixels.fill(0)
        else:
            np.copyto(self._pixels, pixels)
        self._words[_SEQUENCE] += 1

    def _copy(self) -> PreviewImage:
        statuses = bytes(self._view[_STATUSES : _STATUSES + self.cameras])
        return PreviewImage(
            self._words[_PULSE],
            HostNs(self._words[_TIME]),
            tuple(_KINDS[status] for status in statuses),
            self._pixels.copy(),
        )
