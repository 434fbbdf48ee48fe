"""Watches a light barrier on an input line of the computer, in a thread of its own."""

import os
import select
import threading
from collections.abc import Callable
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
        self._closing = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._thread = threading.Thread(target=self._run, name="light barrier")

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

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
                    self._watch(line)
                    return
            except TriggerError as error:
                if str(error) != said:
                    said = str(error)
                    self._failed(error.said)
            if poll.poll(_RETRY_MS):
                return

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
