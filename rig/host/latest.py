"""Writes in a thread of its own what may be renewed faster than a disk takes it: only the latest is written."""

import threading
import time
from collections.abc import Callable


class LatestWriter:
    """The thread never keeps the process alive, since the disk may hang. Any thread may call `write` and `wait`.

    Args:
        name: of the thread.
        lament: told once that the disk refuses, until it takes something again; called by that thread.
    """

    def __init__(self, name: str, lament: Callable[[OSError], None]) -> None:
        self._name, self._lament = name, lament
        self._changed = threading.Condition()
        self._waiting: Callable[[], None] | None = None
        self._busy = self._failed = False

    @property
    def failed(self) -> bool:
        """Whether the disk refused what was written last."""
        return self._failed

    def write(self, order: Callable[[], None]) -> None:
        """Begin to write; an order that still waits is forgotten.

        Args:
            order: writes, and raises OSError if the disk refuses.
        """
        with self._changed:
            self._waiting = order
            if not self._busy:
                self._busy = True
                threading.Thread(target=self._run, name=self._name, daemon=True).start()

    def wait(self, timeout_s: float) -> bool:
        """Wait until the latest is written, or refused; False if it is neither after `timeout_s`."""
        until = time.monotonic() + timeout_s
        with self._changed:
            while self._busy and (left := until - time.monotonic()) > 0:
                self._changed.wait(left)
            return not self._busy

    def _run(self) -> None:
        while True:
            with self._changed:
                order, self._waiting = self._waiting, None
                if order is None:
                    self._busy = False
                    self._changed.notify_all()
                    return
            try:
                order()
            except OSError as error:
                if not self._failed:
                    self._failed = True
                    self._lament(error)
            else:
                self._failed = False
