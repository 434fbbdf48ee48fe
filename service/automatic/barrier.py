"""Watches a light barrier on an input line of the computer, in a thread of its own."""

import os
import select
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from rig.api.status import State
from rig.clocks import HostNs
from rig.errors import TriggerError
from rig.phrase import Phrase
from rig.settings.trigger import BarrierSettings
from triggering.sources.gpio.lines import EdgeLine

_RETRY_MS: Final = 2000


class BarrierWatch:
    """Waits for edges of the line; begun by `start`, ended by `close`.

    Args:
        barrier: which line.
        state: the state of the service.
        crossed: called with the host time of an edge while the rig is armed, in the watching thread.
        failed: called when the line cannot be had or fails, once for each reason; it is tried again.
    """

    def __init__(
        self,
        barrier: BarrierSettings,
        state: Callable[[], State],
        crossed: Callable[[HostNs], None],
        failed: Callable[[Phrase], None],
    ) -> None:
        self._barrier, self._state, self._crossed, self._failed = barrier, state, crossed, failed
        self._line: EdgeLine | None = None
        self._asking = threading.Lock()  # nobody asks a line that is given back
        self._closing = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._thread = threading.Thread(target=self._run, name="light barrier")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def interrupted(self) -> bool | None:
        """Whether the beam is interrupted now; None: the line is not had, or fails. Any thread may ask."""
        with self._asking:
            try:
                return None if self._line is None else self._line.active()
            except TriggerError:
                return None  # the watching thread tells of it

    def close(self) -> None:
        """End the thread."""
        os.eventfd_write(self._closing, 1)
        if self._thread.is_alive():
            self._thread.join()
        os.close(self._closing)

    def _run(self) -> None:
        barrier, said = self._barrier, ""
        poll = select.poll()
        poll.register(self._closing, select.POLLIN)
        while True:
            try:
                with EdgeLine(
                    barrier.chip, barrier.line, active_low=barrier.active_low, debounce_ms=barrier.debounce_ms
                ) as line:
                    with self._had(line):
                        self._watch(line)
                    return
            except TriggerError as error:
                if str(error) != said:
                    said = str(error)
                    self._failed(error.said)
            if poll.poll(_RETRY_MS):
                return

    @contextmanager
    def _had(self, line: EdgeLine) -> Iterator[None]:
        """Let others ask for the level of the line meanwhile."""
        self._line = line
        try:
            yield
        finally:
            with self._asking:
                self._line = None

    def _watch(self, line: EdgeLine) -> None:
        """Tell of edges until the watch is closed.

        Raises:
            TriggerError: the line fails.
        """
        poll = select.poll()
        poll.register(self._closing, select.POLLIN)
        poll.register(line, select.POLLIN)
        while not any(descriptor == self._closing for descriptor, _ in poll.poll()):
            edges = line.edges()
            if self._state() in {State.ARMED, State.RECORDING}:
                for time in edges:
                    self._crossed(time)
