"""Whether the computer's clock may decide what is old enough to be removed for good."""

import time
from collections.abc import Callable
from typing import Final

from rig.clocks import NS_PER_S, UtcAnchor
from rig.host.utc_clock import SetClock, is_synchronized

#: Programs that keep a clock right move it by less than 5 ms between two looks (500 ppm, adjtimex(2)); a step is more.
_STEP_NS: Final = NS_PER_S
#: For so long after a step, and after the service has begun to look, nothing is old.
QUIET_S: Final = 3600.0


class SteadyClock:
    """Compares the clock with the time that the computer has been running; one thread asks at intervals.

    Args:
        utc_s: the clock, s.
        running_s: time since the computer was started, s; nobody sets it.
        synchronized: whether some program keeps the clock right.
    """

    def __init__(
        self,
        utc_s: Callable[[], float] = time.time,
        running_s: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_BOOTTIME),
        synchronized: Callable[[], bool] = is_synchronized,
    ) -> None:
        self._running_s, self._synchronized = running_s, synchronized
        self._set = SetClock(lambda: UtcAnchor(round((utc_s() - running_s()) * NS_PER_S)), _STEP_NS)
        self._since = running_s()

    def trusted(self) -> bool:
        """Whether the clock is kept right, and has not been set for an hour."""
        running = self._running_s()
        if self._set.moved_s():
            self._since = running
        return running - self._since >= QUIET_S and self._synchronized()
