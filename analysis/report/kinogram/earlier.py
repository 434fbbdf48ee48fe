"""`kinogram.json` (`svev-kinogram/1`): the figures of a jump in plain form, and earlier ones of the same athlete."""

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Annotated, Final, Literal

import msgspec
from msgspec import Meta, Struct

from analysis.result.model import Quantity
from rig.errors import BadInputError
from rig.host.files import TEXT_MAX, read_whole

#: Name of the file in a folder of results.
NAME: Final = "kinogram.json"
FORMAT: Final = "svev-kinogram/1"


@dataclass(frozen=True, slots=True, eq=False)
class EarlierJump:
    """A jump that was measured before.

    Attributes:
        recording: its recording.
        athlete: who jumped, as the session said when it was measured.
        time: take-off, or first pulse where that was not found.
        ok: whether it can be trusted.
        figures: by the names of `analysis.report.kinogram.figures`; those that were measured.
    """

    recording: str
    athlete: str
    time: datetime
    ok: bool
    figures: Mapping[str, Quantity]


class _Value(Struct):
    value: float
    sigma: Annotated[float, Meta(ge=0.0)]


class _Jump(Struct):
    time: datetime
    ok: bool
    figures: dict[str, _Value | None]


class _File(Struct):
    format: Literal["svev-kinogram/1"]
    recording: str
    jumps: list[_Jump]
    athlete: str = ""


def read_earlier(path: Path) -> list[EarlierJump]:
    """The jumps of a `kinogram.json`, or of the one in a folder of results.

    Raises:
        BadInputError: it is missing, unreadable, too large, or holds something else.
    """
    path = path / NAME if path.is_dir() else path
    try:
        content = read_whole(path, TEXT_MAX, links=False)
    except FileNotFoundError:
        raise BadInputError(f"{path}: no such file; name a folder that svev analyze wrote") from None
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
    try:
        found = msgspec.json.decode(content, type=_File)
    except (msgspec.MsgspecError, UnicodeDecodeError) as error:
        raise BadInputError(f"{path}: {error}; name a {FORMAT} file as svev analyze writes it") from None
    return [
        EarlierJump(
            found.recording,
            found.athlete,
            jump.time,
            jump.ok,
            {name: Quantity(q.value, q.sigma) for name, q in jump.figures.items() if q is not None},
        )
        for jump in found.jumps
    ]
