"""Options that say which targets were printed, the same for `svev target` and `svev calibrate --pictures`."""

import re
from typing import Annotated

import typer

from rig.errors import BadInputError

BoardOption = Annotated[str, typer.Option("--board", metavar="COLUMNSxROWS", help="squares of the board")]
SquareOption = Annotated[
    float, typer.Option("--square-mm", metavar="MM", min=1.0, max=1000.0, help="side of the board's squares")
]
TargetOption = Annotated[
    float, typer.Option("--target-mm", metavar="MM", min=1.0, max=1000.0, help="side of a single target's white square")
]


def columns_and_rows(words: str) -> tuple[int, int]:
    """The squares of a board, such as 9x6.

    Raises:
        BadInputError: something else.
    """
    found = re.fullmatch(r"(\d{1,3})[xX](\d{1,3})", words)
    if found is None:
        raise BadInputError(f"--board {words}: write how many squares it has across and down, for instance 9x6")
    return int(found[1]), int(found[2])
