"""Printed sheets: the PDF files are sound and of exact size, and their targets are found as what they are."""

import re
from collections.abc import Sequence

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.targets.detection import find_targets
from analysis.targets.pattern import Layout
from analysis.targets.pdf import Page, pdf
from analysis.targets.sheets import board_page, target_pages
from rig.errors import BadInputError
from tests.analysis.targets.drawn import UNITS, board_raster, single_raster

_MM = 72.0 / 25.4


def _boxes(page: Page) -> NDArray[np.float64]:
    """(n, 4) x, y of the top left corner, width, height of the rectangles, mm."""
    found = re.findall(rb"([\d.]+) ([\d.]+) ([\d.]+) ([\d.]+) re f", page.content())
    boxes = np.array(found, dtype=float) / _MM
    boxes[:, 1] = page.height - boxes[:, 1] - boxes[:, 3]
    return boxes


def _printed(page: Page, per_mm: float) -> NDArray[np.uint8]:
    sheet = np.full((round(page.height * per_mm), round(page.width * per_mm)), 255, np.uint8)
    for x, y, width, height in np.rint(_boxes(page) * per_mm).astype(int).tolist():
        sheet[y : y + height, x : x + width] = 0
    return sheet


def test_the_board_is_opencvs_charuco_board() -> None:
    layout = Layout()
    page = board_page(layout)
    assert (page.width, page.height) == (297.0, 210.0)
    cell = layout.board_mm / UNITS
    printed = _printed(page, 1.0 / cell)
    expected = np.where(board_raster()[UNITS // 2 : -UNITS // 2, UNITS // 2 : -UNITS // 2] > 127, 255, 0)
    left, top = (_boxes(page)[:, :2].min(axis=0) / cell).round().astype(int)
    assert np.array_equal(printed[top : top + 6 * UNITS, left : left + 9 * UNITS], expected)
    board = cv2.aruco.CharucoBoard((9, 6), 30.0, 17.5, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250))
    corners, _, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(cv2.resize(printed, None, fx=3, fy=3))
    assert len(corners) == 40


def test_single_targets_are_found_with_their_codes() -> None:
    layout = Layout()
    pages = target_pages(layout, range(100, 105))
    assert [(page.width, page.height) for page in pages] == [(210.0, 297.0)] * 3
    found = [sorted(find_targets(_printed(page, 3.6), layout, "page").targets) for page in pages]
    assert found == [[100, 101], [102, 103], [104]]
    cell = layout.single_mm / UNITS
    boxes = _boxes(pages[2]) / cell
    drawn = np.zeros((38, 38), bool)
    for x, y, width, height in np.rint(boxes - (*boxes[:, :2].min(axis=0), 0.0, 0.0)).astype(int).tolist():
        drawn[y : y + height, x : x + width] = True
    assert np.array_equal(drawn, single_raster(104)[1:39, 1:39] < 127)


@pytest.mark.parametrize("page", [board_page(Layout()), *target_pages(Layout(), [100])])
def test_each_page_has_a_line_of_150_mm_to_measure(page: Page) -> None:
    ends = re.findall(rb"([\d.]+) ([\d.]+) m ([\d.]+) ([\d.]+) l S", page.content())
    lengths = [np.hypot(float(c) - float(a), float(d) - float(b)) / _MM for a, b, c, d in ends]
    assert any(abs(length - 150.0) < 1e-3 for length in lengths)
    assert b"(150 mm between the marks" in page.content()
    boxes = _boxes(page)
    assert boxes[:, :2].min() > 5.0  # what printers leave
    assert np.all((boxes[:, :2] + boxes[:, 2:]).max(axis=0) < (page.width - 5.0, page.height - 12.0))


def test_large_targets_get_pages_of_their_own_size() -> None:
    layout = Layout(12, 8, 60.0, 150.0)
    board, (single,) = board_page(layout), target_pages(layout, [100])
    assert board.width > 12 * 60.0
    assert board.height > 8 * 60.0
    assert single.width > 150.0 * 5.0 / 3.0


def _objects(data: bytes) -> Sequence[bytes]:
    """The objects that the file's table of places leads to."""
    start = int(data[data.rindex(b"startxref") :].split()[1])
    places = [int(line.split()[0]) for line in data[start:].split(b"\n")[3:] if line.endswith(b" n ")]
    return [data[place : data.index(b"endobj", place)] for place in places]


def test_the_pdf_file_is_sound() -> None:
    pages = target_pages(Layout(), range(100, 104))
    data = pdf(pages)
    objects = _objects(data)
    assert [int(each.split()[0]) for each in objects] == list(range(1, len(objects) + 1))
    assert objects[1].count(b" R") == len(pages)
    assert b"/PrintScaling /None" in objects[0]
    for each in objects:
        if b"stream" in each:
            length = int(re.findall(rb"/Length (\d+)", each)[0])
            assert len(each[each.index(b"stream\n") + 7 : each.rindex(b"\nendstream")]) == length


@pytest.mark.parametrize("size", [(2, 6), (30, 8)])
def test_boards_without_inner_corners_or_with_too_many_codes_are_refused(size: tuple[int, int]) -> None:
    with pytest.raises(BadInputError, match="3 x 3 squares at least"):
        Layout(*size)
