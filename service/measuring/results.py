"""What was measured in a log after its end, from the folder beside it."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final

from analysis.result.naming import bears_names
from recorder.log.beside import measured_path
from recorder.log.session_changes import session_changes
from rig.api.jump import LastJump
from rig.api.measuring import AfterStep, Measurement, MeasuringState, StepState
from rig.api.recordings import SessionFields
from rig.api.statement import Statement
from rig.errors import BadInputError, StateForbidsError
from rig.host.files import TEXT_MAX, open_to_read, opened_folder, read_whole
from rig.phrase import phrase
from service.measuring.outcome import NAME, Outcome, read_outcome
from service.seam.archive import Download

_JUMPER: Final = "jumper.json"
#: MP4, which every phone plays.
VIDEO: Final = "overlay.mp4"


def measurement_of(recording: str, log: Path) -> Measurement:
    """What was measured in a log; state `NONE` if that was never tried, or its outcome cannot be read."""
    folder = measured_path(log)
    found = read_outcome(folder)
    if found is None:
        return Measurement(recording=recording, state=MeasuringState.NONE)
    renaming = _is_outdated(found, log)
    return Measurement(
        recording=recording,
        state=_state(found.problem),
        problem=found.problem,
        again=found.source is not None,
        steps=tuple(
            StepState(step=step, state=_state(problem), problem=problem)
            for step, problem in ((AfterStep.MEASURE, found.problem), *found.further)
            if step is not AfterStep.COPY  # noted by earlier versions
        ),
        measured=found.measured,
        version=found.version,
        figures=tuple(jump.model_copy(update={"recording": recording}) for jump in found.jumps),
        files=tuple(sorted(each.name for each in _files(folder) if not (renaming and bears_names(each.name)))),
        renaming=renaming,
    )


def _state(problem: Statement | None) -> MeasuringState:
    return MeasuringState.DONE if problem is None else MeasuringState.FAILED


def result_file(log: Path, name: str) -> Path | None:
    """The file of this name in the result of a log; None if there is none."""
    return next((each for each in _files(measured_path(log)) if each.name == name), None)


def is_outdated(log: Path) -> bool:
    """Whether the session was corrected since the files were written that say whose jump it is."""
    found = read_outcome(measured_path(log))
    return found is not None and _is_outdated(found, log)


def names_of(log: Path) -> dict[str, str]:
    """The corrections of what those files say: name, bib, gate, wind, notes, operator."""
    try:
        changes = session_changes(log)
    except BadInputError:
        return {}  # the catalogue says so
    return {field: text for field, text in changes.items() if field in SessionFields.model_fields}


def _is_outdated(found: Outcome, log: Path) -> bool:
    return bool(found.jumps) and found.names != names_of(log)


def jumps_in_full(log: Path) -> tuple[dict[str, object], ...]:
    """The jumps of the result of a log as they stand in its `jumper.json`; none if there is no such file.

    Raises:
        StateForbidsError: the file is damaged.
    """
    try:
        content = json.loads(read_whole(measured_path(log) / _JUMPER, TEXT_MAX, links=False))
        return tuple(content["jumps"])
    except FileNotFoundError:
        return ()
    except (OSError, ValueError, LookupError, TypeError) as error:
        raise StateForbidsError(
            phrase(
                "measuring_result_damaged",
                "{log}: {file} of its result cannot be read: measure it again",
                log=log.name,
                file=_JUMPER,
            )
        ) from error


def result_downloads(log: Path, name: str) -> list[Download]:
    """The whole result of a log as files to take away, in a folder that belongs beside the log's file.

    Args:
        log: the log; files that say a name which was corrected since are left out.
        name: of the file that it is taken away as.
    """
    folder, renaming = measured_path(log), is_outdated(log)
    files = [each for each in _files(folder) if not (renaming and bears_names(each.name))]
    return [file_download(path, f"{measured_path(Path(name)).name}/{path.name}") for path in (*files, *_own(folder))]


def _opened(path: Path, _size: int) -> BinaryIO:
    return open_to_read(path, links=False)


def file_download(path: Path, name: str, opened: Callable[[Path, int], BinaryIO] = _opened) -> Download:
    """A file to take away as it stands.

    Args:
        path: the file.
        name: that it is taken away as.
        opened: opens it to be read up to the size that it has now.
    """
    stat = path.stat()
    tag = f"{stat.st_ino}-{stat.st_mtime_ns}-{stat.st_size}"
    opening = partial(opened, path, stat.st_size)
    return Download(name, stat.st_size, stat.st_mtime, tag, corrected=False, open=opening)


def _own(folder: Path) -> list[Path]:
    return [] if read_outcome(folder) is None else [folder / NAME]


def jumps_of(log: Path) -> tuple[LastJump, ...]:
    """The main figures of the jumps that were measured in a log; none if it was not measured."""
    found = read_outcome(measured_path(log))
    return () if found is None else found.jumps


def failed_by(log: Path) -> str | None:
    """By which content of survey or poses a log could not be measured; None if that was not the reason."""
    found = read_outcome(measured_path(log))
    return None if found is None else found.source


def _files(folder: Path) -> list[Path]:
    """The files for people and programs; links are none of them."""
    try:
        with opened_folder(folder):
            return [each for each in folder.iterdir() if each.name != NAME and not each.is_symlink() and each.is_file()]
    except OSError:
        return []
