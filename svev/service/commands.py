"""Commands from any thread to the one that owns the rig, each with a deadline."""

import os
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import suppress
from typing import Any, TypeVar

from rig.errors import ProcessDiedError

T = TypeVar("T")


class Commands:
    """A queue whose bell wakes the owner.

    Attributes:
        bell: becomes readable when there is a command; for the owner's `select`.
    """

    def __init__(self) -> None:
        self.bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._queue: queue.SimpleQueue[tuple[Callable[[Future[Any]], None], Future[Any]]] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._over = False

    def ask(self, command: Callable[["Future[T]"], None], deadline_s: float) -> T:
        """Have the owner carry out a command, and wait for the answer.

        Args:
            command: called by the owner; gives its future a result or an error, now or later.
            deadline_s: wait no longer than this, s.

        Raises:
            ProcessDiedError: no answer in time; what was asked for may still happen.
            SvevError: whatever the command says.
        """
        future: Future[T] = Future()
        with self._lock:
            if self._over:
                raise _ending()
            self._queue.put((command, future))
            self.ring()
        try:
            return future.result(deadline_s)
        except FutureTimeoutError:
            raise ProcessDiedError(
                f"the service did not get it done within {deadline_s:g} s: look at its state, and try again"
            ) from None

    def ring(self) -> None:
        """Wake the owner. May be called from a signal handler."""
        os.eventfd_write(self.bell, 1)

    def carry_out(self) -> None:
        """Carry out what has been asked; the owner calls this."""
        with suppress(BlockingIOError):  # nobody has rung
            os.eventfd_read(self.bell)
        with suppress(queue.Empty):
            while True:
                command, future = self._queue.get_nowait()
                try:
                    command(future)
                except Exception as error:  # noqa: BLE001 - whatever it is, it is the answer; the owner goes on
                    future.set_exception(error)

    def end(self) -> None:
        """Refuse whatever is asked from now on, and what has not been carried out."""
        with self._lock:
            self._over = True
        with suppress(queue.Empty):
            while True:
                self._queue.get_nowait()[1].set_exception(_ending())

    def close(self) -> None:
        """Give the bell back, after the end."""
        os.close(self.bell)


def _ending() -> ProcessDiedError:
    return ProcessDiedError("the service is ending: wait until it runs again")
