"""Lets any thread give commands to the supervisor's thread, which alone owns the rig, and wait for the answers."""

import os
import queue
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import suppress
from typing import TypeVar

from rig.errors import ProcessDiedError
from service.supervision.messages import Command, End, Message

T = TypeVar("T")


class Commands:
    """A queue of messages, with a bell that wakes the thread that takes them (the owner).

    Attributes:
        bell: descriptor that becomes readable when there is a message; for the owner's `select`.
    """

    def __init__(self) -> None:
        self.bell = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._queue: queue.SimpleQueue[Message] = queue.SimpleQueue()
        self._lock = threading.Lock()
        self._over = False

    def ask(self, make: "Callable[[Future[T]], Command[T]]", deadline_s: float) -> T:
        """Give the owner a command, and wait for the answer.

        Args:
            make: makes the command of who waits for its answer.
            deadline_s: longest time to wait, s.

        Raises:
            ProcessDiedError: no answer came in time; the command may still be obeyed.
            SvevError: why it cannot be obeyed.
        """
        future: Future[T] = Future()
        with self._lock:
            if self._over:
                raise _ending()
            self._queue.put(make(future))
            self.ring()
        try:
            return future.result(deadline_s)
        except FutureTimeoutError:
            raise ProcessDiedError(
                f"the service did not get it done within {deadline_s:g} s: look at its state, and try again"
            ) from None

    def end_by(self, moment: float) -> None:
        """Tell the owner to end, at the latest at a moment on the monotonic clock, s; also from a signal handler."""
        self._queue.put(End(moment))
        self.ring()

    def ring(self) -> None:
        """Wake the owner. May be called from a signal handler."""
        os.eventfd_write(self.bell, 1)

    def fetch(self) -> Iterator[Message]:
        """All messages in the queue; for the owner."""
        with suppress(BlockingIOError):  # the bell has not rung
            os.eventfd_read(self.bell)
        with suppress(queue.Empty):
            while True:
                yield self._queue.get_nowait()

    def end(self) -> None:
        """Refuse all commands from now on, and those that are still in the queue."""
        with self._lock:
            self._over = True
        for message in self.fetch():
            if isinstance(message, Command):
                message.answer.set_exception(_ending())

    def close(self) -> None:
        """Close the bell; call it after `end`."""
        os.close(self.bell)


def _ending() -> ProcessDiedError:
    return ProcessDiedError("the service is ending: wait until it runs again")
