"""Sheets of targets to print: a ChArUco board, and single targets to cut out, each page with a line to measure."""

from collections.abc import Iterable, Iterator, Sequence
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
#: Targets along a side of the frame that is drawn, how far apart they are, and between depths, in their sides.
FRAME_SIDE: Final = 4
_FRAME_STEP: Final = 2.6
_FRAME_DEPTH: Final = 0.3
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
    """What is black on the board, for programs that draw it: `svev-board/2`, one sheet; lengths in mm."""
    size = layout.columns * layout.board_mm, layout.rows * layout.board_mm
    sheet = _sheet(size, layout.board_mm, layout.board_mm / 2.0, _board(layout))
    return {"format": "svev-board/2", "sheets": [sheet]}


def frame_geometry(layout: Layout) -> dict[str, Any]:
    """Single targets on a frame with some depth, for programs that draw it: `svev-board/2`, a sheet for each target.

    They are in a square, at four depths, each turned a little; no one hides another from views of 35 degrees.
    """
    side, depth = layout.single_mm, layout.single_mm * BAR
    span, sheets = side + 2.0 * depth, []
    for n in range(FRAME_SIDE**2):
        row, column = divmod(n, FRAME_SIDE)
        across, down = ((place - (FRAME_SIDE - 1) / 2.0) * _FRAME_STEP * side for place in (column, row))
        boxes = _single_boxes(FIRST_SINGLE + n, span / 2.0, span / 2.0, side)
        sheets.append(
            _sheet((span, span), side, side * (CUT - 0.5 - BAR), boxes)
            | {
                "middle_mm": [round(across, 6), round(-down, 6), round(-_FRAME_DEPTH * side * (n * 7 % 4), 6)],
                "turn_deg": 10.0 * (n % 3 - 1),
                "tilt_deg": 6.0 * (n % 5 - 2),
                "roll_deg": 9.0 * (n * 7 % 5 - 2),
            }
        )
    return {"format": "svev-board/2", "sheets": sheets}


def _sheet(size: tuple[float, float], side: float, margin: float, black: Iterable[_Box]) -> dict[str, Any]:
    return {
        "width_mm": round(size[0], 6),
        "height_mm": round(size[1], 6),
        "cell_mm": round(side * MARKER / FIELDS / 2.0, 6),
        "margin_mm": round(margin, 6),
        "black": [[round(part, 6) for part in box] for box in black],
    }


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
    cut = side * CUT
    if code >= FIRST_CIRCLES:
        for across, down in CORNERS:
            page.disc(x + across * side, y + down * side, DISC * side)
    for box in _single_boxes(code, x, y, side):
        page.box(*box)
    page.text(x - cut + 0.02 * side, y + cut - 0.03 * side, f"{code}", 0.05 * side)
    for along in (-cut, cut):
        page.line(x - cut, y + along, x + cut, y + along, 0.1)
        page.line(x + along, y - cut, x + along, y + cut, 0.1)


def _single_boxes(code: int, x: float, y: float, side: float) -> Iterator[_Box]:
    """The black boxes of a single target about a place."""
    half, depth = side / 2.0, side * BAR
    if code < FIRST_CIRCLES:
        yield x - half, y - half - depth, side, depth
        yield x - half, y + half, side, depth
        yield x - half - depth, y - half, depth, side
        yield x + half, y - half, depth, side
    yield from _marker(code, x, y, side)


def _foot(page: Page, words: str) -> None:
    """The line to measure, and what the page is."""
    y = page.height - _FOOT + 3.0
    left = (page.width - _CHECK) / 2.0
    page.line(left, y, left + _CHECK, y)
    for end in (left, left + _CHECK):
        page.line(end, y - 2.0, end, y + 2.0)
    page.text(left + 2.0, y + 3.2, f"{_CHECK:g} {_FOOT_WORDS}", 2.6)
    page.text(left + 2.0, y + 6.4, f"{words}. svev target", 2.6)
