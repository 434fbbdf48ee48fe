"""When a helper process that ended is started again: at once where it was asked to end, else after a growing wait."""

import time
from collections.abc import Iterable
from dataclasses import dataclass

from rig.transport.process_table import BackOff, Child


@dataclass(frozen=True, slots=True)
class Restart:
    """What is done about a helper that ended.

    Attributes:
        start: start it again now.
        renewed: it was asked to end, to get other settings.
        wait_s: it ended by itself just now, and is started again after so long; None otherwise.
    """

    start: bool = False
    renewed: bool = False
    wait_s: float | None = None


class Restarts:
    """The helpers of a rig that have ended.

    Args:
        names: of all helpers.
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._back_offs = {name: BackOff() for name in names}
        self._again: dict[Child, float] = {}
        self._renewed: set[str] = set()

    @property
    def deaths(self) -> dict[str, int]:
        """By helper, how often it ended by itself."""
        return {name: back_off.deaths for name, back_off in self._back_offs.items()}

    def renew(self, name: str) -> None:
        """A helper has been asked to end, and is to be started again at once."""
        self._renewed.add(name)

    def ended(self, child: Child) -> Restart:
        """What is done about a helper that is not running."""
        name, now = child.spec.name, time.monotonic()
        if name in self._renewed:
            self._renewed.discard(name)
            self._again.pop(child, None)
            return Restart(start=True, renewed=True)
        if child not in self._again:
            back_off = self._back_offs[name] = self._back_offs[name].died(now - child.started)
            self._again[child] = now + back_off.wait_s
            return Restart(wait_s=back_off.wait_s)
        if now < self._again[child]:
            return Restart()
        del self._again[child]
        return Restart(start=True)
