"""The logs that wait to be measured: one after the other, the last jump first, none while a recording runs.

A log is queued when it is opened, and measured when it is closed; then come the further steps that the rig file asks
for. None is forgotten: a service that was killed, or a computer without power, goes on with the queue. When nothing is
to be measured, recordings are copied to the other disk that `[offload]` names; those that are not there yet, or have
changed since, are found by looking.
"""

import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

from analysis.result.naming import CAMERAS
from recorder.log.beside import measured_path
from recorder.reading.parts import parts_of
from rig.api.jump import LastJump
from rig.api.measuring import Measurement, MeasuringQueue
from rig.api.statement import Level, Statement
from rig.errors import NoAnalysisError
from rig.events import Event
from rig.settings.model import RigSettings
from service.measuring.after_steps import AfterSteps
from service.measuring.at_work import AtWork
from service.measuring.progress import in_queue
from service.measuring.queues import Queues
from service.measuring.results import measurement_of
from service.measuring.waiting import WaitingLogs
from service.offloading.releasing import Releasing, Removal

_QUEUE_LOOK_S: Final = 0.2
#: So often survey or poses are looked at while nothing waits.
_SOURCE_LOOK_S: Final = 2.0
_THREAD_ENDS_S: Final = 10.0
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
        self._in_use, self._busy, self._changed = in_use, busy, changed
        self._queues, self._now = Queues(folder, in_use, tell), AtWork(found, changed)
        copied, now = self._queues.copies.notes, self._now
        self._releasing = Releasing(folder, in_use, copied, removal, tell)
        self._after = AfterSteps(folder, busy, earlier, self._wanted, now.hear, now.hold, tell, now.know, copied)
        self._bell, self._closed = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=self._run, name="measuring", daemon=True)

    def __enter__(self) -> "Measurings":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._closed.set()
        self._bell.set()
        self._thread.join(_THREAD_ENDS_S)
        self._queues.close()

    def opened(self, log: Path) -> None:
        """Note that a recording writes this log; when it is closed that is done with it which the rig file asks for."""
        self._queues.opened(log)
        self._bell.set()

    def restored(self, recording: str, log: Path) -> None:
        """A recording is back from the trash: if it was deleted before its turn came, it waits again."""
        self._queues.restored(recording, log)
        self._bell.set()

    def renamed(self, recording: str, log: Path) -> None:
        """The session of a recording was corrected: the files of its result that name the jumper are written anew."""
        self._queues.renamed(recording, log)
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
        self._queues.measuring.add(recording)
        self._bell.set()
        self._changed()
        return self.measurement(recording, log)

    def give_up(self, recording: str, log: Path) -> Measurement:
        """Do not measure a log that waits or is being measured; an earlier result stays."""
        self._queues.measuring.remove(recording)
        self._bell.set()
        self._changed()
        return self.measurement(recording, log)

    def measurement(self, recording: str, log: Path) -> Measurement:
        """The measured jumps of a log in the folder, and the progress of its measuring."""
        ids, running, analysis = self._queues.measuring.ids, self._now.running, self._in_use().analysis
        known = measurement_of(recording, log)  # what left the queue before is there
        if analysis is None:
            what, _, advice = _NO_SOURCE.partition(": ")
            refused = Statement(level=Level.INFO, code="no_analysis", text=what, advice=advice)
            known = known.model_copy(update={"refused": refused})
        found = in_queue(known, ids, running, self._now.figures, analysis)
        copy = self._queues.copies.step([part.stem for part in parts_of(log)], running)
        return found.model_copy(update={"steps": (*found.steps, *copy)})

    @property
    def view(self) -> MeasuringQueue:
        """What is being measured, and how many logs wait."""
        return self._now.view(self._queues.measuring.ids)

    def _run(self) -> None:
        queues = self._queues
        self._after.tidy()
        queues.go_on()
        while not self._closed.is_set():
            if queues.retry():
                self._changed()
            if not self._busy():
                queues.copies.look()
            if (recording := self._next(queues.names)) is not None:
                self._rename(recording)
            elif (recording := self._next(queues.measuring)) is not None:
                self._work(recording)
            elif (recording := self._next(queues.copies.waiting)) is not None:
                self._copy(recording)
            elif not self._release():
                waiting = queues.measuring.ids or queues.names.ids or queues.copies.waiting.ids
                self._bell.wait(_QUEUE_LOOK_S if waiting else _SOURCE_LOOK_S)
                self._bell.clear()
                continue
            self._changed()

    def _next(self, waiting: WaitingLogs) -> str | None:
        """The next log of a queue, none while a recording runs."""
        return None if self._busy() else self._queues.next(waiting)

    def _work(self, recording: str) -> None:
        """Measure a log, and take the further steps; a step that was cancelled or interrupted leaves no note."""
        queues, analysis = self._queues, self._in_use().analysis
        with self._now.on(recording, queues.measuring):
            if analysis is not None:  # else another rig file, since it was queued
                self._after.measure(recording, queues.log(recording), analysis)
                queues.failed()
            if not self._closed.is_set():
                queues.copies.want(recording)
                queues.drop(recording, queues.measuring)

    def _rename(self, recording: str) -> None:
        """Write what a result says of the session anew; a result of an older svev is measured again for that."""
        queues, analysis = self._queues, self._in_use().analysis
        log = queues.log(recording)
        if not (measured_path(log) / CAMERAS).exists():
            queues.names.remove(recording)
            if analysis is not None:
                queues.measuring.add(recording)
            return
        with self._now.on(recording, queues.names):
            done = self._after.rename(recording, log)
            queues.names.remove(recording)
        if done:  # perhaps corrected once more meanwhile
            queues.renamed(recording, log)
            queues.copies.want(recording)

    def _release(self) -> bool:
        """Release a recording that is safe on the other disk, if there is one to be released."""
        logs = None if self._busy() else self._releasing.next()
        if logs is not None:
            self._releasing.release(logs, self._busy, self._is_idle)
        return logs is not None

    def _copy(self, recording: str) -> None:
        queues, offload = self._queues, self._in_use().offload
        with self._now.on(recording, queues.copies.waiting):
            if offload is not None:  # else another rig file, since it was queued
                self._after.copy(recording, queues.log(recording), offload)
            if self._wanted(recording):
                queues.copies.waiting.remove(recording)

    def _wanted(self, recording: str) -> bool:
        if self._now.queue is self._queues.copies.waiting and not self._is_idle():
            return False  # people wait for a jump: the copy goes on behind it
        return recording in self._now.queue and not self._closed.is_set()

    def _is_idle(self) -> bool:
        """Whether nothing is to be measured, and the service goes on."""
        return self._next(self._queues.measuring) is None and not self._closed.is_set()
