"""What was measured in a log after its end: a folder beside the log, whole or absent."""

import json
import os
import shutil
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, BinaryIO, Final

from pydantic import Field, ValidationError

from analysis.result.naming import bears_names
from recorder.log.measured_path import measured_path
from recorder.log.session_changes import session_changes
from rig.api.fields import Model
from rig.api.jump import LastJump
from rig.api.measuring import AfterStep, Measurement, MeasuringState, StepState
from rig.api.recordings import SessionFields
from rig.api.statement import Statement
from rig.errors import BadInputError, StateForbidsError
from rig.host.disk import replace_file, sync
from rig.host.files import TEXT_MAX, open_to_read, opened_folder, read_whole
from service.seam.archive import Download

_NAME: Final = "measurement.json"
_JUMPER: Final = "jumper.json"
_NOTHING: Final[Mapping[str, str]] = {}
#: MP4, which every phone plays.
VIDEO: Final = "overlay.mp4"
_VERSION: Final = version("svev")


class _Outcome(Model):
    """What the measuring of a log came to; in the folder beside the files of the analysis.

    Attributes:
        measured: when, UTC.
        version: of svev.
        jumps: main figures of the jumps of the result that lies in the folder.
        problem: why the last attempt failed; the result, if there is one, is of an attempt before.
        source: by which content of survey or poses the last attempt failed, as `service.measuring.retries` marks it;
            None if it failed for another reason, or did not.
        further: what was tried with the log afterwards, and why it failed.
        names: the corrections of the session that stand in those files of the result that say whose jump it is.
    """

    measured: datetime
    version: str
    jumps: tuple[LastJump, ...] = ()
    problem: Statement | None = None
    source: str | None = None
    further: tuple[tuple[AfterStep, Statement | None], ...] = ()
    names: dict[str, str] = Field(default_factory=dict)


def measurement_of(recording: str, log: Path) -> Measurement:
    """What was measured in a log; state `NONE` if that was never tried, or its outcome cannot be read."""
    folder = measured_path(log)
    found = _outcome(folder)
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
    found = _outcome(measured_path(log))
    return found is not None and _is_outdated(found, log)


def names_of(log: Path) -> dict[str, str]:
    """The corrections of what those files say: name, bib, gate, wind, notes, operator."""
    try:
        changes = session_changes(log)
    except BadInputError:
        return {}  # the catalogue says so
    return {field: text for field, text in changes.items() if field in SessionFields.model_fields}


def _is_outdated(found: _Outcome, log: Path) -> bool:
    return bool(found.jumps) and found.names != names_of(log)


def jumps_in_full(log: Path) -> tuple[dict[str, Any], ...]:
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
        raise StateForbidsError(f"{log.name}: {_JUMPER} of its result cannot be read: measure it again") from error


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
    return [] if _outcome(folder) is None else [folder / _NAME]


def outcome_path(log: Path) -> Path:
    """Where stands what the measuring of a log came to; the file is replaced as a whole."""
    return measured_path(log) / _NAME


def jumps_of(log: Path) -> tuple[LastJump, ...]:
    """The main figures of the jumps that were measured in a log; none if it was not measured."""
    found = _outcome(measured_path(log))
    return () if found is None else found.jumps


def keep_result(made: Path, log: Path, jumps: tuple[LastJump, ...], names: Mapping[str, str] = _NOTHING) -> None:
    """Put a folder with the files of a result beside its log, in place of an earlier one.

    Args:
        made: the folder, on the same disk; it is gone afterwards.
        log: the log.
        jumps: main figures.
        names: the corrections of the session, as `names_of` gave them before.

    Raises:
        OSError: the disk refuses.
    """
    outcome = _Outcome(measured=datetime.now(UTC), version=_VERSION, jumps=jumps, names=dict(names))
    _write(outcome, made)
    for path in made.iterdir():
        sync(path)
    target, old = measured_path(log), made.with_name(f"{made.name}.old")
    if os.path.lexists(target):
        target.rename(old)
    made.rename(target)
    sync(target.parent)
    _remove(old)


def keep_renamed(made: Path, log: Path, names: Mapping[str, str]) -> None:
    """Put files with the corrected session into the result of a log, and note that they are there, last of all.

    Args:
        made: folder with the files, on the same disk.
        log: the log.
        names: the corrections.

    Raises:
        OSError: the disk refuses.
    """
    folder = measured_path(log)
    for path in made.iterdir():
        sync(path)
        path.replace(folder / path.name)
    sync(folder)
    if (found := _outcome(folder)) is not None:
        _write(found.model_copy(update={"names": dict(names)}), folder)


def keep_file(made: Path, log: Path, name: str) -> None:
    """Put a file into the result of a log, in place of one of this name.

    Raises:
        OSError: the disk refuses.
    """
    sync(made)
    made.replace(measured_path(log) / name)
    sync(measured_path(log))


def keep_problem(log: Path, problem: Statement, source: str | None = None) -> None:
    """Note why a log could not be measured; a result that is there stays.

    Args:
        log: the log.
        problem: why.
        source: the content of survey or poses that kept it from being measured; None: something else did.

    Raises:
        OSError: the disk refuses.
    """
    folder = measured_path(log)
    folder.mkdir(exist_ok=True)
    before = _outcome(folder)
    _write(
        _Outcome(
            measured=datetime.now(UTC) if before is None or not before.jumps else before.measured,
            version=_VERSION,
            jumps=() if before is None else before.jumps,
            problem=problem,
            source=source,
            names={} if before is None else before.names,
        ),
        folder,
    )


def failed_by(log: Path) -> str | None:
    """By which content of survey or poses a log could not be measured; None if that was not the reason."""
    found = _outcome(measured_path(log))
    return None if found is None else found.source


def note_source(log: Path, source: str) -> None:
    """Note by which content of survey or poses a log is measured next, that could not be by another one.

    Raises:
        OSError: the disk refuses.
    """
    folder = measured_path(log)
    if (found := _outcome(folder)) is not None:
        _write(found.model_copy(update={"source": source}), folder)


def keep_step(log: Path, step: AfterStep, problem: Statement | None) -> None:
    """Note that a log was measured, and what came of a step after that.

    Raises:
        OSError: the disk refuses.
    """
    folder = measured_path(log)
    before = _outcome(folder)
    if before is not None:
        others = tuple(each for each in before.further if each[0] is not step)
        _write(before.model_copy(update={"further": (*others, (step, problem))}), folder)


def _write(outcome: _Outcome, folder: Path) -> None:
    replace_file(folder / _NAME, (outcome.model_dump_json() + "\n").encode(), links=False)


def _outcome(folder: Path) -> _Outcome | None:
    try:
        with opened_folder(folder):
            return _Outcome.model_validate(json.loads(read_whole(folder / _NAME, TEXT_MAX, links=False)))
    except (OSError, ValueError, ValidationError):
        return None


def _files(folder: Path) -> list[Path]:
    """The files for people and programs; links are none of them."""
    try:
        with opened_folder(folder):
            return [
                each for each in folder.iterdir() if each.name != _NAME and not each.is_symlink() and each.is_file()
            ]
    except OSError:
        return []


def _remove(path: Path) -> None:
    if path.is_symlink():
        path.unlink()
    else:
        shutil.rmtree(path, ignore_errors=True)
