"""Keeps what came of the measuring of a log: a folder beside the log, whole or absent."""

import os
import shutil
from collections.abc import Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Final

from recorder.log.beside import measured_path
from rig.api.jump import LastJump
from rig.api.measuring import AfterStep
from rig.api.statement import Statement
from rig.host.disk import sync
from service.measuring.outcome import Outcome, read_outcome, write_outcome

_NOTHING: Final[Mapping[str, str]] = {}
_VERSION: Final = version("svev")


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
    write_outcome(_outcome(jumps, names), made)
    for path in (*made.iterdir(), made):
        sync(path)
    target, old = measured_path(log), made.with_name(f"{made.name}.old")
    if os.path.lexists(target):
        target.rename(old)
    made.rename(target)
    sync(target.parent)
    _remove(old)


def keep_own_result(log: Path, jumps: tuple[LastJump, ...], names: Mapping[str, str]) -> None:
    """Note the summary of a result that `svev analyze` has written beside a log, as for results of the service.

    Args:
        log: the log.
        jumps: main figures.
        names: the corrections of the session, as `names_of` gave them before.

    Raises:
        OSError: the disk refuses.
    """
    folder = measured_path(log)
    write_outcome(_outcome(jumps, names), folder)
    os.utime(folder)  # whoever watches the folder of the logs is told, which does not hold of what changes in this one


def _outcome(jumps: tuple[LastJump, ...], names: Mapping[str, str]) -> Outcome:
    return Outcome(measured=datetime.now(UTC), version=_VERSION, jumps=jumps, names=dict(names))


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
    if (found := read_outcome(folder)) is not None:
        write_outcome(found.model_copy(update={"names": dict(names)}), folder)


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
    before = read_outcome(folder)
    write_outcome(
        Outcome(
            measured=datetime.now(UTC) if before is None or not before.jumps else before.measured,
            version=_VERSION,
            jumps=() if before is None else before.jumps,
            problem=problem,
            source=source,
            names={} if before is None else before.names,
        ),
        folder,
    )


def note_source(log: Path, source: str) -> None:
    """Note by which content of survey or poses a log is measured next, that could not be by another one.

    Raises:
        OSError: the disk refuses.
    """
    folder = measured_path(log)
    if (found := read_outcome(folder)) is not None:
        write_outcome(found.model_copy(update={"source": source}), folder)


def keep_step(log: Path, step: AfterStep, problem: Statement | None) -> None:
    """Note that a log was measured, and the result of a step afterwards.

    Raises:
        OSError: the disk refuses.
    """
    folder = measured_path(log)
    before = read_outcome(folder)
    if before is not None:
        others = tuple(each for each in before.further if each[0] is not step)
        write_outcome(before.model_copy(update={"further": (*others, (step, problem))}), folder)


def _remove(path: Path) -> None:
    if path.is_symlink():
        path.unlink()
    else:
        shutil.rmtree(path, ignore_errors=True)
