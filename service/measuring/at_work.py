"""The log that is at work: what is done with it, how far it is, and its figures as far as known."""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

from rig.api.jump import LastJump
from rig.api.measuring import MeasuringQueue, MeasuringState
from rig.background.messages import Progress
from service.measuring.waiting import WaitingLogs

#: Share of a step.
_SEEN_SHARE: Final = 0.05


class AtWork:
    """Any thread may call any method.

    Args:
        found: takes the main figures of the jumps of a log, when it is measured, before its files are there.
        changed: called when something has changed that people see.

    Attributes:
        running: what is done; None: nothing.
        figures: of the jumps of this log, before its files are there.
        queue: in which the log stands for as long as the work is wanted.
    """

    def __init__(self, found: Callable[[tuple[LastJump, ...]], None], changed: Callable[[], None]) -> None:
        self._found, self._changed = found, changed
        self._lock = threading.Lock()
        self.running: MeasuringQueue | None = None
        self.figures: tuple[LastJump, ...] = ()
        self.queue = WaitingLogs()

    @contextmanager
    def on(self, recording: str, queue: WaitingLogs) -> Iterator[None]:
        """Within, this recording is at work.

        Args:
            recording: its id.
            queue: in which it stands.
        """
        with self._lock:
            self.running, self.queue = MeasuringQueue(recording=recording, state=MeasuringState.MEASURING), queue
            self.figures = ()
        self._changed()
        try:
            yield
        finally:
            with self._lock:
                self.running = None

    def view(self, ids: Sequence[str]) -> MeasuringQueue:
        """What is at work, and how many of the logs that wait to be measured come after it."""
        running = self.running
        if running is None:
            return MeasuringQueue(waiting=len(ids))
        return running.model_copy(update={"waiting": sum(recording != running.recording for recording in ids)})

    def hold(self, held: bool) -> None:
        """Note that the work stands still, or goes on."""
        self._change(paused=held)

    def know(self, jumps: tuple[LastJump, ...]) -> None:
        """Have the figures while the files are being written."""
        self.figures = jumps
        self._found(jumps)
        self._changed()

    def hear(self, news: Progress) -> None:
        """Enter the progress of the program, in visible steps only, since every page hears of each."""
        known = self.running or MeasuringQueue()
        if news.step is not known.step or news.share >= known.share + _SEEN_SHARE:
            self._change(step=news.step, share=news.share)

    def _change(self, **what: Any) -> None:
        with self._lock:
            if self.running is not None:
                self.running = self.running.model_copy(update=what)
        self._changed()
