"""What stands beside a log: what was measured in it, survey and truth of simulated cameras, its other parts.

The recorder writes the other parts alone, `NAME`, `NAME-part2`, ...; it neither writes nor reads the rest.
"""

import re
from pathlib import Path
from typing import Final

_NAMED: Final = re.compile(r"(?P<first>.+)-part(?P<number>[1-9]\d{0,5})", re.ASCII)


def digitized_path(log: Path) -> Path:
    """Path of the folder with the marks of all operators who measured by hand."""
    return log.with_suffix(".digitized")


def jumper_path(log: Path) -> Path:
    """Path of the file with the jumps of a log that were measured live."""
    return log.with_suffix(".jumper.json")


def measured_path(log: Path) -> Path:
    """Path of the folder with the results of a log that was measured when it was closed."""
    return log.with_suffix(".measured")


def survey_path(log: Path) -> Path:
    """Path of the file with the survey of the balls and the interior orientations, as `svev analyze` takes it."""
    return log.with_suffix(".survey.json")


def truth_path(log: Path) -> Path:
    """Path of the file with the truth of a log."""
    return log.with_suffix(".truth.json")


def numbered(log: Path) -> tuple[str, int]:
    """Name of the first log of a recording by that of one of its logs, and the number in it; 1: it is the first one."""
    named = _NAMED.fullmatch(log.stem)
    return (log.stem, 1) if named is None else (named["first"], int(named["number"]))


def named(first: str, number: int, like: Path) -> Path:
    """The log of this number, beside another one."""
    return like.with_name(f"{first}{f'-part{number}' if number > 1 else ''}{like.suffix}")
