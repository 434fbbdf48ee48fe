"""What one camera of a recorded log does at which host time, when the log is repeated without a pause.

All cameras of a rig get the same start time, so they replay the frames of one pulse at the same instant. Pulses are
numbered from 0 on through all rounds: number `n` is the pulse at place `n % N` of a log with N pulses.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Final, Protocol

import numpy as np

from rig.clocks import NS_PER_US, DeviceNs, HostNs, UtcNs
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.tag import CameraTag

#: A device clock that jumps by more than this plus the drift of a crystal was set anew: a new connection begins.
_CLOCK_STEP_NS: Final = 5_000_000
_DRIFT: Final = 200e-6
#: Prior of a clock's drift (100 ppm) against the noise of a trigger time (10 us): a few frames must not tell a drift.
_RATE_PRIOR_NS2: Final = (10_000 / 100e-6) ** 2
#: Block ids of 16 bits run from 1 to this and skip 0.
_IDS_16_BIT: Final = 65535


class FrameSource(Protocol):
    """One camera of a recorded log."""

    @property
    def name(self) -> str:
        """Of the log, for messages."""
        ...

    @property
    def times(self) -> Sequence[UtcNs]:
        """Of the log's pulses, in order."""
        ...

    @property
    def tags(self) -> Sequence[CameraTag]:
        """What became of each of the pulses in this camera."""
        ...

    @property
    def period_ns(self) -> int:
        """Usual time between two pulses."""
        ...

    def read_into(self, out: Stored, place: int) -> bool:
        """Copy the frame of one pulse.

        Args:
            out: shape (rows, columns).
            place: of the pulse in `times`.

        Returns:
            False if the log is damaged there.

        Raises:
            CameraError: the log cannot be read any more.
        """
        ...


@dataclass(frozen=True, slots=True)
class _Connection:
    """A stretch of the log in which ids and device clock run on.

    Attributes:
        first: place of the first whole frame.
        at_ns: a time since the first pulse of the log.
        device_ns: the device clock then.
        rate: how much faster than the host's the device clock runs, as a share.
    """

    first: int
    at_ns: int
    device_ns: int
    rate: float

    def device(self, at_ns: int) -> int:
        since = at_ns - self.at_ns
        return self.device_ns + since + round(self.rate * since)


class Timeline:
    """One camera's part of a log, repeated from a start time on.

    Args:
        source: the camera's part of the log; at least one pulse.
        start: host time of the first pulse.

    Attributes:
        source: as given.
        id_modulus: how many different frame ids there are, 0 if they never wrap.
    """

    def __init__(self, source: FrameSource, start: HostNs) -> None:
        self.source = source
        self._start = start
        self._at = [time - source.times[0] for time in source.times]
        self._round_ns = self._at[-1] + source.period_ns
        frames = [place for place, tag in enumerate(source.tags) if tag.status is FrameStatus.OK]
        latencies = [self._latency(place) for place in frames]
        self._latency_ns = round(median(latencies)) if latencies else source.period_ns // 2
        self.id_modulus = _IDS_16_BIT if any(map(self._wraps, frames, frames[1:])) else 0
        self._connections = self._find_connections(frames)
        self._frames_per_round, self._triggers_per_round = self._counts_per_round(frames)

    # -- pulses --------------------------------------------------------------------------------------------------

    def next_pulse(self, after: HostNs) -> int:
        """Number of the first pulse strictly later than `after`."""
        rounds, rest = divmod(after - self._start, self._round_ns)
        return max(0, rounds * len(self._at) + bisect_right(self._at, rest))

    def pulse_time(self, pulse: int) -> HostNs:
        """When a pulse fires."""
        rounds, place = divmod(pulse, len(self._at))
        return HostNs(self._start + rounds * self._round_ns + self._at[place])

    def arrival(self, pulse: int) -> HostNs:
        """When the frame of a pulse, whole or damaged, is in memory: as long after the pulse as in the log."""
        place = pulse % len(self._at)
        whole = self.tag(pulse).host_time is not None
        return HostNs(self.pulse_time(pulse) + (self._latency(place) if whole else self._latency_ns))

    def tag(self, pulse: int) -> CameraTag:
        """What became of a pulse in this camera; ids and times are those of the log."""
        return self.source.tags[pulse % len(self._at)]

    def present_from(self, pulse: int) -> int | None:
        """The first pulse from `pulse` on at which the camera is there; None if it is absent in the whole log."""
        rest = range(pulse, pulse + len(self._at))
        return next((later for later in rest if self.tag(later).status is not FrameStatus.ABSENT), None)

    # -- what the camera counts and tells ------------------------------------------------------------------------

    def connection(self, pulse: int) -> int:
        """Index of the connection that a pulse belongs to; ids and clocks of different connections are unrelated."""
        place = pulse % len(self._at)
        return max(0, bisect_right(self._connections, place, key=lambda connection: connection.first) - 1)

    def device_time(self, host: HostNs, connection: int) -> DeviceNs:
        """What the camera's clock shows at a host time."""
        return DeviceNs(self._connections[connection].device(host - self._start))

    def frame_device_time(self, pulse: int) -> DeviceNs:
        """The camera's clock at a pulse: as logged with the frame; without a frame, as computed."""
        rounds, logged = pulse // len(self._at), self.tag(pulse).device_time
        connection = self._connections[self.connection(pulse)]
        if logged is None:
            return DeviceNs(connection.device(self.pulse_time(pulse) - self._start))
        return DeviceNs(logged + rounds * (self._round_ns + round(connection.rate * self._round_ns)))

    def frame_id(self, pulse: int) -> int:
        """Id of the whole frame of a pulse: that of the log, counted on in later rounds."""
        frame_id = (self.tag(pulse).frame_id or 0) + pulse // len(self._at) * self._frames_per_round
        return (frame_id - 1) % self.id_modulus + 1 if self.id_modulus else frame_id

    def trigger_count(self, pulse: int) -> int:
        """The camera's count of triggers at the whole frame of a pulse, likewise; -1 if it has none."""
        logged = self.tag(pulse).trigger_count
        return -1 if logged is None else logged + pulse // len(self._at) * self._triggers_per_round

    # -- details -------------------------------------------------------------------------------------------------

    def _latency(self, place: int) -> int:
        """From the pulse to its whole frame in memory."""
        arrived = self.source.tags[place].host_time
        return 0 if arrived is None else max(0, arrived - self.source.times[place])

    def _trigger(self, place: int) -> int:
        """When the frame of a pulse was triggered, since the first pulse of the log."""
        return self._at[place] + round((self.source.tags[place].offset_us or 0.0) * NS_PER_US)

    def _clock_runs_on(self, earlier: int, later: int) -> bool:
        """Whether the device clock was left alone between two whole frames."""
        device = (self.source.tags[later].device_time or 0) - (self.source.tags[earlier].device_time or 0)
        host = self._trigger(later) - self._trigger(earlier)
        return abs(device - host) <= _CLOCK_STEP_NS + _DRIFT * host

    def _id_step(self, earlier: int, later: int) -> int:
        return (self.source.tags[later].frame_id or 0) - (self.source.tags[earlier].frame_id or 0)

    def _wraps(self, earlier: int, later: int) -> bool:
        """Whether 16-bit ids began anew between two whole frames, though nothing happened to the camera."""
        return self._id_step(earlier, later) < -_IDS_16_BIT // 2 and self._clock_runs_on(earlier, later)

    def _find_connections(self, frames: Sequence[int]) -> list[_Connection]:
        if not frames:
            return [_Connection(0, 0, 0, 0.0)]
        breaks = [
            place
            for place, (earlier, later) in enumerate(pairwise(frames), 1)
            if not self._clock_runs_on(earlier, later)
            or (self._id_step(earlier, later) <= 0 and not self._wraps(earlier, later))
        ]
        bounds = [0, *breaks, len(frames)]
        return [self._fit(frames[first:end]) for first, end in pairwise(bounds)]

    def _fit(self, frames: Sequence[int]) -> _Connection:
        """A straight line through the trigger times of a connection's frames on both clocks."""
        at_ns, device_ns = self._trigger(frames[0]), self.source.tags[frames[0]].device_time or 0
        host = np.array([self._trigger(place) - at_ns for place in frames], float)
        ahead = np.array([(self.source.tags[place].device_time or 0) - device_ns for place in frames], float) - host
        centred = host - host.mean()
        rate = float(centred @ ahead / (centred @ centred + _RATE_PRIOR_NS2))
        return _Connection(frames[0], at_ns, device_ns + round(float(ahead.mean()) - rate * float(host.mean())), rate)

    def _counts_per_round(self, frames: Sequence[int]) -> tuple[int, int]:
        """By how much frame ids and trigger counts go on from round to round."""
        if not frames:
            return 0, 0
        tags = self.source.tags
        first, last = tags[frames[0]], tags[frames[-1]]
        wraps = sum(map(self._wraps, frames, frames[1:])) * _IDS_16_BIT
        between = [tag.status for tag in (*tags[frames[-1] + 1 :], *tags[: frames[0]])]
        seam = 1 + sum(status in {FrameStatus.LOST, FrameStatus.DAMAGED} for status in between)
        triggers = (last.trigger_count or 0) - (first.trigger_count or 0)
        return (last.frame_id or 0) + wraps - (first.frame_id or 0) + seam, triggers + seam
