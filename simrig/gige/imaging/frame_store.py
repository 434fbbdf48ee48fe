"""The camera's frame memory: slots to render into, frames that wait to be sent, the last sent frames for resend."""

import ctypes
import mmap
import threading
from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from rig.clocks import HostNs
from rig.pulse import HillPulse
from simrig.gige.protocol.gvsp import FrameFormat, PacketTable

#: How many frames fit into the memory: so far a camera that was scheduled late, or has a slow link, may fall behind.
_MEMORY_BYTES, _LEAST_SLOTS, _MOST_SLOTS = 40_000_000, 16, 64
_HISTORY = 4  # one slot in four holds a sent frame for resend; with more, the slots in use would not stay in the cache


@dataclass(eq=False, slots=True)
class Slot:
    """Memory of one frame.

    Attributes:
        image: its pixels as they are sent, shape (bytes,).
        table: its packets.
    """

    image: NDArray[np.uint8]
    table: PacketTable


@dataclass(eq=False, slots=True)
class Shot:
    """One exposed frame.

    Attributes:
        slot: its memory.
        pulse: hill pulse that it shows.
        block_id: its id in the stream.
        ticks: device time of its exposure.
        ready: host time at which the exposure ends; no packet is sent earlier.
        lost: packets that do not arrive.
        gone: packets that no resend brings back.
        damaged: packets that are sent without pixels.
        sent: number of packets sent so far.
    """

    slot: Slot
    pulse: HillPulse
    block_id: int
    ticks: int
    ready: HostNs
    lost: frozenset[int] = frozenset()
    gone: frozenset[int] = frozenset()
    damaged: frozenset[int] = frozenset()
    sent: int = field(default=0)


class FrameStore:
    """Frame memory for one format, allocated and touched at once.

    `take` prefers the free slot that was used last: it is still in the processor's cache.
    """

    def __init__(self, frame: FrameFormat) -> None:
        self.format = frame
        self.lock = threading.Lock()
        stride = -(-frame.payload_bytes // mmap.PAGESIZE) * mmap.PAGESIZE
        count = min(max(_MEMORY_BYTES // stride, _LEAST_SLOTS), _MOST_SLOTS)
        self._memory = mmap.mmap(-1, count * stride, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | mmap.MAP_POPULATE)
        pixels = np.frombuffer(self._memory, np.uint8).reshape(count, stride)
        address = ctypes.addressof(ctypes.c_char.from_buffer(self._memory))
        self.slots = tuple(
            Slot(
                pixels[index, : frame.payload_bytes],
                PacketTable(frame, address + index * stride),
            )
            for index in range(count)
        )
        self._free = list(self.slots)
        self._history: deque[Shot] = deque()

    def take(self) -> Slot | None:
        """Take a free slot; None while all slots hold frames that wait to be sent."""
        with self.lock:
            return self._free.pop() if self._free else None

    def give_back(self, slot: Slot) -> None:
        """Return a slot that holds no frame."""
        with self.lock:
            self._free.append(slot)

    def remember(self, shot: Shot) -> None:
        """Keep a frame whose transmission begins, so that its packets can be sent again for a while."""
        with self.lock:
            self._history.append(shot)
            if len(self._history) > len(self.slots) // _HISTORY:
                self._free.append(self._history.popleft().slot)

    def find(self, block_id: int) -> Shot | None:
        """The kept frame with this id. The caller holds `lock` for this call and while it uses the slot."""
        return next((shot for shot in reversed(self._history) if shot.block_id == block_id), None)

    def forget(self) -> None:
        """Free the slots of all sent frames, because block ids begin anew."""
        with self.lock:
            self._free.extend(shot.slot for shot in self._history)
            self._history.clear()
