"""What has just happened, kept so that a recording can begin in the past: decided pulses with their pixels, and notes.

Pulses wait here for a recording. Without one the oldest make room; with one they leave through its front, oldest first,
and new ones join behind them: so a recording has every pulse once and in order, wherever it begins. The pixels stay in
the triplet buffers in which they were composed, and go to the disk from there.
"""

import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from recorder.assembler import Triplet
from recorder.events import Event
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs
from rig.settings import RigSettings

_NOTES_MAX: Final = 1000


def preroll_triplets(rig: RigSettings, seconds: float, slot_bytes: int) -> int:
    """How many triplets are held for so many seconds: no more than the rig file allows memory for."""
    wanted = math.ceil(seconds * rig.trigger.rate_hz)
    return min(wanted, int(rig.recorder.preroll_limit_mb * 1e6) // slot_bytes)


@dataclass(frozen=True, slots=True)
class Held:
    """A decided pulse that waits; `ready`: when its triplet was."""

    triplet: Triplet
    ready: HostNs


class Preroll:
    """The queue between the assembler and a recording.

    Args:
        buffers: where the triplets' slots are released to.
        seconds: how far back it reaches without a recording.
        triplets: how many pulses it holds then at most.

    Attributes:
        seconds: as given.
        triplets: as given.
    """

    def __init__(self, buffers: TripletBuffers, seconds: float, triplets: int) -> None:
        self.seconds, self.triplets = seconds, triplets
        self._buffers = buffers
        self._held: deque[Held] = deque()

    def __len__(self) -> int:
        return len(self._held)

    def __iter__(self) -> Iterator[Held]:
        return iter(self._held)

    @property
    def oldest(self) -> Held | None:
        """The pulse that is next; None if none waits."""
        return self._held[0] if self._held else None

    def add(self, triplet: Triplet, ready: HostNs) -> None:
        """Take over a decided pulse, the latest so far."""
        self._held.append(Held(triplet, ready))

    def take(self) -> Held:
        """Hand out the oldest pulse; its slot is the caller's to release."""
        return self._held.popleft()

    def drop(self) -> None:
        """Let the oldest pulse go."""
        slot = self._held.popleft().triplet.slot
        if slot is not None:
            self._buffers.release(slot)

    def trim(self, now: HostNs) -> None:
        """Let go what is older than it is to reach back, and what is too much."""
        since = now - round(self.seconds * NS_PER_S)
        while self._held and (len(self._held) > self.triplets or self._held[0].triplet.pulse.time < since):
            self.drop()

    def health(self, now: HostNs) -> dict[str, Any]:
        """How far it reaches back at the moment, and what it may take."""
        oldest = self.oldest
        return {
            "seconds": 0.0 if oldest is None else round((now - oldest.triplet.pulse.time) / NS_PER_S, 3),
            "limit_s": self.seconds,
            "triplets": len(self._held),
            "memory_mb": round(self.triplets * self._buffers.layout.slot_bytes / 1e6, 1),
        }


class RecentNotes:
    """The events and health records of the last seconds, for a recording that begins in the past."""

    def __init__(self, seconds: float) -> None:
        self._span_ns = round(seconds * NS_PER_S)
        self._notes: deque[tuple[HostNs, Event | Mapping[str, Any]]] = deque(maxlen=_NOTES_MAX)

    def add(self, now: HostNs, note: Event | Mapping[str, Any]) -> None:
        """Keep an event or a health record that comes `now`."""
        self._notes.append((now, note))
        while self._notes[0][0] < now - self._span_ns:
            self._notes.popleft()

    def take(self, since: HostNs) -> list[tuple[HostNs, Event | Mapping[str, Any]]]:
        """Hand out what came since then, oldest first, and forget everything."""
        notes = [(time, note) for time, note in self._notes if time >= since]
        self._notes.clear()
        return notes
