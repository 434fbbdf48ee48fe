"""What is clicked is the place of the image that is seen there, at every zoom and on fine screens."""

import re

import numpy as np
import pytest
from playwright.sync_api import Page, expect
from scipy import ndimage

from rig.arrays import Floats
from tests.browser.conftest import Open
from tests.browser.page.digitize.conftest import PULSE, Desk, canvas_of, decoded, enter, seen, settled
from tests.support.repeats import repeats
from tests.support.waiting import wait_until

#: px of the image.
TOLERANCE = 0.02
#: Half a side of what is compared around a click, CSS px.
AROUND = 60


def _place(page: Page, desk: Desk, at: Floats) -> Floats:
    """Click, and take what was kept away again."""
    page.mouse.click(*at)
    expect(page.locator('[data-thing="P1"] .sign').first).to_have_attribute("data-letter", "m")
    wait_until(lambda: desk.mark("K1", "P1") is not None, "the click is kept", 20)
    mark = desk.mark("K1", "P1")
    assert mark is not None
    page.keyboard.press("z")
    expect(page.locator('[data-thing="P1"] .sign').first).to_have_attribute("data-letter", "")
    page.mouse.move(5, 5)
    settled(page)
    return np.array(mark["xy"])


def _expected(frame: Floats, middle: Floats, scale: float, side: int, *, crisp: bool) -> Floats:
    """What a square of the screen shows that has a place of the image in its middle, at so many pixels for one."""
    steps = (np.arange(side) + 0.5 - side / 2) / scale
    rows, columns = np.meshgrid(middle[1] + steps, middle[0] + steps, indexing="ij")
    return np.asarray(ndimage.map_coordinates(frame, [rows, columns], order=0 if crisp else 1, mode="nearest"))


def _shift(seen: Floats, expected: Floats) -> Floats:
    """How far two pictures are apart, px: least squares of their grey values, smoothed to make edges slopes."""
    first, second = (ndimage.gaussian_filter(picture, 6)[20:-20, 20:-20] for picture in (seen, expected))
    down, right = np.gradient(second)
    slopes = np.stack([right.ravel(), down.ravel(), np.ones(right.size)], axis=1)
    return np.asarray(np.linalg.lstsq(slopes, (second - first).ravel(), rcond=None)[0][:2])


@pytest.mark.parametrize("ratio", repeats([1, 2]))
def test_a_click_gives_the_place_of_the_image_that_is_seen_there(desk: Desk, open_page: Open, ratio: int) -> None:
    page = enter(open_page, desk, width=1500, height=1000, device_scale_factor=ratio)
    page.locator("#advance").select_option("stay")
    frame = decoded(desk.client.get(f"/frames/{PULSE}/K1.png").content)[..., 0]
    box = canvas_of(page, "K1")
    middle = np.round([box["x"] + 0.55 * box["width"], box["y"] + 0.5 * box["height"]])
    scales = []
    for zoom, shown in (
        (0, r" 1\.\d\u00d7"),
        (900, r" [56]\.\d\u00d7"),
        (900, r" (29|3[01])\u00d7"),
        (400, r" 32\u00d7"),
    ):  # the last is as large as it goes
        page.mouse.move(*middle)
        if zoom:
            page.mouse.wheel(0, -zoom * ratio)  # it is told in pixels of the screen
        expect(page.locator(".pane.active .pane-where")).to_contain_text(re.compile(shown))
        page.mouse.move(5, 5)
        settled(page)
        at = np.add(middle, [7.5, -4.5] if ratio == 2 else [7, -4])
        shown_there = seen(page, at, (AROUND, AROUND))[..., 0]
        first, second = _place(page, desk, at), _place(page, desk, np.add(at, [64, 0]))
        scale = 64 / (second - first)[0]
        scales.append(scale)
        off = _shift(shown_there, _expected(frame, first, scale * ratio, len(shown_there), crisp=scale > 3))
        assert np.abs(off).max() / (scale * ratio) < TOLERANCE, (scale, off / (scale * ratio))
    assert scales[-1] == pytest.approx(32, rel=1e-4)


def test_brightness_difference_and_linked_views_change_what_is_seen(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1500, height=1000)
    box = canvas_of(page, "K1")
    middle = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
    page.mouse.move(5, 5)
    settled(page)
    plain = seen(page, middle, (AROUND, AROUND)).mean()
    page.locator("#picture > summary").click()
    page.locator("#tone-brightness").fill("0.3")
    settled(page)
    assert seen(page, middle, (AROUND, AROUND)).mean() > plain + 20
    page.locator("#tone-plain").click()
    settled(page)
    assert seen(page, middle, (AROUND, AROUND)).mean() == pytest.approx(plain, abs=1)
    page.keyboard.press("y")
    expect(page.locator("#view-difference")).to_have_attribute("aria-pressed", "true")
    settled(page)
    corner = np.array([box["x"] + 0.3 * box["width"], box["y"] + 0.8 * box["height"]])  # nothing moves there
    wait_until(lambda: abs(seen(page, corner, (20, 20)).mean() - 128) < 4, "grey where nothing differs", 20)
    page.keyboard.press("y")
    where = [page.locator(f'.pane[data-camera="{camera}"] .pane-where') for camera in ("K1", "K2")]
    before = where[1].inner_text()
    page.locator("#zoom-in").click()
    expect(where[0]).not_to_have_text(before)
    assert where[1].inner_text() == before
    page.locator("#zoom-whole").click()
    page.locator("#view-linked").click()
    page.locator("#zoom-in").click()
    expect(where[1]).not_to_have_text(before)
