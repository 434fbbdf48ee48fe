"""Hands the newest triplet to people who watch the panel: one slot in shared memory between recorder and service.

The memory is an anonymous memfd that the recorder inherits. Only the recorder writes the image, only the service writes
until when it wants images; neither ever waits for the other. A sequence number guards the image (a seqlock): it is odd
while the recorder writes, so whoever reads the same even number before and after copying has one whole image.
Like `rig.transport.ring` this relies on x86-64, which keeps loads and stores of one processor in order.

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
from rig.images.pixels import Stored
from rig.pulse import RigPulse

_MAGIC: Final = 0x3156_4552_5056_5653  # "SVVPREV1" read as a little-endian word
_HEADER: Final = struct.Struct("<QIIQ")  # magic, columns, rows, cameras
_SHAPE = 1  # number of the word that holds rows and columns, which change at once
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
        pulse: number of the pulse since the recorder was started, not its number in a recording.
        time: host time of the pulse.
        statuses: what became of the pulse in each camera, left to right.
        pixels: (rows, columns), uint8; a copy that belongs to the caller.
    """

    pulse: RigPulse
    time: HostNs
    statuses: tuple[FrameStatus, ...]
    pixels: NDArray[np.uint8]


class PreviewSlot:
    """The preview slot, mapped into the address space of this process.

    Args:
        fd: descriptor of the memfd.

    Attributes:
        fd: as given; the recorder inherits it.
        cameras: number of cameras.

    Raises:
        BadInputError: the descriptor is of something else.
    """

    def __init__(self, fd: int) -> None:
        self.fd = fd
        magic, *_, self.cameras = _HEADER.unpack(os.pread(fd, _HEADER.size, 0))
        if magic != _MAGIC:
            raise BadInputError(f"file descriptor {fd} is no preview slot: start the process through svev")
        self._map = mmap.mmap(fd, mmap.PAGESIZE)
        self._view = memoryview(self._map)
        self._words = self._view.cast("Q")
        self._pixels = self._mapped()
        self._next = HostNs(0)

    @classmethod
    def create(cls, shape: tuple[int, int], cameras: int) -> "PreviewSlot":
        """Make the shared memory for triplets of this shape."""
        fd = os.memfd_create("svev-preview", os.MFD_CLOEXEC)
        os.ftruncate(fd, mmap.PAGESIZE + shape[0] * shape[1])
        os.pwrite(fd, _HEADER.pack(_MAGIC, shape[1], shape[0], cameras), 0)
        return cls(fd)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the triplet."""
        return divmod(self._words[_SHAPE], 1 << 32)

    def close(self) -> None:
        """Unmap the memory and close the descriptor."""
        del self._pixels
        self._words.release()
        self._view.release()
        self._map.close()
        os.close(self.fd)

    # The service's side. Several threads may read.

    def want(self, seconds: float) -> None:
        """Ask the recorder for images during the next `seconds`; every call begins anew."""
        self._words[_WANTED_UNTIL] = host_now() + round(seconds * NS_PER_S)

    def newest(self) -> RigPulse:
        """Pulse of the image in the slot, 0 if there is none; cheap, to see whether `read` would bring a new image."""
        return RigPulse(self._words[_PULSE])

    def read(self) -> PreviewImage | None:
        """Copy the image in the slot; None if there is none, or if the recorder died while it wrote."""
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

    def take_over(self, shape: tuple[int, int]) -> None:
        """Become the writer, also after one that died while it wrote; removes the old image.

        Args:
            shape: rows and columns of the triplets from now on. The memory grows with them and never shrinks: another
                process may be copying the old image.
        """
        self._words[_SEQUENCE] += 1 + self._words[_SEQUENCE] % 2  # odd: being written
        self._words[_PULSE] = 0
        size = mmap.PAGESIZE + shape[0] * shape[1]
        if size > os.fstat(self.fd).st_size:
            os.ftruncate(self.fd, size)
        self._pixels = self._mapped()
        self._words[_SHAPE] = shape[0] << 32 | shape[1]
        self._words[_SEQUENCE] += 1

    def due(self, now: HostNs) -> bool:
        """Whether the service wants an image and the last one is old enough."""
        return self._next <= now < self._words[_WANTED_UNTIL]

    def write(
        self,
        pulse: RigPulse,
        time_: HostNs,
        statuses: Sequence[FrameStatus],
        pixels: Stored | None,
        now: HostNs,
        bits: int = 8,
    ) -> None:
        """Write an image into the slot.

        Args:
            pulse: number of the pulse since the recorder was started.
            time_: host time of the pulse.
            statuses: what became of the pulse in each camera.
            pixels: (rows, columns); None: black.
            now: present time; the next image is due `1 / MAX_PER_S` seconds later.
            bits: how many bits of a pixel are significant; the highest eight of them are shown.
        """
        self._next = HostNs(now + NS_PER_S // MAX_PER_S)
        self._words[_SEQUENCE] += 1
        self._words[_PULSE], self._words[_TIME] = pulse, time_
        self._view[_STATUSES : _STATUSES + self.cameras] = bytes(_KINDS.index(status) for status in statuses)
        if pixels is None:
            self._image().fill(0)
        elif bits > 8:
            np.right_shift(pixels, bits - 8, out=self._image(), casting="unsafe")
        else:
            np.copyto(self._image(), pixels)
        self._words[_SEQUENCE] += 1

    def _copy(self) -> PreviewImage:
        statuses = bytes(self._view[_STATUSES : _STATUSES + self.cameras])
        return PreviewImage(
            self.newest(),
            HostNs(self._words[_TIME]),
            tuple(_KINDS[status] for status in statuses),
            self._image().copy(),
        )

    def _mapped(self) -> NDArray[np.uint8]:
        """All pixels that the memory has room for. It stays mapped as long as somebody holds them."""
        return np.frombuffer(mmap.mmap(self.fd, os.fstat(self.fd).st_size), np.uint8, offset=mmap.PAGESIZE)

    def _image(self) -> NDArray[np.uint8]:
        """The triplet in the slot."""
        rows, columns = self.shape
        if (pixels := self._pixels).size < rows * columns:
            pixels = self._pixels = self._mapped()
        return pixels[: rows * columns].reshape(rows, columns)
