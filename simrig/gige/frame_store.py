"""The camera's frame memory: slots to render into, frames on their way out, the last frames for resend."""

import ctypes
import mmap
import threading
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rig.clocks import HostNs
from simrig.gige.gvsp import FrameFormat, PacketTable

#: Frames that fit into the memory: what a camera that is not scheduled in time, or has a slow link, can still catch up.
_MEMORY_BYTES, _LEAST_SLOTS, _MOST_SLOTS = 40_000_000, 16, 64
_HISTORY = 4  # every fourth slot holds a frame that was sent, for resend; no more, or all would leave the cache


@dataclass(eq=False, slots=True)
class Slot:
    """Memory of one frame.

    Attributes:
        image: its pixels, shape (height, width).
        table: its packets.
    """

    image: NDArray[np.uint8]
    table: PacketTable


@dataclass(eq=False, slots=True)
class Shot:
    """One exposed frame.

    Attributes:
        slot: where its pixels stand.
        pulse: hill pulse that it shows.
        ticks: device time of its exposure.
        ready: host time at which the exposure ends; no packet leaves earlier.
        lost: packets that do not arrive.
        gone: packets that no resend brings back.
        damaged: packets that are sent without pixels.
        sent: packets that have been sent so far.
    """

    slot: Slot
    pulse: int
    block_id: int
    ticks: int
    ready: HostNs
    lost: frozenset[int] = frozenset()
    gone: frozenset[int] = frozenset()
    damaged: frozenset[int] = frozenset()
    sent: int = field(default=0)


class FrameStore:
    """Frame memory for one format. Of the free slots the one used last is taken first: it is still in the cache."""

    def __init__(self, frame: FrameFormat) -> None:
        """Allocate and touch all memory."""
        self.format = frame
        self.lock = threading.Lock()
        stride = -(-frame.payload_bytes // mmap.PAGESIZE) * mmap.PAGESIZE
        count = min(max(_MEMORY_BYTES // stride, _LEAST_SLOTS), _MOST_SLOTS)
        self._memory = mmap.mmap(-1, count * stride, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | mmap.MAP_POPULATE)
        pixels = np.frombuffer(self._memory, np.uint8).reshape(count, stride)
        address = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        self.slots = tuple(
            Slot(
                pixels[index, : frame.payload_bytes].reshape(frame.height, frame.width),
                PacketTable(frame, address + index * stride),
            )
            for index in range(count)
        )
        self._free = list(self.slots)
        self._history: deque[Shot] = deque()

    def take(self) -> Slot | None:
        """A free slot; None while all frames wait to be sent."""
        with self.lock:
            return self._free.pop() if self._free else None

    def give_back(self, slot: Slot) -> None:
        """A slot that was taken but holds no frame."""
        with self.lock:
            self._free.append(slot)

    def remember(self, shot: Shot) -> None:
        """A frame begins to be sent: from now on its packets may be asked for again, for a while."""
        with self.lock:
            self._history.append(shot)
            if len(self._history) > len(self.slots) // _HISTORY:
                self._free.append(self._history.popleft().slot)

    def find(self, block_id: int) -> Shot | None:
        """The remembered frame with this id; to be called, and its slot used, under `lock`."""
        return next((shot for shot in reversed(self._history) if shot.block_id == block_id), None)

    def forget(self) -> None:
        """Forget all frames that were sent (block ids begin anew)."""
        with self.lock:
            self._free.extend(shot.slot for shot in self._history)
            self._history.clear()
