"""Commands from any thread to the one that owns the rig, each with a deadline."""

import os
import queue
from collections.abc import Callable
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from typing import TypeVar

from rig.errors import ProcessDiedError, SvevError

T = TypeVar("T")


class Commands:
    """A queue whose bell wakes the owner.

    Attributes:
        bell: becomes readable when there is a command; for the owner's `select`.
    """

    def __init__(self) -> None:
        self.bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._queue: queue.SimpleQueue[Callable[[], None]] = queue.SimpleQueue()

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
        self._queue.put(lambda: _carry_out(command, future))
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
        try:
            os.eventfd_read(self.bell)
        except BlockingIOError:
            return
        while True:
            try:
                self._queue.get_nowait()()
            except queue.Empty:
                return

    def close(self) -> None:
        """Give the bell back; nobody may ask any more."""
        os.close(self.bell)


def _carry_out(command: Callable[["Future[T]"], None], future: "Future[T]") -> None:
    try:
        command(future)
    except SvevError as error:
        future.set_exception(error)
