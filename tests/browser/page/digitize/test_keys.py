"""A jump measured with keys alone: points placed and moved in all views, followed through the pulses, and computed."""

import math
import re

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from analysis.measurements.model import POINTS
from rig.arrays import Floats
from tests.analysis.simulated import SIZE
from tests.browser.conftest import Open
from tests.browser.page.digitize.conftest import PULSE, Desk, canvas_of, enter, settled
from tests.support.waiting import wait_until

CAMERAS = ("K1", "K2", "K3")
#: Steps of the crosshair, CSS px, and of a mark, px of the image.
STEPS = (12, 1)
NUDGES = (1.0, 0.1)


def _walk(page: Page, way: Floats, keys: tuple[str, str, str, str], steps: tuple[float, float]) -> None:
    """Go so far to the right and down by keys for left, right, up and down.

    The fine step of the crosshair, and the coarse one of a mark, have the Shift key.
    """
    shifted = 0 if steps == NUDGES else 1
    for axis, (less, more) in enumerate((keys[:2], keys[2:])):
        left = float(way[axis])
        for index, step in enumerate(steps):
            count = round(left / step)
            left -= count * step
            key = more if count > 0 else less
            for _ in range(abs(count)):
                page.keyboard.press(f"Shift+{key}" if index == shifted else key)


def _crosshair(page: Page) -> Floats:
    settled(page)
    words = page.locator("#cursor-where").inner_text()
    return np.array([float(number) for number in re.findall(r"-?\d+\.\d+", words)])


def _off(desk: Desk, camera: str, thing: str) -> float:
    """How far a mark is from where the thing really is, px."""
    mark = desk.mark(camera, thing)
    return np.inf if mark is None else float(np.abs(np.array(mark["xy"]) - desk.true(camera, thing)).max())


def _choose(page: Page, camera: str, thing: str) -> None:
    """Go to a thing in a view of the pulse that is measured; placing goes on to the next one by itself."""
    pulse = page.locator("#pulse-number")
    behind = PULSE - int(pulse.inner_text())
    for _ in range(abs(behind)):
        page.keyboard.press("w" if behind > 0 else "q")
    expect(pulse).to_have_text(str(PULSE))
    while "active" not in (page.locator(f'.pane[data-camera="{camera}"]').get_attribute("class") or "").split():
        page.keyboard.press("d")
        settled(page)
    while page.locator(f'[data-thing="{thing}"]').get_attribute("aria-pressed") != "true":
        page.keyboard.press("s")
        settled(page)


def _place(page: Page, camera: str, thing: str, true: Floats) -> None:
    """Place a thing by the crosshair, and nudge it to where it really is."""
    _choose(page, camera, thing)
    if not page.locator("#cursor-where").inner_text().startswith(camera):
        page.keyboard.press("Enter")
        expect(page.locator("#cursor-where")).to_contain_text(camera)
    box = canvas_of(page, camera)
    scale = min(box["width"] / SIZE[0], box["height"] / SIZE[1])
    _walk(page, (true - _crosshair(page)) * scale, ("j", "l", "i", "k"), STEPS)
    placed = _crosshair(page)
    page.keyboard.press("Enter")
    settled(page)
    _choose(page, camera, thing)
    expect(page.locator("#mark-words")).to_contain_text(f" in {camera}: x ")  # the marks of the pulse have come, too
    _walk(page, true - placed, ("ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"), NUDGES)


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("markers", [False])
def test_a_jump_without_markers_is_measured_by_keys(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1280, height=800, reduced_motion="reduce")
    placed = 0
    for camera in CAMERAS:
        for side, ski in desk.log.truth[PULSE]["skis"].items():
            for along in (-0.9, 0.9):
                true = desk.image(camera, np.array(ski["point"]) + along * np.array(ski["direction"]))
                _place(page, camera, f"{side} ski", true)
                placed += 1
        for thing in POINTS:
            _place(page, camera, thing, desk.true(camera, thing))
            placed += 1
    assert placed < 60
    for camera in CAMERAS:
        for thing in POINTS:
            wait_until(lambda: _off(desk, camera, thing) < 0.1, f"{thing} is where it is to be in {camera}")  # noqa: B023 - called at once
    for ski in ("left ski", "right ski"):
        _choose(page, "K1", ski)
        page.keyboard.press("e")
        expect(page.locator("#track-said li")).to_contain_text("it was refined", timeout=60_000)
        expect(page.locator("#track-said li")).to_contain_text("Right" if ski == "right ski" else "Left")
        marks = [desk.mark(camera, ski) for camera in CAMERAS]
        sources = [mark["vertices"][0]["source"] for mark in marks if mark is not None]
        assert sources.count("refined") >= 2  # where an image shows it well
    for key in ("1", "2"):  # back, and on
        _choose(page, "K1", "P1")
        page.keyboard.press(key)
        expect(page.locator("#track-share")).to_be_visible()
        expect(page.locator("#track-share")).to_be_hidden(timeout=90_000)
        expect(page.locator("#track-said li")).to_have_count(6)
    _is_true(desk)
    page.locator("#compute").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#result-state")).to_contain_text("Computed.", timeout=60_000)


def _is_true(desk: Desk) -> None:
    """All points and skis of nearly all pulses are known, and as near to the truth as they say."""
    points, slopes = [], []
    for pulse, truth in desk.log.truth.items():
        view = desk.view(pulse)
        for thing in POINTS:
            if view["space"].get(thing, {}).get("X") is not None:
                off = np.array(view["space"][thing]["X"]) - truth["points"][thing]
                points.append(off / view["space"][thing]["sigma"])
        for side, ski in truth["skis"].items():
            slope = view["lines"].get(f"{side} ski", {}).get("slope")
            if slope is not None:
                slopes.append((slope["value"] - math.degrees(math.asin(ski["direction"][2]))) / slope["sigma"])
    pulses = len(desk.log.truth)
    assert len(points) >= 0.95 * 4 * pulses
    assert len(slopes) >= 0.9 * 2 * pulses
    for errors in (points, slopes):
        assert np.abs(errors).max() < 6
        assert np.sqrt(np.mean(np.square(errors))) < 2  # those of one start are shared by all its pulses
