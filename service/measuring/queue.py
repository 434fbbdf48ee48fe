"""The logs that wait to be measured: one after the other, the last jump first, none while a recording runs.

A log is queued when it is opened, and measured when it is closed; then come the further steps that the rig file asks
for. None is forgotten: a service that was killed, or a computer without power, goes on with the queue. When nothing is
to be measured, recordings are copied to the other disk that `[offload]` names; those that are not there yet, or have
changed since, are found by looking.
"""

import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from analysis.result.naming import CAMERAS
from recorder.log.measured_path import measured_path
from recorder.log.write_lock import is_being_written
from rig.api.jump import LastJump
from rig.api.measuring import AfterStep, Measurement, MeasuringQueue, MeasuringState, MeasuringStep, StepState
from rig.api.statement import Level, Statement
from rig.background.messages import Progress
from rig.errors import NoAnalysisError, StateForbidsError
from rig.events import Event
from rig.events import Level as EventLevel
from rig.phrase import phrase
from rig.settings.model import RigSettings
from service.measuring.after_steps import AfterSteps
from service.measuring.copies import Copies
from service.measuring.results import is_outdated, measurement_of
from service.measuring.retries import Retries
from service.measuring.waiting import QueueFile, WaitingLogs
from service.offloading.releasing import Releasing, Removal

_QUEUE_LOOK_S: Final = 0.2
#: So often survey or poses are looked at while nothing waits.
_SOURCE_LOOK_S: Final = 2.0
#: Share of a step.
_SEEN_SHARE: Final = 0.05
_THREAD_ENDS_S: Final = 10.0
#: What is at work in these steps; in all others the log is measured.
_AT_WORK: Final = {MeasuringStep.VIDEO: AfterStep.VIDEO}
#: Why nothing can be measured, and what to do.
_NO_SOURCE: Final = (
    "nothing says where the balls are: give the rig file an [analysis] with survey or calibration, and restart the "
    "service"
)


class Measurings:
    """Measures logs in a thread of its own; a context manager. Any thread may call any method.

    Args:
        folder: folder of the recordings.
        in_use: gives the rig in use, whose `[analysis]` says where the balls or the cameras are.
        busy: whether a recording runs.
        earlier: gives the `kinogram.json` of the other measured logs of whoever jumps in a recording.
        tell: takes an event for the live log.
        found: takes the main figures of the jumps of a log, when it is measured, before its files are there.
        changed: called when something has changed that people see.
        removal: how recordings are removed that are safe on another disk.
    """

    def __init__(
        self,
        folder: Path,
        in_use: Callable[[], RigSettings],
        busy: Callable[[], bool],
        earlier: Callable[[str], Sequence[Path]],
        tell: Callable[[Event], None],
        found: Callable[[tuple[LastJump, ...]], None],
        changed: Callable[[], None],
        removal: Removal,
    ) -> None:
        self._folder, self._in_use, self._busy, self._changed = folder, in_use, busy, changed
        self._tell = tell
        self._file = QueueFile(folder, tell)
        self._waiting = WaitingLogs(self._file.keep)
        self._names = WaitingLogs()  # results whose files say a corrected name: they tell so themselves
        self._copies = Copies(folder, in_use, tell)
        self._releasing = Releasing(folder, in_use, self._copies.notes, removal, tell)
        self._at = self._waiting  # what the log stands in that is at work
        self._retries = Retries(folder, in_use)
        self._gone: set[str] = set()  # deleted before they were measured
        self._running: MeasuringQueue | None = None
        self._figures: tuple[LastJump, ...] = ()  # of what is running
        self._found = found
        self._after = AfterSteps(
            folder, busy, earlier, self._wanted, self._hear, self._hold, tell, self._know, self._copies.notes
        )
        self._lock = threading.Lock()
        self._bell, self._closed = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="measuring", daemon=True)

    def __enter__(self) -> "Measurings":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closed.set()
        self._bell.set()
        self._thread.join(_THREAD_ENDS_S)
        self._file.wait(_THREAD_ENDS_S)

    def opened(self, log: Path) -> None:
        """Note that a recording writes this log; when it is closed that is done with it which the rig file asks for.

        It comes before those that wait: people at the hill look at the last jump.
        """
        rig = self._in_use()
        if log.parent != self._folder:
            return
        if rig.analysis is not None and rig.analysis.after_recording:
            with suppress(StateForbidsError):  # two thousand wait: this one is measured when somebody asks
                self._waiting.add(log.stem, first=True)
        self._copies.want(log.stem)
        self._bell.set()

    def restored(self, recording: str, log: Path) -> None:
        """A recording is back from the trash: if it was deleted before its turn came, it waits again."""
        if recording in self._gone:
            self._gone.discard(recording)
            with suppress(StateForbidsError):  # two thousand wait: this one is measured when somebody asks
                self._waiting.add(recording)
            self._bell.set()
        self.renamed(recording, log)

    def renamed(self, recording: str, log: Path) -> None:
        """The session of a recording was corrected: the files of its result that name the jumper are written anew."""
        if log.parent == self._folder and is_outdated(log):
            with suppress(StateForbidsError):  # two thousand wait: a service that starts again finds it
                self._names.add(recording)
            self._bell.set()

    def want(self, recording: str, log: Path) -> Measurement:
        """Have a log measured, again if it was measured before.

        Args:
            recording: its id.
            log: the log, in the folder.

        Raises:
            NoAnalysisError: the rig file does not say by what.
            StateForbidsError: too many are waiting.
        """
        if self._in_use().analysis is None:
            raise NoAnalysisError(_NO_SOURCE)
        self._waiting.add(recording)
        self._bell.set()
        self._changed()
        return self.measurement(recording, log)

    def give_up(self, recording: str, log: Path) -> Measurement:
        """Do not measure a log that waits or is being measured; an earlier result stays."""
        self._waiting.remove(recording)
        self._bell.set()
        self._changed()
        return self.measurement(recording, log)

    def measurement(self, recording: str, log: Path) -> Measurement:
        """The measured jumps of a log in the folder, and the progress of its measuring."""
        ids, running = self._waiting.ids, self._running
        known = measurement_of(recording, log)  # what left the queue before is there
        if self._in_use().analysis is None:
            what, _, advice = _NO_SOURCE.partition(": ")
            refused = Statement(level=Level.INFO, code="no_analysis", text=what, advice=advice)
            known = known.model_copy(update={"refused": refused})
        copy = self._copies.step(recording, running)
        if running is not None and running.step is MeasuringStep.COPYING:
            running = None
        if recording not in ids:
            return known.model_copy(update={"steps": (*known.steps, *copy)})
        if running is None or running.recording != recording:
            others = [other for other in ids if running is None or other != running.recording]
            before = others.index(recording) + (running is not None)
            update: dict[str, Any] = {"state": MeasuringState.WAITING, "before": before}
            running = None
        else:
            update = {name: getattr(running, name) for name in ("state", "paused", "step", "share")}
            if running.step in _AT_WORK:  # what was measured is there
                update["state"] = known.state
            elif self._figures and not known.files:
                update |= {"figures": self._figures, "live": False}
        return known.model_copy(update=update | {"steps": (*self._steps(known, running), *copy)})

    def _steps(self, known: Measurement, running: MeasuringQueue | None) -> tuple[StepState, ...]:
        """How far the steps of a log are that waits, or is at work."""
        analysis, before = self._in_use().analysis, {each.step: each for each in known.steps}
        wanted = (AfterStep.MEASURE, *(() if analysis is None else analysis.after_recording))
        steps = [step for step in AfterStep if step in wanted]
        now = -1
        if running is not None:
            now = steps.index(AfterStep.MEASURE if running.step is None else _AT_WORK.get(running.step, steps[0]))
        found = []
        for place, step in enumerate(steps):
            if place < now and step in before:
                found.append(before[step])
            else:
                state = MeasuringState.MEASURING if place == now else MeasuringState.WAITING
                found.append(StepState(step=step, state=state))
        return tuple(found)

    @property
    def view(self) -> MeasuringQueue:
        """What is being measured, and how many logs wait."""
        ids, running = self._waiting.ids, self._running
        if running is None:
            return MeasuringQueue(waiting=len(ids))
        return running.model_copy(update={"waiting": sum(recording != running.recording for recording in ids)})

    def _run(self) -> None:
        self._after.tidy()
        self._waiting.go_on(self._file.read())
        for log in self._folder.glob("*.mcap"):
            self.renamed(log.stem, log)
        while not self._closed.is_set():
            self._retry()
            if not self._busy():
                self._copies.look()
            if (recording := self._next(self._names)) is not None:
                self._rename(recording)
            elif (recording := self._next(self._waiting)) is not None:
                self._work(recording)
            elif (recording := self._next(self._copies.waiting)) is not None:
                self._copy(recording)
            elif not self._release():
                waiting = self._waiting.ids or self._names.ids or self._copies.waiting.ids
                self._bell.wait(_QUEUE_LOOK_S if waiting else _SOURCE_LOOK_S)
                self._bell.clear()
                continue
            self._changed()

    def _retry(self) -> None:
        """Queue the logs again that survey or poses kept from being measured, when those have changed."""
        queued = []
        with suppress(StateForbidsError):  # two thousand wait: the others are measured when somebody asks
            for recording in self._retries.due():
                self._waiting.add(recording)
                queued.append(recording)
        if not queued:
            return
        self._file.wait(_THREAD_ENDS_S)
        self._retries.queued(queued)
        text = "survey or poses have changed: {count} recordings that could not be measured by them are measured again"
        said = phrase("event_measured_again", text, count=len(queued))
        self._tell(Event.now(EventLevel.INFO, "analysis", said))
        self._changed()

    def _next(self, waiting: WaitingLogs) -> str | None:
        """The first log that is closed; those that are gone do not wait any more."""
        if self._busy():
            return None
        for recording in waiting.ids:
            log = self._log(recording)
            if not log.exists():
                self._drop(recording, waiting)
            elif not is_being_written(log):
                return recording
        return None

    def _drop(self, recording: str, waiting: WaitingLogs) -> None:
        """Let a log wait no more; one that was deleted before it was measured is remembered."""
        if waiting is self._waiting and recording in waiting and not self._log(recording).exists():
            self._gone.add(recording)
        waiting.remove(recording)

    def _work(self, recording: str) -> None:
        """Measure a log, and take the further steps; a step that was cancelled or interrupted leaves no note."""
        log, analysis = self._log(recording), self._in_use().analysis
        with self._at_work(recording, self._waiting):
            if analysis is not None:  # else another rig file, since it was queued
                self._after.measure(recording, log, analysis)
                self._retries.look_again()
            if not self._closed.is_set():
                self._copies.want(recording)
                self._drop(recording, self._waiting)

    def _rename(self, recording: str) -> None:
        """Write what a result says of the session anew; a result of an older svev is measured again for that."""
        log, analysis = self._log(recording), self._in_use().analysis
        if not (measured_path(log) / CAMERAS).exists():
            self._names.remove(recording)
            if analysis is not None:
                self._waiting.add(recording)
            return
        with self._at_work(recording, self._names):
            done = self._after.rename(recording, log)
            self._names.remove(recording)
        if done:  # perhaps corrected once more meanwhile
            self.renamed(recording, log)
            self._copies.want(recording)

    def _release(self) -> bool:
        """Release a recording that is safe on the other disk, if there is one to be released."""
        log = None if self._busy() else self._releasing.next()
        if log is not None:
            self._releasing.release(log, self._busy, self._is_idle)
        return log is not None

    def _copy(self, recording: str) -> None:
        log, offload = self._log(recording), self._in_use().offload
        with self._at_work(recording, self._copies.waiting):
            if offload is not None:  # else another rig file, since it was queued
                self._after.copy(recording, log, offload.to)
            if self._wanted(recording):
                self._copies.waiting.remove(recording)

    @contextmanager
    def _at_work(self, recording: str, waiting: WaitingLogs) -> Iterator[None]:
        with self._lock:
            self._running, self._at = MeasuringQueue(recording=recording, state=MeasuringState.MEASURING), waiting
            self._figures = ()
        self._changed()
        try:
            yield
        finally:
            with self._lock:
                self._running = None

    def _wanted(self, recording: str) -> bool:
        if self._at is self._copies.waiting and not self._is_idle():
            return False  # people wait for a jump: the copy goes on behind it
        return recording in self._at and not self._closed.is_set()

    def _is_idle(self) -> bool:
        """Whether nothing is to be measured, and the service goes on."""
        return self._next(self._waiting) is None and not self._closed.is_set()

    def _hold(self, held: bool) -> None:
        self._change(paused=held)

    def _know(self, jumps: tuple[LastJump, ...]) -> None:
        """Have the figures while the files are being written."""
        self._figures = jumps
        self._found(jumps)
        self._changed()

    def _hear(self, news: Progress) -> None:
        """Enter the progress of the program, in visible steps only, since every page hears of each."""
        known = self.view
        if news.step is not known.step or news.share >= known.share + _SEEN_SHARE:
            self._change(step=news.step, share=news.share)

    def _change(self, **what: Any) -> None:
        with self._lock:
            if self._running is not None:
                self._running = self._running.model_copy(update=what)
        self._changed()

    def _log(self, recording: str) -> Path:
        return self._folder / f"{recording}.mcap"
