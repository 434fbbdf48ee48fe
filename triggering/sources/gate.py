"""Lets pulses of a train through: all, none, or so many more."""

import threading


class Gate:
    """One thread sets the gate; another thread, which makes the pulses, asks it.

    Args:
        still: none pass at first; else all do.
    """

    def __init__(self, *, still: bool = False) -> None:
        self._lock = threading.Lock()
        self._left: int | None = 0 if still else None

    def let(self, pulses: int | None) -> None:
        """Let so many more pulses through, from now on; None: all."""
        with self._lock:
            self._left = pulses

    @property
    def open(self) -> bool:
        """Whether all pass."""
        return self._left is None

    @property
    def still(self) -> bool:
        """Whether none pass."""
        return self._left == 0

    def passes(self) -> bool:
        """Whether the pulse that is due now is to be made; it counts."""
        with self._lock:
            if not self._left:
                return self._left is None
            self._left -= 1
            return True

    def take(self) -> int | None:
        """How many more pass, for who makes them all at once; None: all, and it stays so."""
        with self._lock:
            left = self._left
            self._left = None if left is None else 0
            return left
