"""The logs that wait to be measured: one after the other, none while a recording runs, none forgotten.

A log is queued when it is opened, and measured when it is closed. The queue stands in a file of the folder, so that a
service that was killed, or a computer without power, goes on with it.
"""

import shutil
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter, ValidationError

from recorder.log.write_lock import is_being_written
from rig.api.jump import LastJump
from rig.api.measuring import Measurement, MeasuringQueue, MeasuringState, MeasuringStep
from rig.api.statement import Level, Statement
from rig.errors import StateForbidsError
from rig.events import Event
from rig.events import Level as EventLevel
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, make_folder, read_whole
from rig.phrase import Phrase, phrase, plain
from rig.settings.model import RigSettings
from service.background.child import run_child
from service.measuring.results import keep_problem, keep_result, measurement_of

NAME: Final = ".svev-measuring.json"
#: Where results are made, before they are whole.
_WORKSHOP: Final = ".measuring"
_MOST: Final = 2000
_LOOK_S: Final = 0.2
#: Share of a step.
_SEEN: Final = 0.05
_END_S: Final = 10.0
_IDS: Final = TypeAdapter(list[str])


class Measurings:
    """Measures logs in a thread of its own; a context manager. Any thread may call any method.

    Args:
        folder: folder of the recordings.
        in_use: gives the rig in use, whose `[analysis]` says where the balls or the cameras are.
        busy: whether a recording runs.
        tell: takes an event for the live log.
        found: takes the main figures of the jumps of a log, when it is measured.
        changed: called when something has changed that people see.
    """

    def __init__(
        self,
        folder: Path,
        in_use: Callable[[], RigSettings],
        busy: Callable[[], bool],
        tell: Callable[[Event], None],
        found: Callable[[tuple[LastJump, ...]], None],
        changed: Callable[[], None],
    ) -> None:
        self._folder, self._in_use, self._busy = folder, in_use, busy
        self._tell, self._found, self._changed = tell, found, changed
        self._waiting: list[str] = []
        self._running: MeasuringQueue | None = None
        self._kept: list[str] | None = None
        self._lock = threading.Lock()
        self._bell, self._closed = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="measuring", daemon=True)

    def __enter__(self) -> "Measurings":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closed.set()
        self._bell.set()
        self._thread.join(_END_S)

    def opened(self, log: Path) -> None:
        """Note that a recording writes this log; it is measured when it is closed, if the rig file says by what."""
        if log.parent == self._folder and self._in_use().analysis is not None:
            with self._lock:
                self._append(log.stem)
            self._bell.set()

    def want(self, recording: str, log: Path) -> Measurement:
        """Have a log measured, again if it was measured before.

        Args:
            recording: its id.
            log: the log, in the folder.

        Raises:
            StateForbidsError: the rig file does not say by what, or too many are waiting.
        """
        if self._in_use().analysis is None:
            raise StateForbidsError(
                "nothing says where the balls are: give the rig file an [analysis] with survey or calibration, and "
                "restart the service"
            )
        with self._lock:
            if len(self._waiting) >= _MOST:
                raise StateForbidsError(f"{_MOST} logs are waiting already: wait until some are measured")
            self._append(recording)
        self._bell.set()
        self._changed()
        return self.measurement(recording, log)

    def give_up(self, recording: str, log: Path) -> Measurement:
        """Do not measure a log that waits or is being measured; an earlier result stays."""
        with self._lock:
            if recording in self._waiting:
                self._waiting.remove(recording)
        self._bell.set()
        self._changed()
        return self.measurement(recording, log)

    def measurement(self, recording: str, log: Path) -> Measurement:
        """What is known of the jumps of a log that lies in the folder, and how far its measuring is."""
        with self._lock:
            place = self._waiting.index(recording) if recording in self._waiting else None
            running = self._running
        known = measurement_of(recording, log)  # what left the queue before is there
        if place is None:
            return known
        update: dict[str, Any] = {"state": MeasuringState.WAITING, "before": place}
        if running is not None and running.recording == recording:
            update |= running.model_dump(include={"state", "paused", "step", "share"})
        return known.model_copy(update=update)

    @property
    def view(self) -> MeasuringQueue:
        """What is being measured, and how many logs wait."""
        with self._lock:
            if self._running is None:
                return MeasuringQueue(waiting=len(self._waiting))
            others = [recording for recording in self._waiting if recording != self._running.recording]
            return self._running.model_copy(update={"waiting": len(others)})

    def _append(self, recording: str) -> None:
        if recording not in self._waiting:
            self._waiting.append(recording)

    def _run(self) -> None:
        self._load()
        while not self._closed.is_set():
            self._keep()
            recording = self._next()
            if recording is None:
                self._bell.wait(None if not self._waiting else _LOOK_S)
                self._bell.clear()
                continue
            self._measure(recording)
            self._changed()

    def _next(self) -> str | None:
        """The first log that is closed; those that are gone do not wait any more."""
        if self._busy():
            return None
        with self._lock:
            waiting = list(self._waiting)
        for recording in waiting:
            log = self._log(recording)
            if not log.exists():
                self._forget(recording)
            elif not is_being_written(log):
                return recording
        return None

    def _measure(self, recording: str) -> None:
        log, made = self._log(recording), self._folder / _WORKSHOP / recording
        settings = self._in_use().analysis
        with self._lock:
            self._running = MeasuringQueue(recording=recording, state=MeasuringState.MEASURING)
        self._changed()
        try:
            make_folder(made.parent)
            shutil.rmtree(made, ignore_errors=True)
            if settings is None:  # another rig file, since it was queued
                self._forget(recording)
                return
            asked = {
                "log": str(log),
                "out": str(made),
                "survey": settings.survey and str(settings.survey),
                "calibration": settings.calibration and str(settings.calibration),
            }
            end = run_child(
                "service.measuring.program",
                asked,
                busy=self._busy,
                wanted=lambda: recording in self._waiting and not self._closed.is_set(),
                tell=self._hear,
                hold=self._hold,
            )
            if end is not None and log.exists():
                self._end(recording, log, made, end)
        except (OSError, ValueError) as error:
            self._fail(recording, log, plain(f"{log.name}: {error}"))
        finally:
            with self._lock:
                self._running = None
            shutil.rmtree(made, ignore_errors=True)

    def _end(self, recording: str, log: Path, made: Path, end: dict[str, Any]) -> None:
        if "problem" in end:
            self._fail(recording, log, _phrase(end["problem"]))
            return
        jumps = tuple(
            LastJump.model_validate(jump).model_copy(update={"recording": recording}) for jump in end["jumps"]
        )
        keep_result(made, log, jumps)
        self._found(jumps)
        self._forget(recording)

    def _fail(self, recording: str, log: Path, why: Phrase) -> None:
        """Note that a log cannot be measured: it waits no more."""
        self._forget(recording)
        problem = Statement(level=Level.WARNING, code=why.code, text=why.text, values=why.values)
        with suppress(FileNotFoundError):  # deleted meanwhile
            try:
                keep_problem(log, problem)
            except FileNotFoundError:
                raise
            except OSError as error:
                why = plain(f"{log}: {error.strerror}")
        text = "{recording} is not measured: {why}"
        self._tell(
            Event.now(
                EventLevel.WARNING, "analysis", phrase("event_log_not_measured", text, recording=recording, why=why)
            )
        )

    def _hear(self, news: dict[str, Any]) -> None:
        """Enter how far the program is; in steps that somebody would see, since everybody is told of each."""
        step, share, known = MeasuringStep(news["step"]), float(news["share"]), self.view
        if step is not known.step or share >= known.share + _SEEN:
            self._change(step=step, share=share)

    def _hold(self, held: bool) -> None:
        self._change(paused=held)

    def _change(self, **what: Any) -> None:
        with self._lock:
            if self._running is not None:
                self._running = self._running.model_copy(update=what)
        self._changed()

    def _forget(self, recording: str) -> None:
        with self._lock:
            if recording in self._waiting:
                self._waiting.remove(recording)
        self._keep()

    def _log(self, recording: str) -> Path:
        return self._folder / f"{recording}.mcap"

    def _load(self) -> None:
        """Go on with the queue of an earlier service."""
        shutil.rmtree(self._folder / _WORKSHOP, ignore_errors=True)
        try:
            before = _IDS.validate_json(read_whole(self._folder / NAME, TEXT_MAX, links=False))
        except FileNotFoundError:
            return
        except (OSError, ValidationError) as error:
            said = phrase(
                "event_no_queue",
                "{file}: cannot be read, so logs that waited to be measured are forgotten ({why})",
                file=NAME,
                why=str(error).partition("\n")[0],
            )
            self._tell(Event.now(EventLevel.WARNING, "analysis", said))
            return
        with self._lock:
            now, self._waiting = self._waiting, before[:_MOST]
            for recording in now:
                self._append(recording)

    def _keep(self) -> None:
        """Write the queue, if it has changed."""
        with self._lock:
            waiting = list(self._waiting)
        if waiting == self._kept or not (waiting or self._kept):
            return
        try:
            replace_file(self._folder / NAME, _IDS.dump_json(waiting), links=False)
            self._kept = waiting
        except OSError as error:
            if self._kept != waiting:
                self._kept = waiting  # said once for each change
                said = phrase(
                    "event_queue_not_kept",
                    "{file}: cannot be written ({why}): a service that starts again does not know what to measure",
                    file=NAME,
                    why=error.strerror or str(error),
                )
                self._tell(Event.now(EventLevel.WARNING, "analysis", said))


def _phrase(plainly: dict[str, Any]) -> Phrase:
    values = {name: _phrase(value) if isinstance(value, dict) else value for name, value in plainly["values"].items()}
    return Phrase(plainly["code"], plainly["text"], values)
