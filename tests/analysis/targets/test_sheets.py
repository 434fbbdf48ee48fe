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


def _discs(page: Page) -> list[tuple[float, float, float]]:
    """x, y of the centre and radius of the discs, mm; each must be a circle."""
    found = []
    for curves in re.findall(rb"^(.* m (?:.* c ){4}f)$", page.content(), re.MULTILINE):
        places = np.array(re.findall(rb"[\d.]+ [\d.]+", curves)).tolist()
        ends = np.array([place.split() for place in places[::3]], dtype=float) / _MM
        bows = np.array([place.split() for place in places], dtype=float).reshape(-1, 2) / _MM
        middle = (ends[0] + ends[2]) / 2.0
        radius = float(np.linalg.norm(ends[0] - middle))
        p = [bows[k : k + 4] - middle for k in range(0, 12, 3)]
        share = np.linspace(0.0, 1.0, 21)[:, None]
        for a, b, c, d in p:
            curve = (
                (1 - share) ** 3 * a + 3 * (1 - share) ** 2 * share * b + 3 * (1 - share) * share**2 * c + share**3 * d
            )
            assert np.allclose(np.linalg.norm(curve, axis=1), radius, rtol=3e-4)
        found.append((float(middle[0]), float(page.height - middle[1]), radius))
    return found


def _printed(page: Page, per_mm: float) -> NDArray[np.uint8]:
    sheet = np.full((round(page.height * per_mm), round(page.width * per_mm)), 255, np.uint8)
    for x, y, width, height in np.rint(_boxes(page) * per_mm).astype(int).tolist():
        sheet[y : y + height, x : x + width] = 0
    parts = 8  # of a pixel's side, as OpenCV counts them: 2^3
    for x, y, radius in _discs(page):
        middle = [round((place * per_mm - 0.5) * parts) for place in (x, y)]
        cv2.circle(sheet, middle, round(radius * per_mm * parts), 0, cv2.FILLED, cv2.LINE_AA, 3)
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


def test_targets_with_circles_are_found_and_measured() -> None:
    layout, per_mm = Layout(), 3.6
    (page,) = target_pages(layout, [175, 176])
    assert [radius for _, _, radius in _discs(page)] == pytest.approx([10.0] * 8, abs=1e-4)
    assert b"(targets with circles, 20 mm wide, white squares 80 mm" in page.content()
    picture = np.asarray(cv2.GaussianBlur(_printed(page, per_mm), (0, 0), 0.8), np.uint8)
    sight = find_targets(picture, layout, "page")
    assert sorted(sight.targets) == [175, 176]
    printed = np.array([(x * per_mm - 0.5, y * per_mm - 0.5) for x, y, _ in _discs(page)])
    measured = np.array([(corner.x, corner.y) for corner in sight.corners.values()])
    nearest = np.linalg.norm(measured[:, None] - printed, axis=2).argmin(axis=1)
    assert sorted(nearest) == list(range(8))
    assert np.allclose(measured, printed[nearest], atol=0.1)


@pytest.mark.parametrize("page", [board_page(Layout()), *target_pages(Layout(), [100]), *target_pages(Layout(), [175])])
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
