"""What is clicked is the place of the image that is seen there, at every zoom and on fine screens."""

import re

import cv2
import numpy as np
import pytest
from playwright.sync_api import Page, expect
from scipy import ndimage

from rig.arrays import Floats
from tests.browser.conftest import Open
from tests.browser.page.digitize.conftest import PULSE, Desk, canvas_of, decoded, enter, screen, seen, settled
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
    wait_until(lambda: desk.mark("K1", "P1") is not None, "the click is kept")
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
        (0, r" (0\.9|1\.\d)\u00d7"),
        (900, r" [456]\.\d\u00d7"),
        (900, r" (2\d|3[01])\u00d7"),
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


def _zoom_in(page: Page, desk: Desk) -> tuple[Floats, Floats]:
    """Enlarge K1 about the helmet 32 times; a place on the page there, and that of the image, px."""
    page.locator("#advance").select_option("stay")
    at = np.round(screen(page, "K1", desk.true("K1", "P1")))
    page.mouse.move(*at)
    page.mouse.wheel(0, -4000)
    expect(page.locator(".pane.active .pane-where")).to_contain_text("32\u00d7")
    return at, _place(page, desk, at)


def _greys(page: Page, at: Floats, place: Floats) -> Floats:
    """The grey values that the page shows of the image's pixels around a place, (5, 5), when 32 times enlarged."""
    middle = at + 32 * (np.round(place) - place)
    shown = seen(page, np.floor(middle), (96, 96))
    assert np.ptp(shown, axis=2).max() <= 1, "grey"
    offset = middle - np.floor(middle) + 96
    rows, columns = (np.floor(offset[axis] + 32 * np.arange(-2, 3)).astype(int) for axis in (1, 0))
    return shown[..., 0][np.ix_(rows, columns)]


def _pixels(picture: Floats, place: Floats) -> Floats:
    """The pixels (5, 5) of an image around a place."""
    x, y = np.round(place).astype(int)
    return picture[y - 2 : y + 3, x - 2 : x + 3]


def test_every_grey_value_is_shown_as_brightness_contrast_and_gamma_say(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1500, height=1000)
    at, place = _zoom_in(page, desk)
    recorded = _pixels(decoded(desk.client.get(f"/frames/{PULSE}/K1.png").content)[..., 0], place)
    assert np.ptp(recorded) > 40, "there is something to see"
    assert np.abs(_greys(page, at, place) - recorded).max() <= 1
    page.locator("#picture > summary").click()
    sliders = {"brightness": 0.1, "contrast": 0.6, "gamma": -0.8}
    for name, value in sliders.items():
        page.locator(f"#tone-{name}").fill(str(value))
    settled(page)
    line = (recorded / 255 - 0.5) * 2 ** sliders["contrast"] + 0.5 + sliders["brightness"]
    wanted = 255 * np.clip(line, 0, 1) ** (1 / 2 ** sliders["gamma"])
    assert np.abs(_greys(page, at, place) - wanted).max() <= 1
    page.locator("#tone-plain").click()
    settled(page)
    assert np.abs(_greys(page, at, place) - recorded).max() <= 1
    page.keyboard.press("h")  # as much of the range as there is
    settled(page)
    frame = decoded(desk.client.get(f"/frames/{PULSE}/K1.png").content)[..., 0]
    low, high = np.quantile(frame, (0.002, 0.998))
    spread = np.clip((recorded - low) / (high - low), 0, 1) * 255
    assert np.abs(_greys(page, at, place) - spread).max() < 255 * 2 / (high - low) + 1


def test_the_histogram_counts_the_frame_that_is_in_sight(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1500, height=1000)
    page.locator("#picture > summary").click()
    for camera, pulse in (("K1", PULSE), ("K2", PULSE), ("K2", PULSE + 1)):
        if camera == "K2":
            page.locator(f'.pane[data-camera="{camera}"] .pane-name').click()
        if pulse > PULSE:
            page.keyboard.press("w")
        expect(page.locator(".pane.active .pane-where")).to_contain_text(f"{pulse} ")
        settled(page)
        frame = decoded(desk.client.get(f"/frames/{pulse}/{camera}.png").content)[..., 0]
        counts = np.bincount(frame.astype(int).ravel(), minlength=256)
        wanted = 64 * np.log1p(counts) / np.log1p(counts.max())
        wait_until(lambda wanted=wanted: _fits(page, wanted), f"the histogram of {camera} at {pulse}")  # type: ignore[misc]


def _fits(page: Page, heights: Floats) -> bool:
    """Whether the histogram on the page has these heights, px, beside the line of the tone, which crosses it."""
    data = page.evaluate("""() => {
        const copy = new OffscreenCanvas(256, 64).getContext("2d", { willReadFrequently: true });
        copy.drawImage(document.getElementById("histogram"), 0, 0);
        return [...copy.getImageData(0, 0, 256, 64).data];
    }""")
    shown = np.array(data).reshape(64, 256, 4)
    rows, columns = np.mgrid[0:64, 0:256]
    beside = np.abs((63.5 - rows) * 4 - columns) > 24
    filled = shown[..., 3] > 127
    sure = beside & (np.abs(64 - rows - 0.5 - heights) > 1)
    return bool((filled == (64 - rows - 0.5 < heights))[sure].all())


def test_the_difference_is_that_to_what_is_always_there(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1500, height=1000)
    at, place = _zoom_in(page, desk)
    page.keyboard.press("y")
    expect(page.locator("#view-difference")).to_have_attribute("aria-pressed", "true")
    frames = np.array([decoded(desk.client.get(f"/frames/{n}/K1.png").content)[..., 0] for n in range(1, 21)])
    now, always = _pixels(frames[PULSE - 1], place), _pixels(np.median(frames, axis=0), place)
    differs = np.abs(now - always) > 25
    assert differs.any(), "the helmet is in front of it"
    wait_until(
        lambda: bool((np.sign(_greys(page, at, place) - 128) == np.sign(now - always))[differs].all()),
        "brighter where it is brighter than the background, darker where it is darker",
        20,
    )
    page.keyboard.press("0")
    page.mouse.move(5, 5)
    settled(page)
    box = canvas_of(page, "K1")
    corner = np.array([box["x"] + 0.3 * box["width"], box["y"] + 0.8 * box["height"]])  # nothing moves there
    assert abs(seen(page, corner, (20, 20)).mean() - 128) < 4, "grey where nothing differs"


@pytest.mark.parametrize("enlarged", repeats([8, 16, 32]))
def test_the_loupe_shows_what_is_under_the_pointer_and_does_not_cover_it(
    desk: Desk, open_page: Open, enlarged: int
) -> None:
    page = enter(open_page, desk, width=1500, height=1000)
    page.locator("#loupe").select_option(str(enlarged))
    frame = decoded(desk.client.get(f"/frames/{PULSE}/K1.png").content)[..., 0]
    at = np.round(screen(page, "K1", desk.true("K1", "P1")))
    place = _place(page, desk, at)
    box = canvas_of(page, "K1")
    page.mouse.move(*at)
    settled(page)
    picture = decoded(page.locator('.pane[data-camera="K1"] canvas').screenshot())[..., 0]
    side = 28  # of a part beside the cross: right of and below the middle
    steps = (6.5 + np.arange(side)) / enlarged
    part = ndimage.map_coordinates(frame, np.meshgrid(place[1] + steps, place[0] + steps, indexing="ij"), order=0)
    found = cv2.matchTemplate(picture.astype(np.float32), part.astype(np.float32), cv2.TM_SQDIFF)
    _, _, (x, y), _ = cv2.minMaxLoc(found)
    off = np.abs(picture[y : y + side, x : x + side] - part)
    assert np.median(off) <= 1, np.median(off)
    assert (off <= 2).mean() > 0.9, "but for the rims of pixels"
    middle = np.array([x - 6 + box["x"], y - 6 + box["y"]])
    assert 60 < np.hypot(*(middle - at)) < 200, "near the pointer, and it does not cover it"
    page.locator("#loupe").select_option("0")
    page.mouse.move(*np.add(at, 1))
    page.mouse.move(*at)
    settled(page)
    without = decoded(page.locator('.pane[data-camera="K1"] canvas').screenshot())[..., 0]
    assert np.median(np.abs(without[y : y + side, x : x + side] - part)) > 2, "there is none"


def test_linked_views_are_enlarged_together(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1500, height=1000)
    where = [page.locator(f'.pane[data-camera="{camera}"] .pane-where') for camera in ("K1", "K2")]
    before = where[1].inner_text()
    page.locator("#zoom-in").click()
    expect(where[0]).not_to_have_text(before)
    assert where[1].inner_text() == before
    page.locator("#zoom-whole").click()
    page.locator("#view-linked").click()
    page.locator("#zoom-in").click()
    expect(where[1]).not_to_have_text(before)
