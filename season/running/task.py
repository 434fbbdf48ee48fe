"""The task that a worker does: it measures one log and writes the result whole beside it."""

import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import msgspec

from analysis.cameras.source import Source, read_source
from analysis.procedure.analyze import analyze
from analysis.procedure.result_folder import write_folder
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from rig.errors import StorageError, SvevError
from rig.host.object_store import Options
from season.rows import write_rows
from season.running.logs import SeasonLog
from season.running.outcome import LogState, Orienting, Outcome, decoded, encoded, key_of, sha256_of
from season.running.stores import OUTCOME, at_hand, new_result, read_outcomes, replace_outcome


class _Clock:
    """When a task began, and how much of it was analysis."""

    def __init__(self) -> None:
        self._began = time.perf_counter()
        self.started = datetime.now(UTC).isoformat(timespec="seconds")
        self.analysis_s = 0.0

    @property
    def duration_s(self) -> float:
        return round(time.perf_counter() - self._began, 3)

    @contextmanager
    def analysis(self) -> Iterator[None]:
        before = time.perf_counter()
        try:
            yield
        finally:
            self.analysis_s = round(time.perf_counter() - before, 3)


def measure(log: SeasonLog, options: Options) -> str:
    """Measure a log, and write its result beside it.

    A log that cannot be measured gets a result that says why. A result of the same log under another stamp, as after
    the log was copied, gets the new stamp alone.

    Args:
        log: the log.
        options: of its store.

    Returns:
        The key of the result.

    Raises:
        OSError, StorageError: the log cannot be read here, or its result not be written.
    """
    clock = _Clock()
    with at_hand(log.url, options) as path:
        digest = sha256_of(path)
        key = key_of(digest, log.orienting.recipe)
        before = decoded(read_outcomes([log.url], options)[0])
        if before is not None and before.key == key and before.state is LogState.DONE:
            restamped = msgspec.structs.replace(before, stamp=log.entry.stamp)
            replace_outcome(log.url, encoded(restamped), options)
            return key
        with new_result(log.url, options) as folder:
            jumps, problem = _measured(path, key, log.orienting, folder, clock)
            outcome = _outcome(log, clock, key=key, digest=digest, jumps=jumps, problem=problem)
            (folder / OUTCOME).write_bytes(encoded(outcome))
    return key


def give_up(log: SeasonLog, options: Options, problem: str, duration_s: float) -> Outcome:
    """Write beside a log why it is not measured, where no worker could.

    Raises:
        OSError: the result cannot be written.
    """
    outcome = _outcome(log, _Clock(), key="", digest="", jumps=0, problem=problem)
    outcome = msgspec.structs.replace(outcome, duration_s=duration_s)
    with new_result(log.url, options) as folder:
        (folder / OUTCOME).write_bytes(encoded(outcome))
    return outcome


def _measured(log: Path, key: str, orienting: Orienting, folder: Path, clock: _Clock) -> tuple[int, str | None]:
    """Write the files of a measured log.

    Returns:
        How many jumps there are, and why it cannot be measured.
    """
    cv2.setNumThreads(1)  # as many workers as cores: threads beside them would only wait for each other
    try:
        with clock.analysis():
            found = analyze(log, _source(orienting))
            write_folder(found, log, folder, progress=None)
        write_rows(key, found, folder)
    except StorageError:
        raise
    except (SvevError, NotSolvableError, NotConvergedError) as error:
        for path in folder.iterdir():
            path.unlink()
        return 0, str(error).replace(f"{log}: ", "")
    return len(found.result.jumps), None


def _outcome(log: SeasonLog, clock: _Clock, *, key: str, digest: str, jumps: int, problem: str | None) -> Outcome:
    return Outcome(
        key=key,
        recipe=log.orienting.recipe,
        log_sha256=digest,
        stamp=log.entry.stamp,
        state=LogState.DONE if problem is None else LogState.FAILED,
        problem=problem,
        jumps=jumps,
        started=clock.started,
        duration_s=clock.duration_s,
        analysis_s=clock.analysis_s,
        host=socket.gethostname(),
    )


@lru_cache(maxsize=4)
def _source(orienting: Orienting) -> Source:
    """What orients the cameras, from its content: the file itself may be on another computer."""
    with TemporaryDirectory(prefix="svev-season-") as folder:
        path = Path(folder) / orienting.name
        path.write_bytes(orienting.content)
        is_survey = orienting.kind == "survey"
        return read_source(path if is_survey else None, None if is_survey else path)
