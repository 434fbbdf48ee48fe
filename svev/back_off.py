"""How long to wait before something that died is started again."""

from typing import Final

_FIRST_S: Final = 1.0
_LONGEST_S: Final = 30.0
_GOOD_S: Final = 60.0


class BackOff:
    """One second at first, twice as long after every further death, up to 30 s; from the start after a good minute.

    Attributes:
        deaths: how many there were in all.
    """

    def __init__(self) -> None:
        self.deaths = 0
        self._wait_s = 0.0

    def died(self, lived_s: float) -> float:
        """Enter a death.

        Args:
            lived_s: how long it had run, s.

        Returns:
            Seconds to wait from now on before it is started again.
        """
        self.deaths += 1
        self._wait_s = _FIRST_S if lived_s >= _GOOD_S or not self._wait_s else min(_LONGEST_S, 2 * self._wait_s)
        return self._wait_s

    def forget(self) -> None:
        """Somebody has seen to it: wait for one second again."""
        self._wait_s = 0.0
