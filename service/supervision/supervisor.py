"""The thread that owns the rig: obeys commands, keeps the processes running, moves the state machine.

At every turn it compares what is wanted (armed or not) with what is there, and takes one step to make them equal. It
never waits for anything but the next report or command.
"""

import select
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from rig.api.statement import Statement
from rig.api.status import State, Status
from rig.errors import ProcessDiedError, StateForbidsError, SvevError
from rig.events import Event, Level
from rig.health import Health
from rig.phrase import phrase
from rig.settings.model import RigSettings
from rig.settings.region import RegionLimits
from rig.transport.analysis_messages import JumpMeasured, Measuring
from rig.transport.recorder_commands import RecorderOptions
from rig.transport.recorder_reports import CameraLimits, RecorderFailed, RecorderHealth, RecorderReport
from service.jumpers.book import JumperBook
from service.processes.rig_processes import RECORDER
from service.processes.rig_session import RigSession, StartHill
from service.recordings.calibration import read_calibration
from service.recordings.truth import TruthWriter
from service.status.event_hub import EventHub
from service.status.forbidden import FORBIDDEN
from service.status.statements import moved
from service.supervision.commands import Commands
from service.supervision.fault import Fault
from service.supervision.picture import WarmUp
from service.supervision.recording_control import RecordingControl
from service.supervision.settings_control import RigInUse, SettingsControl
from service.supervision.state_machine import (
    Goal,
    Processes,
    Situation,
    StateMachine,
    Step,
    next_steps,
    state_by_cameras,
)
from service.supervision.status_board import StatusBoard
from service.supervision.train_control import TrainControl
from service.supervision.watching import STUCK_S, RecorderWatch, Settling, why_not_armed

_TURN_S: Final = 0.2
_FINISH_S: Final = 4.0
#: If a turn takes longer than this, the loop hangs.
_TURNS_S: Final = 5.0


class Supervisor:
    """Runs the loop in a thread of its own.

    Args:
        rig: the rig.
        rig_toml: the rig file's text.
        hub: the live log; gets every event.
        recorder: what the recorder does beside recording.
        jumpers: says whom the next recording is of; None: nobody in particular.
        hill: starts the simulated cameras; None: as the rig file says.
        enduring: whether to try again when setting up failed or the recorder died; otherwise the thread ends then.

    Raises:
        BadInputError: the rig's calibration file is missing or wrong.

    Attributes:
        hub: as given.
        on_turn: called at every turn, e.g. to feed a watchdog; set it before `start`.
        on_end: called when the thread ends, for whatever reason; set it before `start`.
        failure: the error that ended the thread, None if there was none.
        commands: through which other threads give commands.
        changing: held by the thread that changes settings of the rig in use.
        board: the status, renewed at every turn; only for commands in the supervisor's thread.
        recordings: starts and ends recordings; only for commands in the supervisor's thread.
        train, settings: stops and starts the pulses; takes other settings. Likewise.
        limits: which regions cameras take, by name, as those that were connected have said.
        truths: writes the truth beside the logs of simulated cameras; any thread may wait for it.
    """

    def __init__(
        self,
        rig: RigSettings,
        rig_toml: str,
        hub: EventHub,
        recorder: RecorderOptions,
        *,
        jumpers: JumperBook | None = None,
        hill: StartHill | None = None,
        enduring: bool = True,
    ) -> None:
        calibration = read_calibration(rig)
        self._in_use, self.hub = RigInUse(rig, rig_toml), hub
        self._enduring = enduring
        self.on_turn: Callable[[], None] = lambda: None
        self.on_end: Callable[[], None] = lambda: None
        self.failure: Exception | None = None
        self.commands, self.changing = Commands(), threading.Lock()
        self._machine = StateMachine(self._moved)
        self._session = RigSession(rig, hub.tell, self.commands.ring, recorder=recorder, hill=hill)
        self.truths = TruthWriter(hub.tell)
        jumpers = jumpers or JumperBook()
        self.recordings = RecordingControl(self._machine, self._session, jumpers, rig_toml, calibration, self.truths)
        self._fault, self._goal = Fault(), Goal(armed=False, least_cameras=rig.least_cameras)
        self._settling, self._watch = Settling(rig), RecorderWatch(rig, self._session.tell)
        self.board = StatusBoard(hub, jumpers, self._machine, self._session, self.recordings, self._fault, self._watch)
        self.train = TrainControl(self._machine, self._session, self.recordings, self.board.renew)
        self.settings = SettingsControl(self._machine, self._session, self.recordings, self._use, self._begin_again)
        self.limits: dict[str, RegionLimits] = {}
        self._ending_by: float | None = None
        self._turned = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="supervisor")

    @property
    def rig(self) -> RigSettings:
        """The rig in use."""
        return self._in_use.rig

    @property
    def rig_toml(self) -> str:
        """The text of its file."""
        return self._in_use.toml

    @property
    def status(self) -> Status:
        """The latest status, at most a second old; any thread may ask."""
        return self.board.status

    @property
    def health(self) -> Health | None:
        """The recorder's last health record, None if there is none; any thread may ask."""
        return self.board.health

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def begin_stop(self) -> None:
        """Begin to end: finish a recording, then stop everything. May be called from a signal handler, and again."""
        if self._ending_by is None:
            self._ending_by = time.monotonic() + _FINISH_S
        self.commands.ring()

    def stop(self, timeout_s: float) -> None:
        """Finish a recording, stop all processes, wait for the end of the thread.

        Raises:
            ProcessDiedError: the thread has not ended within `timeout_s` seconds.
        """
        self.begin_stop()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise ProcessDiedError(f"the rig did not stop within {timeout_s:g} s: its processes end by themselves")
        self.commands.close()

    @property
    def answering(self) -> bool:
        """Whether the loop turns and the recorder, if there should be one, reports; any thread may ask."""
        turns = self._thread.is_alive() and time.monotonic() < self._turned + _TURNS_S
        return turns and not self._watch.late

    def arm(self, min_cameras: int | None = None) -> Status:
        """Command: begin to arm; after a fault, try again at once.

        Args:
            min_cameras: so many cameras are enough until the rig is disarmed; None: as many as before, or as the rig
                file says. A tap that comes when the rig is armed already lowers nothing.
        """
        state = self._machine.state
        if state is State.DISARMING:
            raise StateForbidsError(FORBIDDEN["arm", state])
        if min_cameras is not None and state not in {State.ARMED, State.RECORDING}:
            self._goal = replace(self._goal, least_cameras=min(min_cameras, len(self.rig.cameras)))
        if state is State.FAULT and self._why_not() is None:
            self._judge()
        elif state in {State.IDLE, State.FAULT}:
            self._goal = replace(self._goal, armed=True)
            self._fault.hurry()
            self._machine.move(State.ARMING)
            if self._session.processes is not None and not self._session.processes.recorder_died:
                self._session.begin_take_down(keep_hill=True)
            self._reconcile()
        return self.board.renew()

    def _use(self, new: RigInUse) -> None:
        self._in_use = new
        self._session.rig, self._settling = new.rig, Settling(new.rig)
        self.recordings.use(new.rig, new.toml)
        self._watch.use(new.rig)

    def _begin_again(self, keep_hill: bool) -> None:
        """End all processes; the next turn arms anew."""
        self._fault.hurry()
        if self._machine.state is not State.ARMING:
            self._machine.move(State.ARMING)
        self._session.begin_take_down(keep_hill=keep_hill)
        self.board.renew()

    def note(self, event: Event) -> None:
        """Command: tell an event, also to the log of a recording that runs or begins soon."""
        self._session.tell(event)

    def acknowledge(self, alarm: int) -> Status:
        """Command: note that somebody has seen an alarm.

        Raises:
            UnknownAlarmError: it is over.
        """
        self._watch.alarms.acknowledge(alarm)
        return self.board.renew()

    def look(self) -> WarmUp:
        """Command: say how far the rig has come since it was armed."""
        processes = self._session.processes
        cameras = None if processes is None else tuple(processes.cameras)
        refused = self._fault.statement if self._machine.state is State.FAULT else None
        return WarmUp(self._machine.state, cameras, processes is not None and processes.warm, refused)

    def disarm(self) -> Status:
        """Command: begin to disarm."""
        if self._machine.state is State.RECORDING or self.recordings.current is not None:
            raise StateForbidsError(FORBIDDEN["disarm", State.RECORDING])
        self.settings.drop(phrase("why_region_disarmed", "the rig was disarmed before it was tried"))
        self._goal = Goal(armed=False, least_cameras=self.rig.least_cameras)
        self._reconcile()
        return self.board.renew()

    def _run(self) -> None:
        try:
            while self._ending_by is None or not self._ended(self._ending_by):
                self._turn()
        except Exception as error:
            why = f"{type(error).__name__}: {error}"
            said = phrase("event_supervisor_failed", "the supervisor failed: {error}", error=why)
            self.hub.tell(Event.now(Level.FATAL, "service", said))
            self.failure = error
            raise
        finally:
            self.settings.drop(phrase("why_region_ending", "the service ends"))
            self._session.close()
            self.recordings.abandon()
            self.truths.end(_FINISH_S)
            self.board.renew()
            self.commands.end()
            self.on_end()

    def _turn(self) -> None:
        self.commands.carry_out()
        self._reconcile()
        try:
            self._listen()
        except ProcessDiedError as error:
            self._rig_failed(error)
        self._judge()
        self._turned = time.monotonic()
        self.board.renew_if_due()
        self.recordings.answer()
        self.on_turn()

    def _ended(self, finish_by: float) -> bool:
        """Whether the thread may end: stop a recording in progress first, and wait for its end until `finish_by`."""
        self._goal = replace(self._goal, armed=False)
        current = self.recordings.current
        if current is None or time.monotonic() > finish_by:
            return True
        if not current.stopping and not current.opening:
            self.recordings.stop()
        return False

    def _reconcile(self) -> None:
        """Take one step from what is there to what is wanted."""
        try:
            self._session.collect()
        except SvevError as error:
            self._rig_failed(error)
        for step in next_steps(self._situation()):
            self._take(step)

    def _situation(self) -> Situation:
        session, processes = self._session, Processes.NONE
        if session.processes is not None:
            processes = Processes.NO_RECORDER if session.processes.recorder_died else Processes.ALL
        return Situation(
            self._machine.state,
            wanted=self._goal.armed,
            recording=self.recordings.current is not None,
            processes=processes,
            busy=session.busy,
            empty=session.empty,
            may_try=self._fault.may_try and self.recordings.may_restart,
        )

    def _take(self, step: Step) -> None:
        match step:
            case Step.BEGIN_DISARMING:
                self._fault.clear()
                self._machine.move(State.DISARMING)
            case Step.REST:
                self._machine.move(State.IDLE)
            case Step.STOP_ALL:
                self._session.begin_take_down(keep_hill=False)
            case Step.BEGIN_ARMING:
                self._begin_arming()
            case Step.START_ALL:
                self._session.begin_set_up()
            case Step.START_RECORDER:
                if self._session.processes is not None:
                    self._session.processes.restart_recorder()
                self.recordings.go_on()

    def _begin_arming(self) -> None:
        if self._machine.state is not State.ARMING:
            self._machine.move(State.ARMING)
        self._settling.begin(time.monotonic(), self.settings.patience_s)
        self._fault.clear()

    def _listen(self) -> None:
        """Wait for reports or a command, and handle the reports."""
        processes = self._session.processes
        if processes is None or processes.recorder_died:
            self._watch.expect_nothing()
        if processes is None:
            self._watch.alarms.end()
            select.select([self.commands.bell], [], [], _TURN_S)
            return
        for report in processes.turn(_TURN_S, (self.commands.bell,)):
            match report:
                case JumpMeasured():
                    self.board.jump_measured(report.jump)
                case Measuring():
                    self._watch.alarms.measuring(report.refused)
                    self.board.change()
                case _:
                    self._hear(report)
            if isinstance(report, RecorderHealth):
                self._watch.look(report.health, processes.pids, still=processes.still)
        if not processes.recorder_died and self._watch.stuck(processes):
            said = phrase("event_recorder_stuck", "no sign of life for {seconds:g} s: it is ended", seconds=STUCK_S)
            self._session.tell(Event.now(Level.FATAL, RECORDER, said))
            processes.kill_recorder()

    def _hear(self, report: RecorderReport) -> None:
        self.board.change()
        self._watch.hear(report)
        if isinstance(report, CameraLimits):
            self.limits[self.rig.cameras[report.camera].name] = report.limits
        if isinstance(report, RecorderFailed) and self.recordings.current is None:
            self._fault.complain(report.error())
        self.recordings.hear(report)

    def _judge(self) -> None:
        """Move between arming, armed and fault, depending on which cameras are connected."""
        processes, state = self._session.processes, self._machine.state
        if processes is None or not self._goal.armed or self.recordings.current is not None:
            return
        fault = self._why_not()
        settled = self.settings.lacks_cameras(processes) or self._settling.settled(processes)
        present = any(camera.present for camera in processes.cameras)
        to = state_by_cameras(state, settled=settled, able=fault is None, any_present=present)
        if to is state or (state is State.ARMING and not self.settings.stands(processes, fault)):
            return
        if state is State.ARMING:
            self.recordings.begin_armed()
        if fault is not None:
            self._refuse(fault)
            return
        if state is State.FAULT:
            self._fault.clear()
        self._machine.move(State.ARMED)

    def _why_not(self) -> Statement | None:
        """Why the rig cannot be armed, in words; None: it can."""
        return why_not_armed(self.rig, self._session.processes, self._goal.least_cameras)

    def _refuse(self, fault: Statement) -> None:
        self._fault.refuse(fault)
        self._machine.move(State.FAULT)

    def _rig_failed(self, error: SvevError) -> None:
        """Handle that setting up failed or that the recorder died: try again later, or end if not `enduring`."""
        if self.settings.go_back(error.said):
            return
        final = self.recordings.interrupt(error) if self._enduring and self._goal.armed else error
        said = self._fault.fail(error, time.monotonic() - self._settling.began, hurry=final is None)
        if final is not None:
            self.recordings.fail(final, State.FAULT)
        if not self._enduring:
            self.failure, self._ending_by = self._fault.cause or error, time.monotonic()
            return
        if not self._goal.armed:
            return
        if self._machine.state is not State.FAULT:
            self._machine.move(State.FAULT)
        self._session.tell(Event.now(Level.FATAL, RECORDER, said))

    def _moved(self, before: State, to: State) -> None:
        self.board.change()
        level = Level.ERROR if to is State.FAULT else Level.INFO
        fault = self._fault.statement if to is State.FAULT else None
        self._session.tell(Event.now(level, "service", moved(before, to, fault)))
