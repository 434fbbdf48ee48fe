"""The exports of the service: a queue, one process at a time, which stands still while a recording runs.

The files lie in a hidden folder beside the recordings. They are removed after a day, sooner if their room is needed,
and when the service starts.
"""

import shutil
import threading
import time
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any, Final

from rig.api.export import ENDINGS, ExportJob, ExportOrder, ExportState
from rig.background.child import run_child
from rig.background.messages import Failed
from rig.errors import StateForbidsError, StorageError, UnknownExportError
from rig.host.files import make_folder
from rig.phrase import Phrase, phrase
from service.exports.program import Export, Exported, Exporting

FOLDER: Final = ".exports"
#: A file is kept for so long, unless its room is needed.
KEPT_S: Final = 86_400.0
#: So many exports wait at most.
_QUEUE_MAX: Final = 50
_RECORDING_LOOK_S: Final = 0.2
_WORKER_ENDS_S: Final = 10.0
_OVER: Final = (ExportState.DONE, ExportState.FAILED)


class Exports:
    """Any thread may call any method.

    Args:
        directory: folder of the recordings.
        busy: whether a recording runs.
        room: bytes that may still be used on the disk, beside the reserve.

    Attributes:
        refused: why there can be no exports, and what to do; None if there can.
    """

    def __init__(self, directory: Path, busy: Callable[[], bool], room: Callable[[], float]) -> None:
        self._folder, self._busy, self._room = directory / FOLDER, busy, room
        self.refused = _cleared(self._folder)
        self._jobs: dict[str, ExportJob] = {}
        self._logs: dict[str, Path] = {}
        self._ended: dict[str, float] = {}
        self._numbers = count(1)
        self._lock = threading.RLock()
        self._worker: threading.Thread | None = None
        self._closed = threading.Event()

    def start(self, recording_id: str, log: Path, name: str, order: ExportOrder) -> ExportJob:
        """Ask for an export.

        Args:
            recording_id: id of the recording.
            log: its log, which nobody writes any more.
            name: of the file, without ending.
            order: what of it, and how.

        Raises:
            StateForbidsError: too many are waiting, or the service ends.
            StorageError: there is not room enough, or exports have no folder.
        """
        if self.refused is not None:
            raise StorageError(self.refused)
        needed = log.stat().st_size  # no export is larger, but for those of noise
        self.tidy(needed)
        if self._room() < needed:
            raise StorageError(
                phrase(
                    "export_no_room",
                    "an export may take {gb:.1f} GB, which the disk has not: delete recordings and empty the trash",
                    gb=needed / 1e9,
                )
            )
        with self._lock:
            if self._closed.is_set() or sum(job.state not in _OVER for job in self._jobs.values()) >= _QUEUE_MAX:
                raise StateForbidsError(
                    phrase(
                        "export_queue_full",
                        "{count} exports are waiting already: wait, or cancel some",
                        count=_QUEUE_MAX,
                    )
                )
            job_id = str(next(self._numbers))
            file = f"{name}{ENDINGS[order.kind] or '.zip'}"
            job = ExportJob(id=job_id, recording=recording_id, order=order, state=ExportState.WAITING, name=file)
            self._jobs[job_id], self._logs[job_id] = job, log
            if self._worker is None:
                self._worker = threading.Thread(target=self._work, name="exports", daemon=True)
                self._worker.start()
            return job

    def jobs(self) -> list[ExportJob]:
        """All exports that are kept, newest first."""
        self.tidy()
        with self._lock:
            return list(reversed(self._jobs.values()))

    def job(self, job_id: str) -> ExportJob:
        """One of them.

        Raises:
            UnknownExportError: there is none of this id.
        """
        with self._lock:
            if job_id not in self._jobs:
                raise UnknownExportError(
                    phrase(
                        "export_unknown",
                        "no export {export}: it was removed, or never asked for; ask for it again",
                        export=job_id,
                    )
                )
            return self._jobs[job_id]

    def file(self, job_id: str) -> Path:
        """The file of an export that is done.

        Raises:
            UnknownExportError: there is none of this id.
            StateForbidsError: it is not done.
        """
        job = self.job(job_id)
        if job.state is not ExportState.DONE:
            raise StateForbidsError(
                phrase("export_not_done", "export {export} is not done: wait until it is", export=job_id)
            )
        return self._place(job)

    def remove(self, job_id: str) -> ExportJob:
        """Remove an export and its file; an unfinished one is cancelled.

        Raises:
            UnknownExportError: there is none of this id.
        """
        with self._lock:
            job = self.job(job_id)
            del self._jobs[job_id], self._logs[job_id]
            self._ended.pop(job_id, None)
        if job.state in _OVER:  # the worker removes what it is about
            shutil.rmtree(self._folder / job_id, ignore_errors=True)
        return job

    def tidy(self, needed: float = 0.0) -> None:
        """Remove what is too old, and while less than `needed` bytes may be used, what was done first."""
        with self._lock:
            for job_id, ended in sorted(self._ended.items(), key=lambda item: item[1]):
                if time.monotonic() - ended > KEPT_S or self._room() < needed:
                    self.remove(job_id)

    def close(self) -> None:
        """Give up what is not done, and end the process."""
        with self._lock:
            self._closed.set()
            worker = self._worker
        if worker is not None:
            worker.join(_WORKER_ENDS_S)

    def _place(self, job: ExportJob) -> Path:
        return self._folder / job.id / job.name

    def _work(self) -> None:
        """Make one export after the other; end when there is none."""
        while True:
            with self._lock:
                waiting = [job for job in self._jobs.values() if job.state is ExportState.WAITING]
                if not waiting or self._closed.is_set():
                    self._worker = None
                    return
                job, log = waiting[0], self._logs[waiting[0].id]
            if self._busy():
                self._closed.wait(_RECORDING_LOOK_S)
            else:
                self._make(job, log)

    def _make(self, job: ExportJob, log: Path) -> None:
        place = self._place(job)
        try:
            make_folder(self._folder)
            place.parent.mkdir()
            self._change(job.id, state=ExportState.RUNNING)
            end = run_child(
                "service.exports.program",
                Export(log=log, order=job.order, out=place),
                Exporting | Exported,
                busy=self._busy,
                wanted=lambda: job.id in self._jobs and not self._closed.is_set(),
                tell=lambda news: self._change(job.id, done=news.done, pulses=news.pulses),
                hold=lambda held: self._change(job.id, state=ExportState.PAUSED if held else ExportState.RUNNING),
            )
            if isinstance(end, Failed):
                self._end(job.id, problem=end.said)
            elif isinstance(end, Exported):
                self._end(job.id, bytes=end.bytes)
        except OSError as error:
            self._end(
                job.id,
                problem=phrase(
                    "export_failed", "the export cannot be made ({why}): try again", why=error.strerror or str(error)
                ),
            )
        if job.id not in self._jobs:
            shutil.rmtree(place.parent, ignore_errors=True)

    def _end(self, job_id: str, **said: Any) -> None:
        with self._lock:
            if job_id in self._jobs:
                self._change(job_id, state=ExportState.FAILED if "problem" in said else ExportState.DONE, **said)
                self._ended[job_id] = time.monotonic()

    def _change(self, job_id: str, **what: Any) -> None:
        with self._lock:
            if job_id in self._jobs:
                self._jobs[job_id] = self._jobs[job_id].model_copy(update=what)


def _cleared(folder: Path) -> Phrase | None:
    """Remove the exports of an earlier service: nobody knows any more what they were.

    Returns:
        Why the folder cannot be used.
    """
    try:
        make_folder(folder)
        shutil.rmtree(folder)
    except FileNotFoundError:  # the recordings have no folder yet
        return None
    except OSError as error:
        text = "{path}: exports cannot be kept there ({why}): remove it, and start the service again"
        return phrase("event_no_exports", text, path=str(folder), why=error.strerror or str(error))
    return None
