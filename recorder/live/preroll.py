"""Keeps the last seconds in memory, so that a recording can begin in the past: decided pulses, events, health records.

Pulses queue here for a recording. Without a recording the oldest pulses are dropped; a recording takes them from the
front of the queue while new ones join at its end. So a recording has every pulse once and in order, wherever it begins.
The pixels stay in the triplet buffers in which they were composed, and go to the disk from there.
"""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from recorder.live.composer import Triplet
from recorder.log.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs
from rig.events import Event
from rig.health import PrerollHealth
from rig.settings.model import RigSettings

_NOTES_MAX: Final = 1000


def preroll_triplets(rig: RigSettings, seconds: float, slot_bytes: int) -> int:
    """How many triplets a pre-roll of `seconds` holds: no more than the rig file allows memory for.

    Args:
        rig: the rig.
        seconds: wanted length of the pre-roll, s.
        slot_bytes: memory of one triplet buffer.
    """
    wanted = math.ceil(seconds * rig.trigger.rate_hz)
    return min(wanted, int(rig.recorder.preroll_limit_mb * 1e6) // slot_bytes)


@dataclass(frozen=True, slots=True)
class Held:
    """A decided pulse in the queue, and when its triplet was ready."""

    triplet: Triplet
    ready: HostNs


class Preroll:
    """The queue between the assembler and a recording.

    Args:
        buffers: owner of the triplets' slots.
        seconds: how far back it reaches without a recording, s.
        triplets: how many pulses it holds at most without a recording.

    Attributes:
        seconds: as given.
        triplets: as given.
    """

    def __init__(self, buffers: TripletBuffers, seconds: float, triplets: int) -> None:
        self.seconds, self.triplets = seconds, triplets
        self._buffers = buffers
        self._held: deque[Held] = deque()
        self._notes: deque[tuple[HostNs, Event | bytes]] = deque(maxlen=_NOTES_MAX)

    def __len__(self) -> int:
        return len(self._held)

    def __iter__(self) -> Iterator[Held]:
        return iter(self._held)

    def first_since(self, begin: HostNs) -> HostNs | None:
        """Time of the first pulse at `begin` or later; None if there is none yet."""
        times = (held.triplet.pulse.time for held in self)
        return next((time for time in times if time >= begin), None)

    @property
    def oldest(self) -> Held | None:
        """The pulse at the front of the queue; None if the queue is empty."""
        return self._held[0] if self._held else None

    def add(self, triplet: Triplet, ready: HostNs) -> None:
        """Append a decided pulse, the latest so far; its slot is the queue's from now on."""
        self._held.append(Held(triplet, ready))

    def take(self) -> Held:
        """Remove and return the oldest pulse; the caller releases its slot."""
        return self._held.popleft()

    def put_back(self, pulses: Sequence[Held]) -> None:
        """Put pulses that were taken back at the front of the queue, in their order; their slots are the queue's."""
        self._held.extendleft(reversed(pulses))

    def drop(self) -> None:
        """Remove the oldest pulse and release its slot."""
        slot = self._held.popleft().triplet.slot
        if slot is not None:
            self._buffers.release(slot)

    def trim(self, now: HostNs) -> None:
        """Drop the pulses that are older than `seconds`, and the oldest of those that are too many."""
        since = now - round(self.seconds * NS_PER_S)
        while self._held and (len(self._held) > self.triplets or self._held[0].triplet.pulse.time < since):
            self.drop()

    def health(self, now: HostNs) -> PrerollHealth:
        """How far the queue reaches back at the moment, and its memory."""
        oldest = self.oldest
        return PrerollHealth(
            seconds=0.0 if oldest is None else round((now - oldest.triplet.pulse.time) / NS_PER_S, 3),
            limit_s=self.seconds,
            triplets=len(self._held),
            memory_mb=round(self.triplets * self._buffers.layout.slot_bytes / 1e6, 1),
        )

    def note(self, now: HostNs, note: Event | bytes) -> None:
        """Keep an event or an encoded health record of the time `now`; forget those older than `seconds`."""
        self._notes.append((now, note))
        while self._notes[0][0] < now - round(self.seconds * NS_PER_S):
            self._notes.popleft()

    def take_notes(self, since: HostNs) -> list[tuple[HostNs, Event | bytes]]:
        """Remove all events and health records, and return those since `since`, oldest first, with their times."""
        notes = [(time, note) for time, note in self._notes if time >= since]
        self._notes.clear()
        return notes
