"""A finding of the doctor: PASS, WARN or FAIL, what was found, and what to do about it."""

from dataclasses import dataclass, field
from enum import StrEnum

from rig.phrase import Phrase, Value


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
        code: stable name by which the panel translates both texts.
        what: what was found, one line in English.
        remedy: what to do about it, in English; empty if the level is PASS, and only then.
        values: names and numbers in both texts, for translation.
    """

    level: Level
    topic: Topic
    code: str
    what: str
    remedy: str = ""
    values: dict[str, Value] = field(default_factory=dict)


# Below, `code` is written out in the call, so that a test finds it; `what` and `remedy` are templates as for
# `rig.phrase.phrase`, filled in with `values`.


def passed(topic: Topic, code: str, what: str, /, **values: Value) -> Finding:
    """A finding that all is well."""
    return Finding(Level.PASS, topic, code, what.format(**values), values=values)


def warning(topic: Topic, code: str, what: str, remedy: str, /, **values: Value) -> Finding:
    """A finding that recording works, but something may be lost or slow."""
    return _advising(Level.WARN, topic, code, what, remedy, values)


def failure(topic: Topic, code: str, what: str, remedy: str, /, **values: Value) -> Finding:
    """A finding that recording will not work."""
    return _advising(Level.FAIL, topic, code, what, remedy, values)


def judged(level: Level, topic: Topic, said: Phrase, remedy: str) -> Finding:
    """A finding whose sentence is the same at every level.

    Args:
        level: verdict.
        topic: what the finding is about.
        said: what was found.
        remedy: what to do about it, left out if the level is PASS.
    """
    return Finding(level, topic, said.code, said.text, "" if level is Level.PASS else remedy, said.values)


def _advising(level: Level, topic: Topic, code: str, what: str, remedy: str, values: dict[str, Value]) -> Finding:
    return Finding(level, topic, code, what.format(**values), remedy.format(**values), values)
