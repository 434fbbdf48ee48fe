"""A rig whose processes are in memory: it obeys the supervisor's commands and reports what the test lets happen."""

from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from rig.api.recordings import Counts
from rig.clocks import UtcNs
from rig.errors import ProcessDiedError, StorageError
from rig.phrase import NOTHING, Phrase, phrase
from rig.settings.model import RigSettings
from rig.transport.analysis_messages import Measuring
from rig.transport.recorder_commands import RecorderCommand, StartRecording, StopRecording
from rig.transport.recorder_reports import (
    CameraChanged,
    CameraNews,
    RecorderFailed,
    RecordingFinished,
    RecordingStarted,
)
from service.processes.rig_processes import RigReport
from service.processes.seen import Seen


class ProcessesInMemory:
    """See `service.processes.rig_processes.RigProcesses`.

    Attributes:
        fails: raised when the processes are started; set on the class by tests.
        latest: the instance that was made last.
    """

    fails: Exception | None = None
    latest: "ProcessesInMemory"

    def __init__(self, rig: RigSettings, *_: Any, **__: Any) -> None:
        self._count = len(rig.cameras)
        self._connect()
        self.commands: list[RecorderCommand] = []
        self.disk_full = False
        self._reports: list[RigReport] = []
        self._dying = False
        self._recording: Path | None = None
        type(self).latest = self

    def _connect(self) -> None:
        self.seen = replace(Seen.begun(self._count), warm=True, ready=True)
        for index in range(self._count):
            self.camera(index, CameraNews.CONNECTED)

    def __enter__(self) -> Self:
        if self.fails is not None:
            raise self.fails
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is left to stop."""

    def tell(self, command: RecorderCommand) -> None:
        """Obey."""
        self.commands.append(command)
        match command:
            case StartRecording() if self.disk_full:
                full = StorageError(phrase("why_full", "the disk is full: make room"))
                self._reports.append(RecorderFailed.of(full))
            case StartRecording():
                self._recording = command.path
                self._reports.append(RecordingStarted(first_pulse=UtcNs(1)))
            case StopRecording() if self._recording is not None:
                path, self._recording = self._recording, None
                self._reports.append(_finished(path))

    def camera(self, index: int, news: CameraNews) -> None:
        """Let a camera come or go."""
        self.seen = self.seen.heard(CameraChanged(camera=index, news=news, said=NOTHING))

    def die(self) -> None:
        """Let the recorder die."""
        self._dying = True

    def measuring(self, refused: Phrase | None) -> None:
        """Let the analysis say whether it can measure."""
        self._reports.append(Measuring(refused=refused))

    def turn(self, _timeout_s: float, _wake: tuple[int, ...] = ()) -> list[RigReport]:
        """What has happened."""
        reports, self._reports = self._reports, []
        if self._dying and not reports:
            self._dying, self.seen = False, self.seen.without_recorder()
            raise ProcessDiedError(phrase("why_recorder_died", "the recorder died: killed by SIGKILL"))
        return reports

    def restart_recorder(self) -> None:
        """Start another one."""
        self._connect()

    def kill_recorder(self) -> None:
        """End it."""
        self.die()


def _finished(path: Path) -> RecordingFinished:
    return RecordingFinished(path=path, bytes=0, unpublished=0, counts=Counts(), first_pulse=None, pauses=())
