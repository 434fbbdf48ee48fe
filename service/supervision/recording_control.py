"""Starts, follows and ends recordings, from the recorder's reports. Runs in the supervisor's thread."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from pathlib import Path

import msgspec

from rig.api.recordings import Recording, RecordingOrder, SessionChange, SessionFields, StopOrder
from rig.api.statement import Statement
from rig.api.status import State
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import (
    BadInputError,
    NameTakenError,
    ProcessDiedError,
    StateForbidsError,
    StorageError,
    SvevError,
    UnknownRecordingError,
)
from rig.events import Event, Level
from rig.phrase import NOTHING, Phrase, phrase
from rig.settings.model import RigSettings
from rig.transport.recorder_commands import Calibration, StartRecording, StopRecording
from rig.transport.recorder_reports import (
    RecorderFailed,
    RecorderHealth,
    RecorderReport,
    RecordingContinued,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
)
from service.jumpers.book import JumperBook
from service.processes.rig_processes import RigProcesses
from service.processes.rig_session import RigSession
from service.recordings.in_progress import Outcome, RecordingInProgress
from service.recordings.interruption import (
    DEATHS_MAX,
    DEATHS_WITHIN_S,
    Interruption,
    died_too_often,
    going_on,
)
from service.recordings.storage import check_room_for, free_path, new_log_path
from service.recordings.truth import TruthWriter
from service.status.forbidden import FORBIDDEN
from service.status.statements import (
    recording_continued,
    recording_ended,
    recording_forgotten,
    recording_resumed,
)
from service.supervision.state_machine import StateMachine
from service.supervision.tap_guard import CONFIRM_S, check_seen, check_stop


class RecordingControl:
    """Owner of the recording in progress, of which there is at most one.

    Args:
        machine: the state machine; this object moves it between armed and recording.
        session: the rig, its processes, and whom to tell events.
        jumpers: says whom the next recording is of.
        rig_toml: the rig file's text, attached to every log.
        calibration: calibration of the cameras, written into every log; None: not known.
        truths: writes the truth beside the logs of simulated cameras.

    Attributes:
        current: the recording in progress, or one whose log is being opened.
        last: id of the recording that ended last.
        notice: why the last recording ended early, until another one starts.
        armed_at: when the rig was armed, on the monotonic clock, s.
        on_log: called with each log that the recorder has made; set it before the first recording.
        emptied_at: since when memory can hold anything for the next recording, likewise: the last one took the rest.
    """

    def __init__(
        self,
        machine: StateMachine,
        session: RigSession,
        jumpers: JumperBook,
        rig_toml: str,
        calibration: Calibration | None,
        truths: TruthWriter,
    ) -> None:
        self._machine, self._session, self._truths, self._jumpers = machine, session, truths, jumpers
        self._rig, self._data = session.rig, session.recorder.directory
        self._rig_toml, self._calibration = rig_toml, calibration
        self.current: RecordingInProgress | None = None
        self.last: str | None = None
        self.notice: Statement | None = None
        self.armed_at = self.emptied_at = time.monotonic()
        self.on_log: Callable[[Path], None] = lambda _: None
        self._answers: list[Callable[[], None]] = []

    def use(self, rig: RigSettings, rig_toml: str) -> None:
        """Take other settings and attach another text of the rig file to the logs from now on."""
        self._rig, self._rig_toml = rig, rig_toml

    def begin_armed(self) -> None:
        """Note that the rig is armed from now on: memory begins to hold the past."""
        self.armed_at = self.emptied_at = time.monotonic()

    def calibrate(self, calibration: Calibration | None) -> None:
        """Write another calibration into the logs from now on."""
        self._calibration = calibration

    @property
    def opening(self) -> bool:
        """Whether a log is being opened: the recording is ordered, and the state is not yet that of recording."""
        return self.current is not None and self.current.opening

    def answer(self) -> None:
        """Answer the waiting threads; called after the status is renewed, so that they see the new state."""
        answers, self._answers = self._answers, []
        for answer in answers:
            answer()

    def runs(self) -> bool:
        """Whether a recording runs or is being opened; any thread may ask."""
        return self.current is not None

    def start(self, order: RecordingOrder, opened: "Future[Recording]") -> None:
        """Have the recorder open a log for the jumper whom the order names, or for the next one.

        Raises:
            StateForbidsError: not armed, or a recording is being opened, or the order may be a second tap.
            StorageError: no room, or the folder cannot be written.
        """
        check_seen(self._machine.phase, order.seen, opening=self.current is not None)
        self._armed_processes()
        length_s = self._rig.recorder.jump_s if order.duration_s is None else order.duration_s
        check_room_for(self._rig, self._data, length_s)
        path, longest_s = self._new_path(), self._rig.recorder.longest_s
        session, more = self._jumpers.take(path.stem, order)
        now = host_now()
        start = StartRecording(
            path=path,
            session={name: text for name, text in (more | session.model_dump()).items() if text},
            seconds=longest_s if order.duration_s is None else order.duration_s,
            nobody_stops=order.duration_s is None,
            commanded=now,
            preroll_s=self._reach_s(order, now),
            keep_s=CONFIRM_S,
        )
        self.begin(start, session, opened)

    def begin(
        self,
        start: StartRecording,
        session: SessionFields,
        opened: "Future[Recording]",
        ended: "Future[Outcome] | None" = None,
    ) -> None:
        """Have the recorder open a log.

        Args:
            start: what the recorder is told; rig file and calibration, the same for all recordings, are added to it.
            session: the session fields as people see them.
            opened: is answered when the log is open.
            ended: is answered when the recording is over, however that comes about.

        Raises:
            StateForbidsError: not armed, or a recording is being opened.
        """
        processes = self._armed_processes()
        order = msgspec.structs.replace(start, rig_toml=self._rig_toml, calibration=self._fitting())
        self.current, self.notice = RecordingInProgress(order, session, opened), None
        if ended is not None:
            self.current.waiting.append(ended)
        processes.tell(order)

    def _fitting(self) -> Calibration | None:
        """The calibration without cameras that were calibrated with another region."""
        if (known := self._calibration) is None:
            return None
        unfit = {camera.name for camera in self._rig.cameras if camera.calibrated_region is not None}
        cameras = {name: data for name, data in known.cameras.items() if name not in unfit}
        return msgspec.structs.replace(known, cameras=cameras)

    def _armed_processes(self) -> RigProcesses:
        state, processes = self._machine.state, self._session.processes
        if processes is None or state is not State.ARMED or self.current is not None:
            raise StateForbidsError(FORBIDDEN["start", State.RECORDING if state is State.ARMED else state])
        return processes

    def _new_path(self) -> Path:
        try:
            return new_log_path(self._data)
        except BadInputError:
            text = "{folder}: cannot be written; correct its permissions, or start the service with another --data"
            raise StorageError(phrase("why_folder_read_only", text, folder=str(self._data))) from None

    def _reach_s(self, order: RecordingOrder, now: HostNs) -> float:
        """How far a recording begins in the past: not before the rig was armed, when cameras were missing."""
        armed_s = now / NS_PER_S - self.armed_at
        return armed_s if order.preroll_s is None else min(order.preroll_s, armed_s)

    def stop(
        self,
        recording: str | None = None,
        ended: "Future[Outcome] | None" = None,
        *,
        order: StopOrder | None = None,
        at_once: bool = False,
    ) -> None:
        """Have the recorder close the log.

        Args:
            recording: id of the recording; None: the one in progress.
            ended: is answered when the recording is over.
            order: who wants it, and how surely; None: the service itself.
            at_once: do not wait for the disk.

        Raises:
            UnknownRecordingError: this recording is not in progress.
            StateForbidsError: the order may be a second tap.
        """
        current = self.current
        if current is None or recording not in {None, *current.ids}:
            raise UnknownRecordingError(f"recording {recording} is not in progress: see the list of recordings")
        if order is not None and not current.stopping:
            check_stop(self._machine.phase, order)
        if ended is not None:
            current.waiting.append(ended)
        if current.interruption is not None and not current.interruption.resumed:
            self.fail(current.interruption.error, self._machine.state)
        elif self._session.processes is not None and (at_once or not current.stopping):
            current.stopping = True
            fresh = self._machine.phase.age_s < CONFIRM_S and not current.deaths
            current.mishap = order is not None and order.confirm and fresh
            if current.mishap:
                self._jumpers.give_back(current.ids[0])
            self._session.processes.tell(StopRecording(at_once=at_once, keep=current.mishap))

    def change_session(self, recording: str, change: SessionChange) -> Recording | None:
        """Change session fields of the recording in progress.

        Returns:
            The recording; None if `recording` is not in progress.
        """
        if self.current is None or recording not in self.current.ids:
            return None
        self.current.change_session(change)
        return self.current.view()

    def _opened(self, log: Path) -> None:
        self._truths.opened(log, self._session.truth)
        self.on_log(log)

    def hear(self, report: RecorderReport) -> None:
        """Handle a report of the recorder."""
        current = self.current
        if current is None:
            return
        match report:
            case RecordingStarted() if current.interruption is not None:
                self._opened(current.order.path)
                current.continue_in(current.order.path)
                self.armed_at = time.monotonic()
                self._machine.move(State.RECORDING)
            case RecordingStarted():
                self._answers.append(current.open(report))
                self._opened(current.path)
                self._machine.move(State.RECORDING)
                self._say(Level.INFO, phrase("event_started", "recording {recording} started", recording=current.id))
            case RecorderHealth() if not current.opening:
                with suppress(FileNotFoundError):  # somebody has moved the log away
                    current.grown(current.path.stat().st_size)
            case RecordingContinued():
                current.continue_in(report.path)
                self._opened(report.path)
                why = report.before.failure or NOTHING
                self.notice = recording_continued(report.before.path.stem, report.path, why)
            case RecordingFinished():
                self._finished(current, report)
            case RecordingProgress():
                current.progress(report)
                self._tell_gap(current, report)
            case RecorderFailed() if current.opening and isinstance(report.error(), NameTakenError):
                self._order_again(current)
            case RecorderFailed():
                self.fail(report.error(), State.ARMED if current.interruption is None else self._machine.state)

    def _order_again(self, current: RecordingInProgress) -> None:
        """Order a recording under the next number: another program has made a log of its name meanwhile."""
        before, processes = current.id, self._session.processes
        if processes is None:
            return
        current.rename(free_path(current.wanted))
        self._jumpers.rename(before, current.id)
        processes.tell(current.order)

    def _finished(self, current: RecordingInProgress, report: RecordingFinished) -> None:
        current.progress(report)
        self._tell_gap(current, report)
        total = current.counts
        text = "recording {recording} stopped: {pulses} pulses, {complete} complete, {partial} partial"
        said = phrase(
            "event_stopped", text,
            recording=current.id, pulses=total.pulses, complete=total.complete, partial=total.partial,
        )  # fmt: skip
        self._say(Level.INFO, said)
        if report.failure is not None:
            self.notice = recording_ended(current.id, report.failure.error())
            self._say(Level.ERROR, self.notice.said)
        elif current.longest_s is not None and not current.stopping:
            self.notice = recording_forgotten(current.id, current.longest_s)
            self._say(Level.WARNING, self.notice.said)
        self._over(report, State.ARMED)

    def interrupt(self, error: SvevError) -> SvevError | None:
        """Begin to continue the recording in progress, because its recorder died.

        Returns:
            None: it goes on as soon as there is a new recorder (`go_on`). Otherwise the error that ends it.
        """
        current = self.current
        if current is None or current.opening or current.stopping:
            return error
        current.deaths.append(time.monotonic())
        if died_too_often(current.deaths):
            text = (
                "the recorder ended {times} times within {seconds:g} s, so the recording is not continued again; {why}"
            )
            said = phrase("why_died_often", text, times=DEATHS_MAX, seconds=DEATHS_WITHIN_S, why=error.said)
            return ProcessDiedError(said)
        current.interruption = Interruption(current.path, error)
        return None

    @property
    def may_restart(self) -> bool:
        """Whether a new recorder may be started: not before it is known with which pulse a recording goes on."""
        interruption = None if self.current is None else self.current.interruption
        return interruption is None or interruption.over

    def go_on(self) -> None:
        """Have a new recorder continue the recording that the death of the last one interrupted, if there is one."""
        current, processes = self.current, self._session.processes
        if current is None or current.interruption is None or processes is None:
            return
        found, seconds = current.interruption.found(), current.order.seconds
        late = seconds is not None and host_now() > current.commanded + round(seconds * NS_PER_S)
        if found is None or late:
            self.fail(current.interruption.error, self._machine.state)
            return
        period_ns = self._rig.trigger.period_ns
        order = going_on(current.order, current.session, found, current.ids[0], current.commanded, period_ns)
        current.go_on(order, found.ledger.counts())
        current.interruption.resumed = True
        processes.tell(order)

    def _tell_gap(self, current: RecordingInProgress, report: RecordingProgress) -> None:
        """Say what is missing where the recording went on, once its first pulse is there."""
        before = current.order.goes_on
        if current.interruption is None or before is None or report.first_pulse is None:
            return
        gap = next((pause for pause in report.pauses if pause.after_pulse == before.pulse), None)
        self.notice = recording_resumed(before.recording, current.id, gap)
        self._say(Level.WARNING, self.notice.said)
        current.interruption = None

    def fail(self, error: SvevError, then: State) -> None:
        """End the recording in progress, if there is one, with an error, and go to the state `then`."""
        current = self.current
        if current is None:
            return
        if current.opening:
            self._jumpers.give_back(current.id)
            current.refuse(error)
            self.current = None
            return
        self.notice = recording_ended(current.id, error)
        self._say(Level.ERROR, self.notice.said)
        self._over(error, then)

    def abandon(self) -> None:
        """Answer all waiting threads, because the service ends before the recorder's last report."""
        self.answer()
        current, self.current = self.current, None
        if current is not None:
            text = "the service ends: look at the list of recordings when it runs again"
            error = ProcessDiedError(phrase("why_service_ends", text))
            current.refuse(error)
            current.end(error)

    def _over(self, outcome: Outcome, then: State) -> None:
        current, self.current = self.current, None
        parts = outcome.earlier if isinstance(outcome, RecordingFinished) else ()
        self._truths.closed([part.path for part in parts if not part.closed])
        if current is not None:
            self.last = current.id
            self.emptied_at = self.armed_at if current.mishap else time.monotonic()
            if then is not self._machine.state:
                self._machine.move(then)
            self._answers.append(partial(current.end, outcome))

    def _say(self, level: Level, said: Phrase) -> None:
        self._session.tell(Event.now(level, "service", said))
