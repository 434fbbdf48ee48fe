"""Holds the triplets of the pulses that a recording has handed to its log, until they are known to be in the file."""

from collections import deque
from dataclasses import dataclass

from recorder.live.preroll import Held
from recorder.log.triplet_buffers import TripletBuffers
from rig.tag import TripletTag
from triggering.ledger.account import Ledger


@dataclass(frozen=True, slots=True)
class _InFlight:
    """A pulse that was handed to the log and is not known to be in the file yet."""

    held: Held
    tag: TripletTag


class InFlight:
    """The pulses in flight, and those in the file that are kept in memory all the same.

    Args:
        buffers: hold the triplets.
    """

    def __init__(self, buffers: TripletBuffers) -> None:
        self._buffers = buffers
        self._flying: deque[_InFlight] = deque()
        self._kept: deque[Held] = deque()

    def __len__(self) -> int:
        """Pulses that are not known to be in the file yet."""
        return len(self._flying)

    @property
    def keeps(self) -> bool:
        """Whether a pulse that is in the file is kept."""
        return bool(self._kept)

    def add(self, held: Held, tag: TripletTag) -> None:
        """Take over a pulse that is handed to the log."""
        self._flying.append(_InFlight(held, tag))

    def confirm(self, pulses: int, ledger: Ledger) -> None:
        """Keep the pulses that are in the file by now, and enter them into the ledger.

        Args:
            pulses: how many are in the file.
            ledger: how many of them it has, and gets the others.
        """
        while self._flying and ledger.pulses < pulses:
            done = self._flying.popleft()
            ledger.add(done.tag)
            self._kept.append(done.held)

    def forget(self, least_free: int | None = None) -> None:
        """Release the triplet buffers of pulses that were kept, the oldest first.

        Args:
            least_free: only until so many buffers are free; None: all of them.
        """
        while self._kept and (least_free is None or self._buffers.free_count < least_free):
            slot = self._kept.popleft().triplet.slot
            if slot is not None:
                self._buffers.release(slot)

    def take_kept(self) -> list[Held]:
        """Remove and return the pulses that were kept, oldest first; their slots are the caller's."""
        kept = list(self._kept)
        self._kept.clear()
        return kept

    def take_back(self) -> list[Held]:
        """Remove and return the pulses that are not in the file, in order, for another log; for use after a failure."""
        left = [pulse.held for pulse in self._flying]
        self._flying.clear()
        return left

    def release(self) -> None:
        """Release the triplet buffers of the pulses that are not in the file and never will be."""
        for held in self.take_back():
            if held.triplet.slot is not None:
                self._buffers.release(held.triplet.slot)
