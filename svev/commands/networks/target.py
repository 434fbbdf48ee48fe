"""`svev target`: targets to print, for calibrating cameras."""

import json
from pathlib import Path
from typing import Annotated

import typer

from analysis.targets.pattern import FIRST_CIRCLES, FIRST_SINGLE, MOST_SINGLE, Layout
from analysis.targets.pdf import pdf
from analysis.targets.sheets import board_geometry, board_page, frame_geometry, target_pages
from svev import console
from svev.commands.networks.layout import BoardOption, SquareOption, TargetOption, columns_and_rows
from svev.overwriting import ForceOption, refuse_existing

_PRINT = (
    "print at 100 % (not to fit the page), measure the line at the foot of each page, glue the board to a flat plate"
)


def target(
    out: Annotated[
        Path,
        typer.Option(
            "-o",
            "--out",
            metavar="DIR",
            help="folder for board.pdf, targets.pdf, circles.pdf, board.json and targets.json",
        ),
    ],
    board: BoardOption = "9x6",
    square_mm: SquareOption = 30.0,
    target_mm: TargetOption = 80.0,
    targets: Annotated[
        int,
        typer.Option("--targets", metavar="N", min=1, max=MOST_SINGLE, help="how many single targets of each kind"),
    ] = 24,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Make targets to print, as PDF of exact size: a ChArUco board, and single coded targets for a frame in space.

    Single targets are of two kinds: targets.pdf has corners to be measured, circles.pdf centres of circles.

    Exit codes: 0 done, 2 bad input.

    Example: svev target -o targets
    """
    columns, rows = columns_and_rows(board)
    layout = Layout(columns, rows, square_mm, target_mm)
    files = {"board.pdf": [board_page(layout)]}
    for name, first in (("targets.pdf", FIRST_SINGLE), ("circles.pdf", FIRST_CIRCLES)):
        files[name] = target_pages(layout, range(first, first + targets))
    drawn = {"board.json": board_geometry(layout), "targets.json": frame_geometry(layout)}
    refuse_existing(*(out / name for name in (*files, *drawn)), force=force)
    out.mkdir(parents=True, exist_ok=True)
    for name, pages in files.items():
        (out / name).write_bytes(pdf(pages))
    for name, geometry in drawn.items():
        (out / name).write_text(json.dumps(geometry) + "\n", encoding="utf-8")
    counts = {name: len(pages) for name, pages in files.items()}
    if as_json:
        console.print_json({"folder": str(out), "pages": counts})
        return
    for name, count in counts.items():
        console.say(f"{out / name}: {count} {'page' if count == 1 else 'pages'}")
    console.say(_PRINT)
