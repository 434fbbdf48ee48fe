"""Lets any thread give commands to the supervisor's thread, which alone owns the rig, and wait for the answers."""

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
    """A queue of commands, with a bell that wakes the thread that carries them out (the owner).

    Attributes:
        bell: descriptor that becomes readable when there is a command; for the owner's `select`.
    """

    def __init__(self) -> None:
        self.bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._queue: queue.SimpleQueue[tuple[Callable[[Future[Any]], None], Future[Any]]] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._over = False

    def ask(self, command: Callable[["Future[T]"], None], deadline_s: float) -> T:
        """Have the owner carry out a command, and wait for the answer.

        Args:
            command: called in the owner's thread; sets the result or error of its future, now or later.
            deadline_s: longest time to wait, s.

        Raises:
            ProcessDiedError: no answer came in time; the command may still be carried out.
            SvevError: the error that the command raised or set.
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
        """Carry out all commands in the queue; called by the owner."""
        with suppress(BlockingIOError):  # the bell has not rung
            os.eventfd_read(self.bell)
        with suppress(queue.Empty):
            while True:
                command, future = self._queue.get_nowait()
                try:
                    command(future)
                except Exception as error:  # noqa: BLE001 - any error is the answer; the owner goes on
                    future.set_exception(error)

    def end(self) -> None:
        """Refuse all commands from now on, and those that are still in the queue."""
        with self._lock:
            self._over = True
        with suppress(queue.Empty):
            while True:
                self._queue.get_nowait()[1].set_exception(_ending())

    def close(self) -> None:
        """Close the bell; call it after `end`."""
        os.close(self.bell)


def at_once(function: Callable[[], T]) -> Callable[["Future[T]"], None]:
    """A command whose answer is what `function` returns in the owner's thread."""
    return lambda answer: answer.set_result(function())


def _ending() -> ProcessDiedError:
    return ProcessDiedError("the service is ending: wait until it runs again")
