"""A finding of the doctor: PASS, WARN or FAIL, what was found, and what to do about it."""

from dataclasses import dataclass
from enum import StrEnum


class Level(StrEnum):
    """Verdict of a finding."""

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
    """One finding.

    Attributes:
        level: verdict.
        topic: what the finding is about.
        what: what was found, one line.
        remedy: what to do about it; empty if the level is PASS, and only then.
    """

    level: Level
    topic: Topic
    what: str
    remedy: str = ""


def passed(topic: Topic, what: str) -> Finding:
    """A finding that all is well."""
    return Finding(Level.PASS, topic, what)


def warning(topic: Topic, what: str, remedy: str) -> Finding:
    """A finding that recording works, but something may be lost or slow."""
    return Finding(Level.WARN, topic, what, remedy)


def failure(topic: Topic, what: str, remedy: str) -> Finding:
    """A finding that recording will not work."""
    return Finding(Level.FAIL, topic, what, remedy)
