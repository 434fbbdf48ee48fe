"""Slots of the cameras' rings that a recorder which died had in hand: nobody would ever free them.

A recorder that is started anew on the same rings looks which slots are queued although no unread record names them.
A grabber may just be about to queue a record for such a slot, so they are freed only if none has come some time later.
"""

from collections.abc import Sequence
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from rig.ring import CameraRing

_WAIT_NS: Final = NS_PER_S


class StrandedSlots:
    """What the recorder before this one may have left; to be made before the first record is read.

    Args:
        rings: one per camera.
        now: when.
    """

    def __init__(self, rings: Sequence[CameraRing], now: HostNs) -> None:
        self._rings = rings
        self._due = HostNs(now + _WAIT_NS)
        self._suspects = [ring.queued_slots() - ring.unread_slots() for ring in rings]

    def named(self, camera: int, slot: int) -> None:
        """A record names this slot: it is not stranded."""
        self._suspects[camera].discard(slot)

    def free(self, now: HostNs) -> int:
        """Free what is certainly stranded.

        Returns:
            How many slots that were; 0 as long as it is too early to tell.
        """
        if now < self._due or not any(self._suspects):
            return 0
        count = 0
        for ring, suspects in zip(self._rings, self._suspects, strict=True):
            for slot in suspects:
                ring.release(slot)
            count += len(suspects)
            suspects.clear()
        return count
