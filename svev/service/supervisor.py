"""The one thread that owns the rig: obeys commands, keeps the processes going, moves the state machine.

It reconciles what is wanted (armed or not) with what is there, a little at every turn, and never waits for anything
but the next report or command.
"""

import select
import shutil
import threading
import time
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import Any, Final

from recorder.events import Event, Level
from rig.control import Message
from rig.errors import ProcessDiedError, SvevError
from rig.settings import RigSettings
from svev.back_off import BackOff
from svev.rig_processes import RECORDER, RigProcesses
from svev.running_rig import reported_error
from svev.service.commands import Commands
from svev.service.event_hub import EventHub
from svev.service.picture import Facts, picture
from svev.service.pulse_rate import PulseRate
from svev.service.recording_control import RecordingControl
from svev.service.rig_session import RigSession
from svev.service.room import room_for
from svev.service.state_machine import StateMachine
from svev.service.statements import FORBIDDEN, failed, no_camera
from webpanel.models import State, Statement, Status
from webpanel.rig_service import StateForbidsError

_TURN_S: Final = 0.2
_PICTURE_S: Final = 1.0
#: A camera that has not said anything for so long while arming is taken for absent.
_ANSWER_S: Final = 20.0
#: With pulses running, the first whole triplets are awaited: a recording then begins complete.
_WARM_S: Final = 2.0
#: A recorder that has not reported for so long is stuck. Closing a log on a slow disk may take a while.
_STUCK_S: Final = 30.0
_FINISH_S: Final = 4.0


class Supervisor:
    """Runs the loop in a thread of its own.

    Args:
        rig: the rig.
        rig_toml: the rig file's text.
        data: where recordings go.
        hub: is told what happens.
        preroll_s: what is to be held in memory while armed, s.
        recorder: more configuration for the recorder.
        inherit: descriptors that the recorder inherits for it.

    Attributes:
        on_turn: called at every turn, e.g. to feed a watchdog; set it before the start.
        commands: how other threads ask for something.
        recordings: of the supervisor's thread.
    """

    def __init__(
        self,
        rig: RigSettings,
        rig_toml: str,
        data: Path,
        hub: EventHub,
        *,
        preroll_s: float = 0.0,
        recorder: Mapping[str, Any] | None = None,
        inherit: tuple[int, ...] = (),
    ) -> None:
        self._rig, self._data, self._hub, self._preroll_s = rig, data, hub, preroll_s
        self.on_turn: Callable[[], None] = lambda: None
        self.commands = Commands()
        self._machine = StateMachine(self._moved)
        self._session = RigSession(rig, hub.tell, self.commands.ring, recorder=recorder or {}, inherit=inherit)
        self.recordings = RecordingControl(rig, rig_toml, data, self._machine, hub.tell)
        self._back_off = BackOff()
        self._wanted = False
        self._retry_at = self._began = 0.0
        self._tried_at: float | None = None
        self._fault: Statement | None = None
        self._complaint: SvevError | None = None
        self._pulses = PulseRate()
        self._ending_by: float | None = None
        self._dirty, self._pictured = True, 0.0
        self.turned = self.reported = time.monotonic()
        self._health: Message = {}
        self._status = self._picture()
        self._thread = threading.Thread(target=self._run, name="supervisor")

    # -- from any thread ---------------------------------------------------------------------------------------------

    @property
    def status(self) -> Status:
        """The latest picture."""
        return self._status

    def start(self) -> None:
        """Begin to turn."""
        self._thread.start()

    def begin_stop(self) -> None:
        """End: a recording is finished, everything stopped. May be called from a signal handler, and again."""
        if self._ending_by is None:
            self._ending_by = time.monotonic() + _FINISH_S
        self.commands.ring()

    def join(self, timeout_s: float) -> bool:
        """Wait for the end.

        Returns:
            False if it has not come.
        """
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def close(self) -> None:
        """After the end: give back what is left."""
        self.commands.close()

    @property
    def health(self) -> Message:
        """The recorder's last report of that name, empty if there is none."""
        return self._health

    @property
    def answering(self) -> bool:
        """Whether the loop turns, and the recorder, if there ought to be one, reports."""
        now = time.monotonic()
        reports = self._session.processes is None or now < self.reported + _STUCK_S / 2
        return self._thread.is_alive() and now < self.turned + 2.0 and reports

    # -- commands, carried out by the supervisor's thread --------------------------------------------------------------

    def arm(self, answer: "Future[Status]") -> None:
        """Begin to arm; from a fault, try anew at once."""
        state = self._machine.state
        if state is State.DISARMING:
            raise StateForbidsError(FORBIDDEN["arm", state])
        if state in {State.IDLE, State.FAULT}:
            self._wanted, self._retry_at, self._fault = True, 0.0, None
            self._back_off.forget()
            self._machine.move(State.ARMING)
            if self._session.processes is not None:
                self._session.begin_take_down(keep_hill=True)
            self._reconcile()
        answer.set_result(self._refresh())

    def disarm(self, answer: "Future[Status]") -> None:
        """Begin to disarm."""
        if self._machine.state is State.RECORDING or self.recordings.current is not None:
            raise StateForbidsError(FORBIDDEN["disarm", State.RECORDING])
        self._wanted = False
        self._reconcile()
        answer.set_result(self._refresh())

    @property
    def processes(self) -> RigProcesses | None:
        """The running processes, if any."""
        return self._session.processes

    # -- the loop ------------------------------------------------------------------------------------------------------

    def _run(self) -> None:
        while self._ending_by is None or not self._ended(self._ending_by):
            self._turn()
        self._session.close()
        self._refresh()

    def _turn(self) -> None:
        self.commands.carry_out()
        self._reconcile()
        try:
            self._listen()
        except ProcessDiedError as error:
            self._rig_failed(self._complaint or error)
        self._judge()
        self.turned = time.monotonic()
        if self._dirty or self.turned >= self._pictured + _PICTURE_S:
            self._refresh()
        self.on_turn()

    def _ended(self, finish_by: float) -> bool:
        """While ending: whether no recording is left; it is told to stop, but not waited for for ever."""
        self._wanted = False
        current = self.recordings.current
        if current is None or time.monotonic() > finish_by:
            return True
        if not current.stopping and not current.opening:
            self.recordings.stop(self._session.processes, None, Future())
        return False

    def _reconcile(self) -> None:
        """Bring what is there nearer to what is wanted."""
        try:
            self._session.collect()
        except SvevError as error:
            self._rig_failed(error)
        state, now = self._machine.state, time.monotonic()
        if not self._wanted and state is not State.IDLE and self.recordings.current is None:
            if state is not State.DISARMING:
                self._fault = None
                self._machine.move(State.DISARMING)
            if self._session.empty:
                self._machine.move(State.IDLE)
            elif not self._session.busy:
                self._session.begin_take_down(keep_hill=False)
        elif self._wanted and not self._session.busy and self._session.processes is None and now >= self._retry_at:
            if state is not State.ARMING:
                self._machine.move(State.ARMING)
            self._began, self._tried_at, self._fault, self._complaint = now, None, None, None
            self._session.begin_set_up()

    def _listen(self) -> None:
        """Wait for the next reports or command."""
        processes = self._session.processes
        if processes is None:
            self._pulses.forget()
            self.reported = time.monotonic()
            select.select([self.commands.bell], [], [], _TURN_S)
            return
        for message in processes.turn(_TURN_S, (self.commands.bell,)):
            self._hear(message)
        if time.monotonic() > max(self.reported, processes.started) + _STUCK_S:
            self._hub.tell(Event.now(Level.FATAL, RECORDER, f"no sign of life for {_STUCK_S:g} s: it is ended"))
            self.reported = time.monotonic()
            processes.kill_recorder()

    def _hear(self, message: Message) -> None:
        self.reported, self._dirty = time.monotonic(), True
        if message["report"] == "health":
            self._pulses.count(message["pairing"]["pulses"], self.reported)
        elif message["report"] == "failed" and self.recordings.current is None:
            self._complaint = reported_error(message)
        self.recordings.hear(message)

    def _judge(self) -> None:
        """Armed or not, by which cameras are there."""
        processes, state = self._session.processes, self._machine.state
        if processes is None or not self._wanted or self.recordings.current is not None:
            return
        present = any(camera.present for camera in processes.cameras)
        match state:
            case State.ARMING if self._settled(processes):
                self._machine.move(State.ARMED) if present else self._lack_cameras()
            case State.ARMED if not present:
                self._lack_cameras()
            case State.FAULT if present:
                self._fault = None
                self._machine.move(State.ARMED)

    def _settled(self, processes: RigProcesses) -> bool:
        """Whether every camera has answered or failed, and those that are there had time for their first frames."""
        now = time.monotonic()
        tried = all(camera.tried for camera in processes.cameras) or now > self._began + _ANSWER_S
        if not processes.ready or not tried:
            return False
        if self._tried_at is None:
            self._tried_at = now
        lacking = not any(camera.present for camera in processes.cameras)
        return lacking or processes.warm or now > self._tried_at + _WARM_S

    def _lack_cameras(self) -> None:
        self._fault = no_camera()
        self._machine.move(State.FAULT)

    def _rig_failed(self, error: SvevError) -> None:
        """Setting up failed, or the recorder died: all processes go, and come again after a while."""
        now = time.monotonic()
        wait_s = self._back_off.died(now - self._began)
        self._retry_at = now + wait_s
        self._fault = failed(error, wait_s) if self._wanted else None
        self.recordings.fail(error, State.FAULT)
        if self._wanted:
            if self._machine.state is not State.FAULT:
                self._machine.move(State.FAULT)
            self._hub.tell(Event.now(Level.FATAL, RECORDER, f"{error}; starting again in {wait_s:g} s"))
        if self._session.processes is not None:
            self._session.begin_take_down(keep_hill=True)

    # -- the picture ---------------------------------------------------------------------------------------------------

    def _moved(self, before: State, to: State) -> None:
        self._dirty = True
        level = Level.ERROR if to is State.FAULT else Level.INFO
        why = f": {self._fault.text}" if to is State.FAULT and self._fault is not None else ""
        self._hub.tell(Event.now(level, "service", f"{before} -> {to}{why}"))

    def _refresh(self) -> Status:
        self._dirty, self._pictured = False, time.monotonic()
        self._status = self._picture()
        self._hub.wake()
        return self._status

    def _picture(self) -> Status:
        processes, phase, current = self._session.processes, self._machine.phase, self.recordings.current
        fault = self._fault if phase.state is State.FAULT else None
        self._health = {} if processes is None else processes.health
        facts = Facts(
            phase=phase,
            notice=fault or (self.recordings.notice if phase.state is State.ARMED else None),
            heard=None if processes is None else tuple(processes.cameras),
            health=self._health,
            warm=processes is not None and processes.warm,
            pulses=self._pulses,
            room=room_for(self._rig, shutil.disk_usage(self._data).free),
            preroll_s=self._preroll_s,
            recording=current.view() if current is not None and not current.opening else None,
            last_recording=self.recordings.last,
            pids={} if processes is None else processes.pids,
            restarts={RECORDER: self._back_off.deaths, **(processes.restarts if processes else {})},
        )
        return picture(self._rig, facts)
