"""The outcome of a log: a small file in the folder of its result, which shows that the log was measured already."""

import hashlib
from dataclasses import dataclass
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import Final

import msgspec

from analysis.cameras.source import read_source
from rig.errors import BadInputError
from season.campaign import Source

FORMAT: Final = "svev-season-log/1"
VERSION: Final = version("svev")


class LogState(StrEnum):
    """How far a log is."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"


class Outcome(msgspec.Struct, frozen=True, kw_only=True):
    """What came of a log.

    Attributes:
        format: `FORMAT`.
        key: identifies the result by its content: the log, survey or poses, the version of svev.
        recipe: the key without the log.
        log_sha256: of the whole log; empty if it could not be read.
        stamp: of the log when it was read (`season.running.stores.Entry`).
        state: done or failed.
        problem: why it failed; None if it is done.
        jumps: measured jumps.
        started: UTC, ISO 8601.
        duration_s: of reading, measuring and writing.
        analysis_s: of that, the measuring and writing of what `svev analyze` writes.
        host: name of the computer.
    """

    format: str = FORMAT
    key: str
    recipe: str
    log_sha256: str
    stamp: str
    state: LogState
    problem: str | None = None
    jumps: int = 0
    started: str
    duration_s: float
    analysis_s: float = 0.0
    host: str


@dataclass(frozen=True, slots=True)
class Orienting:
    """What orients the cameras of logs, by its content: it travels to the workers, which need not see the file.

    Attributes:
        kind: "survey" or "calibration".
        name: of the file, for messages.
        content: of the file.
        recipe: identifies how a log is measured: this content, and the version of svev.
    """

    kind: str
    name: str
    content: bytes
    recipe: str


def read_orienting(source: Source) -> Orienting:
    """Read the file of a survey or of poses.

    Raises:
        BadInputError: it cannot be read, or is none.
    """
    path = source.survey or source.calibration or Path()
    kind = "survey" if source.survey is not None else "calibration"
    read_source(source.survey, source.calibration)
    content = path.read_bytes()
    recipe = hashlib.sha256(b"\0".join((VERSION.encode(), kind.encode(), content))).hexdigest()
    return Orienting(kind, path.name, content, recipe)


def key_of(log_sha256: str, recipe: str) -> str:
    """The key of a result."""
    return hashlib.sha256(f"{log_sha256} {recipe}".encode()).hexdigest()


def decoded(content: bytes | None) -> Outcome | None:
    """An outcome read from its file; None without a file, or if another program wrote it."""
    if content is None:
        return None
    try:
        found = msgspec.json.decode(content, type=Outcome)
    except (msgspec.DecodeError, msgspec.ValidationError):
        return None
    return found if found.format == FORMAT else None


def encoded(outcome: Outcome) -> bytes:
    """The content of an outcome's file."""
    return msgspec.json.encode(outcome) + b"\n"


def sha256_of(path: Path) -> str:
    """Of a whole file.

    Raises:
        BadInputError: it cannot be read.
    """
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
