"""One finding of the doctor."""

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """How bad it is."""

    PASS = "PASS"  # noqa: S105 - a verdict
    WARN = "WARN"  #: recording works, but something may be lost or slow
    FAIL = "FAIL"  #: recording will not work


class Topic(StrEnum):
    """What a finding is about; also the order in which findings are shown."""

    SOFTWARE = "software"
    MEMORY = "memory"
    DISK = "disk"
    NETWORK = "network"
    CAMERAS = "cameras"
    TIME = "time"
    PROCESSOR = "processor"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at.

    Attributes:
        level: how bad it is.
        topic: what it is about.
        what: what was found, one line.
        remedy: what to do about it; empty exactly when the level is PASS.
    """

    level: Level
    topic: Topic
    what: str
    remedy: str = ""


def passed(topic: Topic, what: str) -> Finding:
    """All is well."""
    return Finding(Level.PASS, topic, what)


def warning(topic: Topic, what: str, remedy: str) -> Finding:
    """Recording works, but something may be lost or slow."""
    return Finding(Level.WARN, topic, what, remedy)


def failure(topic: Topic, what: str, remedy: str) -> Finding:
    """Recording will not work."""
    return Finding(Level.FAIL, topic, what, remedy)
