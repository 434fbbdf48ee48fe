"""The thread that owns the rig: takes messages, decides, and has the effects performed.

At every turn it compares what is wanted (armed or not) with what is there, and takes one step to make them equal. It
never waits for anything but the next report or command. What it decides by is one frozen situation, which any thread
may read; `service.supervision.decide` says what follows from it.
"""

import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, TypeVar

from rig.api.status import Status
from rig.errors import ProcessDiedError
from rig.events import Event, Level
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from rig.transport.recorder_commands import RecorderOptions
from service.jumpers.book import JumperBook
from service.processes.rig_session import RigSession, StartHill
from service.recordings.truth import TruthWriter
from service.rig_file import read_calibration
from service.status.event_hub import EventHub
from service.supervision.commands import Commands
from service.supervision.decide import decide, is_over
from service.supervision.messages import Command, LoopEnds, Message, ProcessesEnded, TurnBegins, TurnEnds
from service.supervision.situation import Moment, RigInUse, Situation
from service.supervision.status_board import StatusBoard
from service.supervision.world import World

T = TypeVar("T")
_TURN_S: Final = 0.2
_ANSWER_S: Final = 10.0
_RECORDING_ENDS_S: Final = 4.0


@dataclass(slots=True)
class Hooks:
    """Whom the supervisor's thread calls; set them before it starts.

    Attributes:
        on_turn: at every turn, e.g. to feed a watchdog.
        on_log: with each log that the recorder has made.
        on_end: when the thread ends, for whatever reason.
    """

    on_turn: Callable[[], None] = lambda: None
    on_log: Callable[[Path], None] = lambda _: None
    on_end: Callable[[], None] = lambda: None


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
        hooks: whom the thread calls.
        now: the situation; any thread may read it.
        changing: held by the thread that changes settings of the rig in use.
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
        in_use = RigInUse(rig, rig_toml, read_calibration(rig))
        self.hub, self.hooks, self.changing = hub, Hooks(), threading.Lock()
        self.now = Situation.idle(in_use, Moment.now(), enduring=enduring)
        self._commands = Commands()
        jumpers = jumpers or JumperBook()
        session = RigSession(rig, hub.tell, self._commands.ring, recorder=recorder, hill=hill)
        self._world = World(session, jumpers, TruthWriter(hub.tell), self._log_made)
        self._board = StatusBoard(hub, jumpers, recorder, session.tell, self.now)
        self._thread = threading.Thread(target=self._run, name="supervisor")

    @property
    def rig(self) -> RigSettings:
        """The rig in use."""
        return self.now.in_use.rig

    @property
    def status(self) -> Status:
        """The latest status, at most a second old; any thread may ask."""
        return self._board.status

    @property
    def truths(self) -> TruthWriter:
        """Writes the truth beside the logs of simulated cameras; any thread may wait for it."""
        return self._world.truths

    @property
    def answering(self) -> bool:
        """Whether the loop turns and the recorder, if there should be one, reports; any thread may ask."""
        return self._thread.is_alive() and self.now.answering

    def records(self) -> bool:
        """Whether a recording runs or is being opened; any thread may ask."""
        return self.now.recordings.current is not None

    def ask(self, make: "Callable[[Future[T]], Command[T]]", deadline_s: float = _ANSWER_S) -> T:
        """Give a command, and wait for its answer; any thread but its own may do so. See `Commands.ask`.

        Raises:
            ProcessDiedError: no answer came in time, or the service is ending.
            SvevError: why the command cannot be obeyed.
        """
        return self._commands.ask(make, deadline_s)

    def change(
        self, make: "Callable[[Future[None]], Command[None]]", name: str, said: Phrase, deadline_s: float = _ANSWER_S
    ) -> None:
        """Give a command that changes the rig in use, wait until it is obeyed, and tell of it; errors as of `ask`.

        Args:
            make: makes the command.
            name: the part that the event is about.
            said: the change.
            deadline_s: longest time to wait, s.
        """
        self.ask(make, deadline_s)
        self.hub.tell(Event.now(Level.INFO, name, said))

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def begin_stop(self) -> None:
        """Begin to end: finish a recording, then stop everything. May be called from a signal handler, and again."""
        self._commands.end_by(time.monotonic() + _RECORDING_ENDS_S)

    def stop(self, timeout_s: float) -> None:
        """Finish a recording, stop all processes, wait for the end of the thread.

        Raises:
            ProcessDiedError: the thread has not ended within `timeout_s` seconds.
        """
        self.begin_stop()
        self._thread.join(timeout_s)
        if self._thread.is_alive():
            raise ProcessDiedError(f"the rig did not stop within {timeout_s:g} s: its processes end by themselves")
        self._commands.close()

    def _run(self) -> None:
        failure: Exception | None = None
        try:
            while not self._over():
                self._turn()
        except Exception as error:
            failure = error
            why = f"{type(error).__name__}: {error}"
            said = phrase("event_supervisor_failed", "the supervisor failed: {error}", error=why)
            self.hub.tell(Event.now(Level.FATAL, "service", said))
            raise
        finally:
            self._take(LoopEnds(failure))
            self._world.close()
            self._take(ProcessesEnded())
            self._world.end()
            self._show(at_once=True)
            self._commands.end()
            self.hooks.on_end()

    def _turn(self) -> None:
        for command in self._commands.fetch():
            self._obey(command)
        for news in self._world.news():
            self._take(news)
        if self._over():
            return
        self._take(TurnBegins())
        self._show()
        for report in self._world.listen(_TURN_S, self._commands.bell):
            self._take(report)
        self._take(TurnEnds())
        self._show()
        self.hooks.on_turn()

    def _over(self) -> bool:
        return is_over(self.now, Moment.now())

    def _log_made(self, log: Path) -> None:
        self.hooks.on_log(log)

    def _obey(self, message: Message) -> None:
        """Take a command; any error is the answer, and the loop goes on."""
        try:
            self._take(message)
        except Exception as error:
            if not isinstance(message, Command):
                raise
            self._world.refuse(message.answer, error)

    def _take(self, message: Message) -> None:
        """Take a message, and what comes of its effects."""
        messages = deque([message])
        while messages:
            message = messages.popleft()
            seen = replace(self.now, seen=self._world.session.look())
            self._board.note(message, seen)
            self.now, effects = decide(seen, message, Moment.now())
            for effect in effects:
                if (came := self._world.perform(effect)) is not None:
                    messages.append(came)

    def _show(self, *, at_once: bool = False) -> None:
        """Renew the status if it is time, then answer those who wait: they see it."""
        self._board.renew(self.now, at_once=at_once)
        self._world.answer(self.status)
