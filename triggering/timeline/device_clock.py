"""Converts a camera's clock to the common time line, which is the host's monotonic clock.

There are two sources. *Latches* (simultaneous readings of both clocks) are true within half their round trip: a
straight line through those with the shortest round trips in a sliding window gives offset and drift. *Sets of frames*
that one pulse exposed correct the line in between (the trim), but never by more than the uncertainty of the latches, so
that no run of odd frames moves a camera to the next pulse.
"""

import math
from collections import deque
from typing import Final

from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs

#: Latches this close together are one burst; only the one with the shortest round trip is kept.
_BURST_NS: Final = NS_PER_S
_BURSTS: Final = 16
#: Drift of a crystal before it is measured, ns per s (1 ppm = 1000 ns/s): one sigma for the fit, and the limit.
_DRIFT_SIGMA: Final = 100e3
_DRIFT_LIMIT: Final = 200e3
#: One sigma of a latch: its error is uniform within half its round trip, plus the noise of the reading itself.
_SIGMA_PER_ROUND_TRIP: Final = 12**-0.5
_READING_SIGMA_NS: Final = 1000.0
#: A latch that is off by more than its round trip explains plus this is a stray.
_STRAY_NS: Final = 1_000_000
#: Share of a set's disagreement that goes into the trim, and share of the trim that remains after a latch.
_TRIM_GAIN: Final = 0.05
_TRIM_KEPT: Final = 0.9


class DeviceClock:
    """Converts one camera's device times of one epoch to the common time line.

    Attributes:
        offset_ns: host time minus device time at the newest latch, ns; for health.
        drift_ppm: how much faster than the host the device clock runs; for health.
        uncertainty_ns: limit of the error of the line at the newest latch; infinite while the clock is not known.
            With the trim, which has the same limit, the error may be twice that.
        steps: how often the clock was found to have been set anew.
        from_zero: whether it began at zero the last time: it ran over, or the camera restarted.
    """

    def __init__(self) -> None:
        self.offset_ns = 0
        self.uncertainty_ns = math.inf
        self.steps = 0
        self.from_zero = False
        self._best: deque[ClockLatch] = deque(maxlen=_BURSTS)
        self._burst_start = HostNs(0)
        self._stray: ClockLatch | None = None
        self._newest: ClockLatch | None = None  # of those that agree
        self._reference = DeviceNs(0)
        self._slope = 0.0  # host minus device, ns per s of device time
        self._slope_uncertainty = _DRIFT_LIMIT
        self._constant = 0.0
        self._trim = 0.0

    @property
    def known(self) -> bool:
        """Whether there has been a latch."""
        return bool(self._best)

    @property
    def drift_ppm(self) -> float:
        """How much faster than the host the device clock runs, parts per million."""
        return -self._slope / 1000

    def to_host(self, device: DeviceNs) -> HostNs:
        """Host time of a device time. Meaningless while the clock is not `known`."""
        line = self._constant + self._slope * ((device - self._reference) / NS_PER_S)
        return HostNs(device + self.offset_ns + round(line + self._trim))

    def uncertainty_at(self, device: DeviceNs) -> float:
        """`uncertainty_ns` at a device time: it grows with the time since the newest latch."""
        return self.uncertainty_ns + self._slope_uncertainty * max(0, device - self._reference) / NS_PER_S

    def uncertainty_since(self, host: HostNs) -> float:
        """`uncertainty_at`, by the time on the common time line."""
        since = max(0, host - self._reference - self.offset_ns)
        return self.uncertainty_ns + self._slope_uncertainty * since / NS_PER_S

    def latch(self, latch: ClockLatch) -> bool:
        """Enter a reading of both clocks; readings come in the order of time.

        Returns:
            Whether it agrees with those before, or is the first.
        """
        if not self.known:
            self._keep(latch)
            self._fit()
            return True
        if self._is_stray(latch):
            self._start_anew_if_agreed(latch)
            return False
        self._stray = None
        self._keep(latch)
        self._fit()
        self._trim *= _TRIM_KEPT  # it corrected the old line
        self._limit_trim(latch.device)
        return True

    def start_anew(self, longest_ns: float) -> bool:
        """Forget all readings but the newest one: frames show that the clock was set by less than a stray reading.

        Args:
            longest_ns: a reading that took longer is not exact enough for that.

        Returns:
            Whether there was anything to forget.
        """
        newest = self._newest
        if newest is None or newest.round_trip_ns > longest_ns or list(self._best) == [newest]:
            return False
        self._best.clear()
        self._keep(newest)
        self._trim = 0.0
        self._fit()
        return True

    def correct(self, device: DeviceNs, error_ns: int) -> None:
        """Correct the line by a set of frames of one pulse.

        Args:
            device: this camera's trigger time.
            error_ns: time of the pulse, as the other cameras give it, minus the present `to_host(device)`.
        """
        self._trim += _TRIM_GAIN * error_ns
        self._limit_trim(device)

    def _limit_trim(self, device: DeviceNs) -> None:
        bound = self.uncertainty_at(device)
        self._trim = min(bound, max(-bound, self._trim))

    def _is_stray(self, latch: ClockLatch) -> bool:
        allowed = latch.round_trip_ns / 2 + self.uncertainty_at(latch.device) + _STRAY_NS
        return abs(latch.host - self.to_host(latch.device)) > allowed

    def _start_anew_if_agreed(self, latch: ClockLatch) -> None:
        """Start anew after two strays in a row that agree: the clock was set. A single one is a misread register."""
        previous, self._stray = self._stray, latch
        if previous is None:
            return
        apart = (latch.host - latch.device) - (previous.host - previous.device)
        drift = _DRIFT_LIMIT * abs(latch.device - previous.device) / NS_PER_S
        if abs(apart) > (latch.round_trip_ns + previous.round_trip_ns) / 2 + drift + _STRAY_NS:
            return
        self.from_zero = self._begins_at_zero(previous)
        self._best.clear()
        self._keep(previous)
        self._keep(latch)
        self._stray, self._trim = None, 0.0
        self.steps += 1
        self._fit()

    def _begins_at_zero(self, latch: ClockLatch) -> bool:
        """Whether a clock that went back shows no more than the time since its last consistent reading."""
        before = self._newest
        if before is None or not 0 <= latch.device < before.device:
            return False
        return latch.device <= latch.host - before.host + before.round_trip_ns + latch.round_trip_ns

    def _keep(self, latch: ClockLatch) -> None:
        """Keep the shortest round trip of each burst."""
        self._newest = latch
        if not self._best or latch.host - self._burst_start >= _BURST_NS:
            self._burst_start = latch.host
            self._best.append(latch)
        elif latch.round_trip_ns <= self._best[-1].round_trip_ns:
            self._best[-1] = latch

    def _fit(self) -> None:
        """Fit a weighted straight line through the kept latches.

        The drift has a prior of 0 +- 100 ppm: latches that are too close together to tell it leave it near 0, latches
        some seconds apart determine it.
        """
        newest = self._best[-1]
        self._reference, self.offset_ns = newest.device, newest.host - newest.device
        w = wx = wxx = wy = wxy = 0.0
        for latch in self._best:
            weight = (_SIGMA_PER_ROUND_TRIP * latch.round_trip_ns + _READING_SIGMA_NS) ** -2
            x = (latch.device - newest.device) / NS_PER_S
            y = (latch.host - latch.device) - self.offset_ns
            w += weight
            wx += weight * x
            wxx += weight * x * x
            wy += weight * y
            wxy += weight * x * y
        wxx += _DRIFT_SIGMA**-2
        determinant = w * wxx - wx * wx
        self._constant = (wxx * wy - wx * wxy) / determinant
        self._slope = (w * wxy - wx * wy) / determinant
        self._slope_uncertainty = min(3 * math.sqrt(w / determinant), _DRIFT_LIMIT)
        self.uncertainty_ns = min(self._bound_by(latch) for latch in self._best)

    def _bound_by(self, latch: ClockLatch) -> float:
        """Limit of the line's error at the newest latch that follows from one latch alone."""
        x = (latch.device - self._reference) / NS_PER_S
        residual = latch.host - latch.device - self.offset_ns - (self._constant + self._slope * x)
        return abs(residual) + latch.round_trip_ns / 2 + self._slope_uncertainty * abs(x)
