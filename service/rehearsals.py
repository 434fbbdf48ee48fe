"""The rehearsals of the service: one program at a time, which has the cameras while the rig is not armed.

A rehearsal is what `svev rehearse` does: it needs processes and signals of its own, so a program makes it. Its last
verdict stays in a file of the recordings' folder, so that it is known after a restart of the service.
"""

import threading
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from rig.api.rehearsal import Rehearsal, Rehearsals, RehearsalVerdict
from rig.api.statement import Level, Statement
from rig.api.status import Finding, RehearsalProgress, RehearsalStage
from rig.events import Event
from rig.events import Level as EventLevel
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from rig.transport.message import Message, Quit
from rig.transport.process_table import Child, ProcessSpec

NAME: Final = ".svev-rehearsal.json"
_LOOK_S: Final = 0.1
#: A program that is told to end has closed cameras and log after so long; else it is killed.
_PROGRAM_ENDS_S: Final = 5.0


class Rehearse(Message):
    """The order to the program.

    Attributes:
        rig: the rig.
        toml: the text of its file.
        directory: folder of the recordings.
        seconds: how much is recorded.
    """

    rig: RigSettings
    toml: str
    directory: Path
    seconds: float


class RehearsalGoes(Message):
    """How far it is."""

    progress: RehearsalProgress


class NoVerdict(Message):
    """Why there is none."""

    said: Phrase


class Rehearsed(Message):
    """The result; fields as in `svev.rehearsal.Rehearsed`, `spread_us` the median."""

    verdict: str
    pulses: int
    complete: int
    headroom: dict[str, float]
    jumps: int
    spread_us: float | None
    findings: tuple[Finding, ...]


class Rehearser:
    """Any thread may call any method.

    Args:
        program: main module of the program that rehearses; it takes `Rehearse` and says the other messages.
        in_use: gives the rig and its text, as they are in use.
        folder: of the recordings.
        tell: takes an event about what a rehearsal showed.
        changed: called when progress or verdict have changed.
    """

    def __init__(
        self,
        program: str,
        in_use: Callable[[], tuple[RigSettings, str]],
        folder: Path,
        tell: Callable[[Event], None],
        changed: Callable[[], None],
    ) -> None:
        self._program, self._in_use, self._folder = program, in_use, folder
        self._tell, self._changed = tell, changed
        self._lock = threading.Lock()
        self._progress: RehearsalProgress | None = None
        self._last = _load(folder / NAME)
        self._unwanted = threading.Event()
        self._worker: threading.Thread | None = None

    @property
    def progress(self) -> RehearsalProgress | None:
        """How far the rehearsal is that runs, None if none does."""
        return self._progress

    def view(self) -> Rehearsals:
        """The rehearsal that runs, and what the last one showed."""
        return Rehearsals(running=self._progress, last=self._last)

    def begin(self, seconds: float) -> None:
        """Begin a rehearsal; if one runs, nothing changes.

        Args:
            seconds: how much is recorded.
        """
        with self._lock:
            if self._progress is None:
                self._unwanted.clear()
                self._progress = RehearsalProgress(stage=RehearsalStage.CONNECTING)
                self._worker = threading.Thread(target=self._rehearse, args=(seconds,), name="rehearsal", daemon=True)
                self._worker.start()
        self._changed()

    def end(self) -> bool:
        """End the rehearsal that runs, without a verdict; returns when the cameras are free.

        Returns:
            Whether there was one.
        """
        with self._lock:
            worker, ran = self._worker, self._progress is not None
            self._unwanted.set()
        if worker is not None:
            worker.join()
        return ran

    def close(self) -> None:
        """End the rehearsal that runs."""
        self.end()

    def _rehearse(self, seconds: float) -> None:
        rig, rig_toml = self._in_use()
        order = Rehearse(rig=rig, toml=rig_toml, directory=self._folder, seconds=seconds)
        try:
            self._conclude(self._made(order))
        finally:
            with self._lock:
                self._progress = None
            self._changed()

    def _made(self, order: Rehearse) -> Rehearsal | None:
        """Run the program; what the rehearsal showed, None if it is not wanted any more."""
        try:
            child = Child(ProcessSpec("rehearsal", self._program, order, reports=RehearsalGoes | NoVerdict | Rehearsed))
        except OSError as error:
            why = error.strerror or str(error)
            return _failed(phrase("why_no_program", "no program can be started ({why})", why=why), order.seconds)
        try:
            return self._follow(child, order.seconds)
        finally:
            child.control.send(Quit())
            child.stop(_PROGRAM_ENDS_S)

    def _follow(self, child: Child, seconds: float) -> Rehearsal | None:
        """Hear what the program says."""
        while not self._unwanted.is_set():
            match child.control.next(_LOOK_S):
                case RehearsalGoes(progress=progress):
                    self._progress = progress
                    self._changed()
                case NoVerdict(said=said):
                    return _failed(said, seconds)
                case Rehearsed() as rehearsed:
                    return _judged(rehearsed, seconds)
            if child.control.ended:
                why = phrase("why_rehearsal_ended", "the program that rehearses has ended by itself")
                return _failed(why, seconds)
        return None

    def _conclude(self, found: Rehearsal | None) -> None:
        """Remember a verdict, if there is one, and say it."""
        if found is None:
            return
        self._last = found
        said = phrase("event_rehearsed", "rehearsal: {verdict}", verdict=found.statement.said)
        good = found.verdict in {RehearsalVerdict.READY, RehearsalVerdict.WARNED}
        self._tell(Event.now(EventLevel.INFO if good else EventLevel.WARNING, "rehearsal", said))
        try:
            replace_file(self._folder / NAME, found.model_dump_json(indent=1).encode(), links=False)
        except OSError as error:
            text = "{path}: the verdict cannot be kept ({why}); a restart of the service loses it"
            why = error.strerror or str(error)
            lost = phrase("event_verdict_not_kept", text, path=str(self._folder / NAME), why=why)
            self._tell(Event.now(EventLevel.WARNING, "rehearsal", lost))


def _failed(why: Phrase, seconds: float) -> Rehearsal:
    statement = Statement(
        level=Level.ERROR,
        code="rehearsal_failed",
        text=f"no verdict: {why}",
        advice="put that right, and rehearse again",
        values={"why": why},
    )
    return Rehearsal(
        verdict=RehearsalVerdict.FAILED, statement=statement, line=statement.text, ended=datetime.now(UTC),
        seconds=seconds,
    )  # fmt: skip


def _judged(rehearsed: Rehearsed, seconds: float) -> Rehearsal:
    findings = rehearsed.findings
    wrong = next((finding for finding in findings if finding.level == "FAIL"), None)
    if wrong is not None:
        verdict = RehearsalVerdict.NOT_READY
        why = Phrase(wrong.code, wrong.what, wrong.values)
        statement = Statement(
            level=Level.ERROR, code="rehearsal_not_ready", text=f"not ready: {why}", advice=wrong.remedy,
            values={"why": why},
        )  # fmt: skip
    elif any(finding.level == "WARN" for finding in findings):
        verdict = RehearsalVerdict.WARNED
        text, advice = "it will work, but there are warnings", "look at the warnings"
        statement = Statement(level=Level.WARNING, code="rehearsal_warned", text=text, advice=advice)
    else:
        verdict = RehearsalVerdict.READY
        statement = Statement(level=Level.GOOD, code="rehearsal_ready", text="ready to record")
    return Rehearsal(
        verdict=verdict,
        statement=statement,
        line=rehearsed.verdict,
        ended=datetime.now(UTC),
        seconds=seconds,
        pulses=rehearsed.pulses,
        complete=rehearsed.complete,
        headroom=rehearsed.headroom,
        jumps=rehearsed.jumps,
        spread_us=rehearsed.spread_us,
        findings=findings,
    )


def _load(path: Path) -> Rehearsal | None:
    """The verdict that was kept; None if there is none, or if another version of the service has kept it."""
    try:
        return Rehearsal.model_validate_json(read_whole(path, TEXT_MAX, links=False))
    except (OSError, ValidationError):
        return None
