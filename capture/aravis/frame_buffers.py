"""The slots of the ring as buffers of Aravis: a few of them stand empty in its queue, the lowest free ones first."""

from typing import Final

from capture.aravis.library import Aravis
from rig.clocks import NS_PER_S
from rig.transport.ring import CameraRing

#: How many empty buffers stand in Aravis's queue: half a second of frames, but no more than stay in the cache.
_QUEUE_S: Final = 0.5
_QUEUE_BYTES: Final = 24 << 20
_QUEUE_LEAST: Final = 8


class FrameBuffers:
    """The buffers of one camera.

    Args:
        ring: where the frames go.
        period_ns: time between two pulses.
    """

    def __init__(self, ring: CameraRing, period_ns: int) -> None:
        self._ring = ring
        wanted = min(round(_QUEUE_S * NS_PER_S / period_ns), _QUEUE_BYTES // ring.frame_bytes)
        self._depth = min(ring.slots, max(_QUEUE_LEAST, wanted))
        self._slots: dict[int, int] = {}
        self._of_slot: list[Aravis.Buffer] = []
        self._in_aravis = 0

    def make(self) -> None:
        """Make them, once there is a stream."""
        for slot in range(self._ring.slots):
            buffer = Aravis.Buffer.new(self._ring.frame_bytes, self._ring.slot_address(slot))
            self._slots[hash(buffer)] = slot  # the hash is the address of the C object, which does not change
            self._of_slot.append(buffer)

    def top_up(self, stream: "Aravis.Stream") -> None:
        """Fill Aravis's queue of empty buffers, as far as the recorder leaves slots free."""
        while self._in_aravis < self._depth:
            slot = self._ring.take_slot()
            if slot is None:
                return
            stream.push_buffer(self._of_slot[slot])
            self._in_aravis += 1

    def popped(self, buffer: "Aravis.Buffer") -> int:
        """The slot of a buffer that Aravis has filled."""
        self._in_aravis -= 1
        return self._slots[hash(buffer)]

    def close(self) -> None:
        """Drop them, and take back the slots that they had."""
        self._slots.clear()
        self._of_slot.clear()
        self._ring.reclaim()
