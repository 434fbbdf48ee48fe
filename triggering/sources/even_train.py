"""Pulses that are commands at even times of the host's clock, which all programs of a computer share."""

from rig.clocks import HostNs


class EvenTrain:
    """Pulses at even times, each of which is a command to one camera or to all. It waits for nothing itself.

    Args:
        origin: time of a pulse.
        period_ns: time between two.
        latest_ns: a command that would begin later than this after its pulse is not given.
        spread_ns: so long after its pulse a camera exposes at the latest.
    """

    def __init__(self, origin: HostNs, period_ns: int, latest_ns: int, spread_ns: int) -> None:
        self._origin, self._period_ns = origin, period_ns
        self._latest_ns, self._spread_ns = latest_ns, spread_ns
        self._done: int | None = None
        self._withheld = 0

    def until_next_ns(self, now: HostNs) -> int:
        """Time from `now` to the next pulse, ns."""
        return (self._origin - now) % self._period_ns

    def is_due(self, now: HostNs) -> bool:
        """Whether the camera is to be told now to expose: once for each pulse since the first call after `begin`.

        A pulse that is past by more than `latest_ns` is left out: a pulse without a frame is better than a frame that
        belongs to no pulse.
        """
        pulse, late_ns = divmod(now - self._origin, self._period_ns)
        if self._done is None:
            self._done = pulse
        if pulse == self._done:
            return False
        in_time = late_ns <= self._latest_ns
        self._withheld += pulse - self._done - in_time
        self._done = pulse
        return in_time

    def begin(self) -> None:
        """Note that the camera has just become ready, or all are: no earlier pulse is due any more."""
        self._done, self._withheld = None, 0

    def withheld(self) -> int:
        """How many pulses since the last call had no command, because it would have come too late."""
        withheld, self._withheld = self._withheld, 0
        return withheld

    def exposes(self, time: HostNs, within_ns: float) -> bool:
        """Whether a camera that was told in time can have exposed at `time`.

        Args:
            time: trigger time of a frame.
            within_ns: limit of its error.
        """
        return (time - self._origin + within_ns) % self._period_ns <= self._spread_ns + 2 * within_ns
