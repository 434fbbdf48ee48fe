"""The logs that survey or poses kept from being measured: they are measured again when that file has changed."""

import hashlib
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.host.files import TEXT_MAX, read_whole
from rig.settings.model import AnalysisSettings, RigSettings
from service.measuring.keeping import note_source
from service.measuring.results import failed_by

#: Of a file that cannot be read.
_UNREADABLE: Final = ""


class Retries:
    """Once per change of the file: a log that fails again, or is cancelled meanwhile, waits for the next change.

    Args:
        folder: of the recordings.
        in_use: gives the rig in use, whose `[analysis]` names the file.
    """

    def __init__(self, folder: Path, in_use: Callable[[], RigSettings]) -> None:
        self._folder, self._in_use = folder, in_use
        self._seen: tuple[Path, int, int, int] | None = None

    def look_again(self) -> None:
        """A log has failed: the file may have changed while it was being measured."""
        self._seen = None

    def due(self) -> list[str]:
        """The logs that are to be measured again, the newest first.

        Cheap enough to be called every second: logs are looked at only when the file is another one than before.
        """
        analysis = self._in_use().analysis
        if analysis is None or (stamp := _stamp(source_file(analysis))) == self._seen:
            return []
        self._seen = stamp
        mark = source_mark(analysis)
        if stamp is None:
            return []
        logs = sorted(self._folder.glob("*.mcap"), reverse=True)
        failed = [log.stem for log in logs if failed_by(log) not in {None, mark}]
        return failed if failed and _is_readable(analysis) else []

    def queued(self, recordings: Sequence[str]) -> None:
        """Note that logs wait to be measured by the file as it is."""
        analysis = self._in_use().analysis
        if analysis is None:
            return
        mark = source_mark(analysis)
        for recording in recordings:
            with suppress(
                OSError
            ):  # a disk that refuses is told of with the queue; they are queued again after a restart
                note_source(self._folder / f"{recording}.mcap", mark)


def source_file(analysis: AnalysisSettings) -> Path:
    """The survey or the poses, whichever the rig file names."""
    return analysis.survey or analysis.calibration or Path()


def source_mark(analysis: AnalysisSettings) -> str:
    """What tells one content of that file from another, SHA-256 in hexadecimal; empty: it cannot be read."""
    try:
        return hashlib.sha256(read_whole(source_file(analysis), TEXT_MAX, links=True)).hexdigest()
    except OSError:
        return _UNREADABLE


def _stamp(path: Path) -> tuple[Path, int, int, int] | None:
    try:
        stat = path.stat()
    except OSError:
        return None
    return path, stat.st_ino, stat.st_ctime_ns, stat.st_size  # unlike its mtime, ctime tells that it may be read now


def _is_readable(analysis: AnalysisSettings) -> bool:
    # Imported here because the analysis and its libraries take memory and half a second to load.
    from analysis.cameras.poses_file import read_poses  # noqa: PLC0415
    from analysis.scene.survey import read_survey  # noqa: PLC0415

    try:
        read_poses(source_file(analysis)) if analysis.survey is None else read_survey(analysis.survey)
    except BadInputError:
        return False
    return True
