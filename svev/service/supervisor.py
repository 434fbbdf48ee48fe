"""The one thread that owns the rig: obeys commands, keeps the processes going, moves the state machine.

It reconciles what is wanted (armed or not) with what is there, a little at every turn, and never waits for anything
but the next report or command.
"""

import select
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
from svev.rig_processes import RECORDER
from svev.room import free_bytes, room_for
from svev.running_rig import reported_error
from svev.service.commands import Commands
from svev.service.event_hub import EventHub
from svev.service.fault import Fault
from svev.service.picture import Facts, picture
from svev.service.recorder_watch import STUCK_S, RecorderWatch
from svev.service.recording_control import RecordingControl
from svev.service.rig_session import RigSession
from svev.service.settling import Settling
from svev.service.state_machine import StateMachine
from svev.service.statements import FORBIDDEN
from webpanel.models import State, Status
from webpanel.rig_service import StateForbidsError

_TURN_S: Final = 0.2
_PICTURE_S: Final = 1.0
_FINISH_S: Final = 4.0
#: A loop that has not come round for so long hangs.
_TURNS_S: Final = 5.0


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
        on_end: called at the end, whatever brought it about; set it before the start.
        health: the recorder's last report of that name, empty if there is none.
        failure: what brought about an end that nobody wanted.
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
        self.on_end: Callable[[], None] = lambda: None
        self.failure: Exception | None = None
        self.commands = Commands()
        self._machine = StateMachine(self._moved)
        self._session = RigSession(rig, hub.tell, self.commands.ring, recorder=recorder or {}, inherit=inherit)
        self.recordings = RecordingControl(rig, rig_toml, data, self._machine, self._session)
        self._fault = Fault()
        self._wanted = False
        self._settling, self._watch = Settling(), RecorderWatch()
        self._ending_by: float | None = None
        self._dirty, self._pictured = True, 0.0
        self._turned = time.monotonic()
        self.health: Message = {}
        self._status = self._picture()
        self._thread = threading.Thread(target=self._run, name="supervisor")

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
    def answering(self) -> bool:
        """Whether the loop turns, and the recorder, if there ought to be one, reports."""
        turns = self._thread.is_alive() and time.monotonic() < self._turned + _TURNS_S
        return turns and not self._watch.late

    def arm(self, answer: "Future[Status]") -> None:
        """Begin to arm; from a fault, try anew at once."""
        state = self._machine.state
        if state is State.DISARMING:
            raise StateForbidsError(FORBIDDEN["arm", state])
        if state in {State.IDLE, State.FAULT}:
            self._wanted = True
            self._fault.hurry()
            self._machine.move(State.ARMING)
            if self._session.processes is not None and not self._session.processes.recorder_died:
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

    def _run(self) -> None:
        try:
            while self._ending_by is None or not self._ended(self._ending_by):
                self._turn()
        except Exception as error:
            self._hub.tell(Event.now(Level.FATAL, "service", f"the supervisor failed: {type(error).__name__}: {error}"))
            self.failure = error
            raise
        finally:
            self._session.close()
            self.recordings.abandon()
            self._refresh()
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
        if self._dirty or self._turned >= self._pictured + _PICTURE_S:
            self._refresh()
        self.recordings.answer()
        self.on_turn()

    def _ended(self, finish_by: float) -> bool:
        """While ending: whether no recording is left; it is told to stop, but not waited for for ever."""
        self._wanted = False
        current = self.recordings.current
        if current is None or time.monotonic() > finish_by:
            return True
        if not current.stopping and not current.opening:
            self.recordings.stop(None, Future())
        return False

    def _reconcile(self) -> None:
        """Bring what is there nearer to what is wanted."""
        try:
            self._session.collect()
        except SvevError as error:
            self._rig_failed(error)
        state = self._machine.state
        if not self._wanted and state is not State.IDLE and self.recordings.current is None:
            if state is not State.DISARMING:
                self._fault.clear()
                self._machine.move(State.DISARMING)
            if self._session.empty:
                self._machine.move(State.IDLE)
            elif not self._session.busy:
                self._session.begin_take_down(keep_hill=False)
        elif self._wanted and not self._session.busy and self._fault.may_try:
            processes = self._session.processes
            if processes is None or processes.recorder_died:
                self._begin_arming()
                if processes is None:
                    self._session.begin_set_up()
                else:
                    processes.restart_recorder()

    def _begin_arming(self) -> None:
        if self._machine.state is not State.ARMING:
            self._machine.move(State.ARMING)
        self._settling.begin(time.monotonic())
        self._fault.clear()

    def _listen(self) -> None:
        """Wait for the next reports or command."""
        processes = self._session.processes
        if processes is None or processes.recorder_died:
            self._watch.expect_nothing()
        if processes is None:
            select.select([self.commands.bell], [], [], _TURN_S)
            return
        for message in processes.turn(_TURN_S, (self.commands.bell,)):
            self._hear(message)
        if not processes.recorder_died and self._watch.stuck(processes):
            self._session.tell(Event.now(Level.FATAL, RECORDER, f"no sign of life for {STUCK_S:g} s: it is ended"))
            processes.kill_recorder()

    def _hear(self, message: Message) -> None:
        self._dirty = True
        self._watch.hear(message)
        if message["report"] == "failed" and self.recordings.current is None:
            self._fault.complain(reported_error(message))
        self.recordings.hear(message)

    def _judge(self) -> None:
        """Armed or not, by which cameras are there."""
        processes, state = self._session.processes, self._machine.state
        if processes is None or not self._wanted or self.recordings.current is not None:
            return
        present = any(camera.present for camera in processes.cameras)
        match state:
            case State.ARMING if self._settling.settled(processes):
                self.recordings.armed_at = time.monotonic()
                self._machine.move(State.ARMED) if present else self._lack_cameras()
            case State.ARMED if not present:
                self._lack_cameras()
            case State.FAULT if present:
                self._fault.clear()
                self._machine.move(State.ARMED)

    def _lack_cameras(self) -> None:
        self._fault.lack_cameras()
        self._machine.move(State.FAULT)

    def _rig_failed(self, error: SvevError) -> None:
        """Setting up failed, or the recorder died: tried again after a while, if it is still wanted."""
        text = self._fault.fail(error, time.monotonic() - self._settling.began)
        self.recordings.fail(error, State.FAULT)
        if not self._wanted:
            return
        if self._machine.state is not State.FAULT:
            self._machine.move(State.FAULT)
        self._session.tell(Event.now(Level.FATAL, RECORDER, text))

    def _moved(self, before: State, to: State) -> None:
        self._dirty = True
        level = Level.ERROR if to is State.FAULT else Level.INFO
        why = f": {self._fault.statement.text}" if to is State.FAULT and self._fault.statement else ""
        self._session.tell(Event.now(level, "service", f"{before} -> {to}{why}"))

    def _refresh(self) -> Status:
        self._dirty, self._pictured = False, time.monotonic()
        self._status = self._picture()
        self._hub.wake()
        return self._status

    def _picture(self) -> Status:
        processes, phase, current = self._session.processes, self._machine.phase, self.recordings.current
        fault = self._fault.statement if phase.state is State.FAULT else None
        self.health = {} if processes is None else processes.health
        # The recorder asks the disk in its own time; asking here as well might wait for a disk that hangs.
        free = self.health["disk"]["free_bytes"] or 0 if self.health else free_bytes(self._data)
        facts = Facts(
            phase=phase,
            notice=fault or (self.recordings.notice if phase.state is State.ARMED else None),
            heard=None if processes is None else tuple(processes.cameras),
            health=self.health,
            warm=processes is not None and processes.warm,
            pulses=self._watch.pulses,
            room=room_for(self._rig, free),
            preroll_s=self._preroll_s,
            recording=current.view() if current is not None and not current.opening else None,
            last_recording=self.recordings.last,
            pids={} if processes is None else processes.pids,
            restarts={RECORDER: self._fault.deaths, **(processes.restarts if processes else {})},
        )
        return picture(self._rig, facts)
