"""Starts and ends recordings; hears what the recorder reports of them. Runs in the supervisor's thread."""

import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path

from recorder.catalogue import UnknownRecordingError
from recorder.events import Event, Level
from rig.control import Message
from rig.errors import BadInputError, ProcessDiedError, StorageError, SvevError
from rig.settings import RigSettings
from svev.recording_run import new_log_path
from svev.room import check_room_for
from svev.running_rig import reported_error
from svev.service.recording import RecordingInProgress
from svev.service.rig_session import RigSession
from svev.service.state_machine import StateMachine
from svev.service.statements import FORBIDDEN, recording_ended
from webpanel.models import Recording, RecordingOrder, SessionChange, State, Statement
from webpanel.rig_service import StateForbidsError


class RecordingControl:
    """At most one recording at a time.

    Args:
        rig: the rig.
        rig_toml: the rig file's text, attached to every log.
        data: where logs go.
        machine: moved between armed and recording.
        session: has the recorder, and is told what happens.

    Attributes:
        current: the recording in progress or being opened.
        last: id of the recording that ended last.
        notice: how the last one failed, until another is started.
        armed_at: when the rig was armed, on the monotonic clock, s.
    """

    def __init__(
        self,
        rig: RigSettings,
        rig_toml: str,
        data: Path,
        machine: StateMachine,
        session: RigSession,
    ) -> None:
        self._rig, self._rig_toml, self._data = rig, rig_toml, data
        self._machine, self._session = machine, session
        self.current: RecordingInProgress | None = None
        self.last: str | None = None
        self.notice: Statement | None = None
        self.armed_at = time.monotonic()
        self._answers: list[Callable[[], None]] = []

    def answer(self) -> None:
        """Tell those who wait; after the new state can be seen, so that who asks next finds what he was told."""
        answers, self._answers = self._answers, []
        for answer in answers:
            answer()

    def start(self, order: RecordingOrder, opened: "Future[Recording]") -> None:
        """Have the recorder open a log.

        Raises:
            StateForbidsError: not armed, or a recording is being opened.
            StorageError: no room, or the folder cannot be written.
        """
        state, processes = self._machine.state, self._session.processes
        if processes is None or state is not State.ARMED or self.current is not None:
            raise StateForbidsError(FORBIDDEN["start", State.RECORDING if state is State.ARMED else state])
        length_s = self._rig.recorder.jump_s if order.duration_s is None else order.duration_s
        check_room_for(self._rig, self._data, length_s)
        path = self._new_path()
        self.current, self.notice = RecordingInProgress(path, order, opened), None
        processes.tell(
            {
                "command": "start", "path": str(path), "recording": path.stem, "pulses": None,
                "session": {name: text for name, text in self.current.session.model_dump().items() if text},
                "seconds": order.duration_s, "preroll_s": self._reach_s(order), "rig_toml": self._rig_toml,
            }
        )  # fmt: skip

    def _new_path(self) -> Path:
        try:
            return new_log_path(self._data)
        except BadInputError:
            raise StorageError(
                f"{self._data}: cannot be written; correct its permissions, or start the service with another --data"
            ) from None

    def _reach_s(self, order: RecordingOrder) -> float:
        """How far to begin in the past: before the rig was armed, cameras were missing."""
        armed_s = time.monotonic() - self.armed_at
        return armed_s if order.preroll_s is None else min(order.preroll_s, armed_s)

    def stop(self, recording: str | None, ended: "Future[str]") -> None:
        """Have the recorder close the log; the future gets the id when that is done.

        Args:
            recording: which; None: whichever there is.
            ended: is answered when it is over.

        Raises:
            UnknownRecordingError: this one is not in progress.
        """
        current = self.current
        if current is None or recording not in {None, current.id}:
            raise UnknownRecordingError(f"recording {recording} is not in progress: see the list of recordings")
        current.waiting.append(ended)
        if self._session.processes is not None and not current.stopping:
            current.stopping = True
            self._session.processes.tell({"command": "stop"})

    def change_session(self, recording: str, change: SessionChange) -> Recording | None:
        """Change the session of the recording in progress.

        Returns:
            None if it is another one.
        """
        if self.current is None or self.current.id != recording:
            return None
        self.current.change_session(change)
        return self.current.view()

    def hear(self, message: Message) -> None:
        """A report of the recorder."""
        current = self.current
        if current is None:
            return
        match message["report"]:
            case "started":
                self._answers.append(current.open(message))
                self._machine.move(State.RECORDING)
                self._say(Level.INFO, f"recording {current.id} started")
            case "progress":
                current.progress(message)
            case "health" if not current.opening:
                with suppress(FileNotFoundError):  # somebody has moved it away
                    current.grown(current.path.stat().st_size)
            case "finished":
                current.progress(message)
                counts = f"{message['pulses']} pulses, {message['complete']} complete, {message['partial']} partial"
                self._say(Level.INFO, f"recording {current.id} stopped: {counts}")
                self._over(State.ARMED)
            case "failed":
                self.fail(reported_error(message), State.ARMED)

    def fail(self, error: SvevError, then: State) -> None:
        """The recording in progress, if any, has come to a bad end; `then` is the state that it leaves behind."""
        current = self.current
        if current is None:
            return
        if current.opening:
            current.refuse(error)
            self.current = None
            return
        self.notice = recording_ended(current.id, error)
        self._say(Level.ERROR, self.notice.text)
        self._over(then)

    def abandon(self) -> None:
        """The service ends before the recorder's last word: nobody need wait for it any more."""
        self.answer()
        current, self.current = self.current, None
        if current is not None:
            error = ProcessDiedError("the service ends: look at the list of recordings when it runs again")
            current.refuse(error)
            for future in current.waiting:
                future.set_exception(error)

    def _over(self, then: State) -> None:
        current, self.current = self.current, None
        if current is not None:
            self.last = current.id
            self._machine.move(then)
            self._answers.append(current.end)

    def _say(self, level: Level, text: str) -> None:
        self._session.tell(Event.now(level, "service", text))
