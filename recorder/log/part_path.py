"""Where the parts of a split recording lie: beside each other, `NAME`, `NAME-part2`, ..."""

import re
from pathlib import Path
from typing import Final

_NAMED: Final = re.compile(r"(?P<first>.+)-part(?P<number>[1-9]\d{0,5})", re.ASCII)


def numbered(log: Path) -> tuple[str, int]:
    """Name of the first log of a recording by that of one of its logs, and the number in it; 1: it is the first one."""
    named = _NAMED.fullmatch(log.stem)
    return (log.stem, 1) if named is None else (named["first"], int(named["number"]))


def named(first: str, number: int, like: Path) -> Path:
    """The log of this number, beside another one."""
    return like.with_name(f"{first}{f'-part{number}' if number > 1 else ''}{like.suffix}")
