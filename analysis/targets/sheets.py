"""Sheets of targets to print: a ChArUco board, and single targets to cut out, each page with a line to measure."""

from collections.abc import Iterator, Sequence
from typing import Any, Final, TypeAlias

from analysis.targets.pattern import (
    BAR,
    CORNERS,
    CUT,
    DISC,
    FIELDS,
    FIRST_CIRCLES,
    FIRST_SINGLE,
    LAST_SINGLE,
    MARKER,
    MOST_SINGLE,
    Layout,
    marker,
)
from analysis.targets.pdf import Page
from rig.errors import BadInputError

_Box: TypeAlias = tuple[float, float, float, float]  # x, y, width, height, mm
_A4: Final = (210.0, 297.0)
_MARGIN: Final = 8.0  # that printers leave, mm
_FOOT: Final = 14.0  # for the check line, mm
_CHECK: Final = 150.0  # length of the check line, mm
_FOOT_WORDS: Final = (
    "mm between the marks: measure it. If it is longer or shorter, print at 100 %, not to fit the page."
)


def board_page(layout: Layout) -> Page:
    """The board, on A4 if it fits, otherwise on a page of its own size."""
    width, height = layout.columns * layout.board_mm, layout.rows * layout.board_mm
    page = _page(width, height)
    left, top = (page.width - width) / 2.0, (page.height - _FOOT - height) / 2.0
    for x, y, across, down in _board(layout):
        page.box(left + x, top + y, across, down)
    _foot(page, f"ChArUco {layout.columns} x {layout.rows}, squares {layout.board_mm:g} mm, DICT_5X5_250")
    return page


def board_geometry(layout: Layout) -> dict[str, Any]:
    """What is black on the board, for programs that draw it: `svev-board/1`; lengths in mm."""
    board = {
        "width_mm": layout.columns * layout.board_mm,
        "height_mm": layout.rows * layout.board_mm,
        "cell_mm": layout.board_mm * MARKER / FIELDS / 2.0,
        "margin_mm": layout.board_mm / 2.0,
        "black": [[round(part, 6) for part in box] for box in _board(layout)],
    }
    return {"format": "svev-board/1", "columns": layout.columns, "rows": layout.rows, "board": board}


def _board(layout: Layout) -> Iterator[_Box]:
    """The black boxes of the board, from its upper left corner."""
    side = layout.board_mm
    for y in range(layout.rows):
        for x in range(layout.columns):
            if (x + y) % 2 == 0:
                yield x * side, y * side, side, side
    for code, (x, y) in layout.squares.items():
        yield from _marker(code, (x + 0.5) * side, (y + 0.5) * side, side)


def target_pages(layout: Layout, codes: Sequence[int]) -> list[Page]:
    """Single targets, as many on a page as fit on A4, otherwise each on a page of its own size.

    Raises:
        BadInputError: there are not so many codes.
    """
    if not codes or min(codes) < FIRST_SINGLE or max(codes) > LAST_SINGLE:
        raise BadInputError(f"there are 1 to {MOST_SINGLE} single targets of a kind; ask for so many")
    side = 2.0 * CUT * layout.single_mm
    inside = _page(side, side)
    columns = max(1, int((inside.width - 2.0 * _MARGIN) // side))
    rows = max(1, int((inside.height - _MARGIN - _FOOT) // side))
    pages = []
    for begin in range(0, len(codes), columns * rows):
        some = codes[begin : begin + columns * rows]
        page = _page(columns * side, rows * side)
        left, top = (page.width - columns * side) / 2.0, (page.height - _FOOT - rows * side) / 2.0
        for i, code in enumerate(some):
            row, column = divmod(i, columns)
            _single(page, code, left + (column + 0.5) * side, top + (row + 0.5) * side, layout.single_mm)
        round_ones = f" with circles, {2.0 * DISC * layout.single_mm:g} mm wide" if some[0] >= FIRST_CIRCLES else ""
        _foot(page, f"targets{round_ones}, white squares {layout.single_mm:g} mm, DICT_5X5_250")
        pages.append(page)
    return pages


def _page(width: float, height: float) -> Page:
    """A page on which this fits: A4 upright, A4 across, or one of its own size."""
    for page in (_A4, _A4[::-1]):
        if width <= page[0] - 2.0 * _MARGIN and height <= page[1] - _MARGIN - _FOOT:
            return Page(*page)
    return Page(max(width + 2.0 * _MARGIN, _CHECK + 2.0 * _MARGIN), height + _MARGIN + _FOOT)


def _marker(code: int, x: float, y: float, side: float) -> Iterator[_Box]:
    """A marker about a place, in a white square with this side; neighbouring black fields of a row are one box."""
    field = side * MARKER / FIELDS
    left, top = x - FIELDS * field / 2.0, y - FIELDS * field / 2.0
    for row, fields in enumerate(marker(code)):
        begin = None
        for column, black in enumerate((*fields.tolist(), False)):
            if black and begin is None:
                begin = column
            elif not black and begin is not None:
                yield left + begin * field, top + row * field, (column - begin) * field, field
                begin = None


def _single(page: Page, code: int, x: float, y: float, side: float) -> None:
    half, depth, cut = side / 2.0, side * BAR, side * CUT
    if code >= FIRST_CIRCLES:
        for across, down in CORNERS:
            page.disc(x + across * side, y + down * side, DISC * side)
    else:
        page.box(x - half, y - half - depth, side, depth)
        page.box(x - half, y + half, side, depth)
        page.box(x - half - depth, y - half, depth, side)
        page.box(x + half, y - half, depth, side)
    for box in _marker(code, x, y, side):
        page.box(*box)
    page.text(x - cut + 0.02 * side, y + cut - 0.03 * side, f"{code}", 0.05 * side)
    for along in (-cut, cut):
        page.line(x - cut, y + along, x + cut, y + along, 0.1)
        page.line(x + along, y - cut, x + along, y + cut, 0.1)


def _foot(page: Page, words: str) -> None:
    """The line to measure, and what the page is."""
    y = page.height - _FOOT + 3.0
    left = (page.width - _CHECK) / 2.0
    page.line(left, y, left + _CHECK, y)
    for end in (left, left + _CHECK):
        page.line(end, y - 2.0, end, y + 2.0)
    page.text(left + 2.0, y + 3.2, f"{_CHECK:g} {_FOOT_WORDS}", 2.6)
    page.text(left + 2.0, y + 6.4, f"{words}. svev target", 2.6)
