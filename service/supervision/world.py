"""Where the supervisor's decisions have their effects: processes, logs, start list, and those who wait for answers."""

import select
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from rig.api.status import Status
from rig.errors import BadInputError, ProcessDiedError, StorageError, SvevError
from rig.events import Event
from rig.phrase import phrase
from service.jumpers.book import JumperBook
from service.processes.rig_session import RigSession
from service.recordings.interruption import FoundLog, begin_to_read
from service.recordings.storage import check_room_for, free_path, new_log_path
from service.recordings.truth import TruthWriter
from service.supervision.messages import (
    Answer,
    AnswerStatus,
    Effect,
    GiveBack,
    KillRecorder,
    LetPulses,
    LogGrown,
    LogNamed,
    LogOpened,
    LogPrepared,
    LogRead,
    LogsClosed,
    MeasureLog,
    Message,
    NameLog,
    Note,
    Order,
    PrepareLog,
    ReadLog,
    Refuse,
    RenameTaken,
    RenewCamera,
    RestartRecorder,
    RigFailed,
    Say,
    SetUp,
    TakeDown,
    UseRig,
)

_TRUTH_S: Final = 4.0


class World:
    """Only the supervisor's thread uses it; any thread may wait for `truths`.

    Args:
        session: the rig and its processes.
        jumpers: says whom the next recording is of.
        truths: writes the truth beside the logs of simulated cameras.
        on_log: called with each log that the recorder has made.

    Attributes:
        session, truths: as given.
    """

    def __init__(
        self, session: RigSession, jumpers: JumperBook, truths: TruthWriter, on_log: Callable[[Path], None]
    ) -> None:
        self.session, self.truths = session, truths
        self._jumpers, self._on_log = jumpers, on_log
        self._reading: tuple[Path, Future[FoundLog]] | None = None
        self._answers: list[Answer | AnswerStatus | Refuse] = []

    def news(self) -> Iterator[Message]:
        """What has been done in the background since."""
        try:
            self.session.collect()
        except SvevError as error:
            yield RigFailed(error)
        if self._reading is not None and self._reading[1].done():
            (log, found), self._reading = self._reading, None
            yield LogRead(log, found.result() if found.exception() is None else None)

    def listen(self, timeout_s: float, bell: int) -> Iterator[Message]:
        """Wait for reports, but not longer than until the bell rings."""
        processes = self.session.processes
        if processes is None:
            select.select([bell], [], [], timeout_s)
            return
        try:
            yield from processes.turn(timeout_s, (bell,))
        except ProcessDiedError as error:
            yield RigFailed(error)

    def perform(self, effect: Effect) -> Message | None:
        """Do it; gives what has come of it, where that decides something."""
        match effect:
            case Say():
                self.session.tell(Event.now(effect.level, effect.name, effect.said))
            case Note():
                self.session.tell(effect.event)
            case Answer() | AnswerStatus() | Refuse():
                self._answers.append(effect)
            case UseRig():
                self.session.rig = effect.rig
            case SetUp():
                self.session.begin_set_up()
            case TakeDown():
                self.session.begin_take_down(keep_hill=effect.keep_hill)
            case RenewCamera():
                self.session.change_camera(effect.camera)
            case RestartRecorder() | KillRecorder() | Order() | LetPulses():
                self._command(effect)
            case _:
                return self._keep(effect)
        return None

    def refuse(self, who: "Future[Any]", error: Exception) -> None:
        """Answer somebody with an error, whatever else was to be answered."""
        self._answers = [answer for answer in self._answers if answer.to is not who]
        self._answers.append(Refuse(who, error))

    def answer(self, status: Status) -> None:
        """Answer those who wait: the status shows by now what was decided."""
        answers, self._answers = self._answers, []
        for answer in answers:
            match answer:
                case Answer():
                    answer.to.set_result(answer.value)
                case AnswerStatus():
                    answer.to.set_result(status)
                case Refuse():
                    answer.to.set_exception(answer.error)

    def close(self) -> None:
        """Stop everything that is left, and wait until that is done."""
        self.session.close()

    def end(self) -> None:
        """Give up what is not written beside the logs."""
        self.truths.end(_TRUTH_S)

    def _command(self, effect: RestartRecorder | KillRecorder | Order | LetPulses) -> None:
        """Command the processes, if there are any."""
        if (processes := self.session.processes) is None:
            return
        match effect:
            case RestartRecorder():
                processes.restart_recorder()
            case KillRecorder():
                processes.kill_recorder()
            case Order():
                processes.tell(effect.command)
            case LetPulses():
                processes.let_pulses(effect.pulses)

    def _keep(self, effect: Effect) -> Message | None:
        """What logs and start list have to do with it."""
        match effect:
            case PrepareLog():
                return self._prepared(effect)
            case NameLog():
                return LogNamed(free_path(effect.wanted))
            case RenameTaken():
                self._jumpers.rename(effect.before, effect.after)
            case GiveBack():
                self._jumpers.give_back(effect.recording)
            case MeasureLog():
                with suppress(FileNotFoundError):  # somebody has moved the log away
                    return LogGrown(effect.log.stat().st_size)
            case LogOpened():
                if not effect.part:  # truth and measurements are those of the whole recording
                    self.truths.opened(effect.log, self.session.truth)
                    self._on_log(effect.log)
            case LogsClosed():
                self.truths.closed(effect.failed)
            case ReadLog():
                self._reading = effect.log, begin_to_read(effect.log, effect.first_id)
        return None

    def _prepared(self, effect: PrepareLog) -> Message | None:
        """The log of a recording; None if there is no room for it: then the order is refused."""
        rig, folder, order = self.session.rig, self.session.recorder.directory, effect.command.order
        try:
            check_room_for(rig, folder, rig.recorder.jump_s if order.duration_s is None else order.duration_s)
            path = new_log_path(folder)
        except BadInputError:
            text = "{folder}: cannot be written; correct its permissions, or start the service with another --data"
            why = StorageError(phrase("why_folder_read_only", text, folder=str(folder)))
            self.refuse(effect.command.answer, why)
        except SvevError as error:
            self.refuse(effect.command.answer, error)
        else:
            session, more = self._jumpers.take(path.stem, order)
            return LogPrepared(effect.command, path, session, more)
        return None
