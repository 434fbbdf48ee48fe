"""The known pulses: the open ones, in the order of time, and the last decided ones."""

from bisect import bisect_left, bisect_right, insort
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from operator import attrgetter
from typing import Final

from rig.clocks import HostNs
from triggering.pairing.outcomes import OpenPulse

#: Times of decided pulses that are remembered.
_REMEMBERED: Final = 256
_TIME: Final = attrgetter("time")


class KnownPulses:
    """Open and decided pulses.

    Args:
        cameras: how many cameras there are.

    Attributes:
        closed: how many pulses have been decided.
        proven_by_ids: how many of them no camera delivered, and frame ids proved.
        unwatched: how many of them were due while no camera was there.
    """

    def __init__(self, cameras: int) -> None:
        self._cameras = cameras
        self.closed = self.proven_by_ids = self.unwatched = 0
        self._open: list[OpenPulse] = []
        self._decided: deque[HostNs] = deque(maxlen=_REMEMBERED)
        self._delivered: deque[int] = deque(maxlen=_REMEMBERED)

    @property
    def open(self) -> Sequence[OpenPulse]:
        """The open pulses in the order of time; not to be changed."""
        return self._open

    @property
    def first(self) -> OpenPulse | None:
        """The open pulse that is decided next; None: there is none."""
        return self._open[0] if self._open else None

    def nearest(self, time: HostNs, tolerance: float) -> OpenPulse | None:
        """The open pulse nearest to a trigger time, None if there is none within the tolerance."""
        position = bisect_left(self._open, time, key=_TIME)
        nearest, least = None, tolerance
        for pulse in self._open[max(0, position - 1) : position + 1]:
            if abs(pulse.time - time) <= least:
                nearest, least = pulse, abs(pulse.time - time)
        return nearest

    def add(self, time: HostNs) -> OpenPulse:
        """Open a pulse at the trigger time of its first frame."""
        pulse = OpenPulse(self._cameras, time)
        insort(self._open, pulse, key=_TIME)
        return pulse

    def put_first(self, pulses: Iterable[OpenPulse]) -> None:
        """Open pulses that are all earlier than the first open one; they are in the order of time."""
        self._open[:0] = pulses

    def take_first(self) -> OpenPulse:
        """Take the first open pulse out, which is decided now."""
        pulse = self._open.pop(0)
        self._decided.append(pulse.time)
        self._delivered.append(pulse.delivered)
        self.closed += 1
        self.proven_by_ids += pulse.proven_by_ids
        self.unwatched += pulse.unwatched
        return pulse

    def lacking(self, camera: int) -> list[HostNs]:
        """Times of the open pulses up to the next frame of a camera."""
        times: list[HostNs] = []
        for pulse in self._open:
            if pulse.frames[camera] is not None:
                break
            times.append(pulse.time)
        return times

    def near(self, time: HostNs, half_ns: float) -> Iterator[OpenPulse]:
        """The open pulses that lie at most `half_ns` from a time."""
        for pulse in self._open[bisect_left(self._open, time - half_ns, key=_TIME) :]:
            if pulse.time > time + half_ns:
                return
            yield pulse

    def nearest_decided(self, time: HostNs, cameras: int) -> tuple[HostNs, int] | None:
        """The decided pulse nearest to a time, of those seen by one of `cameras`: time, and all cameras that saw it.

        Args:
            time: the time.
            cameras: one bit each.
        """
        those = ((of, who) for of, who in zip(self._decided, self._delivered, strict=True) if who & cameras)
        return min(those, key=lambda of: abs(of[0] - time), default=None)

    def count(self, since: HostNs, until: HostNs, tolerance: float, frames: Iterable[HostNs]) -> int | None:
        """How many pulses there are after one time, until another; None: that is too long ago.

        Args:
            since: time of a pulse.
            until: time of a later pulse.
            tolerance: trigger times that are this close are of one pulse.
            frames: trigger times of frames that are not assigned to pulses yet.
        """
        if len(self._decided) > 1 and since < self._decided[0]:
            return None
        known = [*self._decided, *(pulse.time for pulse in self._open)]
        for time in frames:
            if not any(abs(time - other) <= tolerance for other in known):
                known.append(time)
        known.sort()
        return bisect_right(known, until + tolerance) - bisect_right(known, since + tolerance)
