"""A jump measured with keys alone: points placed and moved in all views, followed through the pulses, and computed."""

import re

import numpy as np
import pytest
from playwright.sync_api import Page, expect

from rig.arrays import Floats
from tests.analysis.simulated import SIZE
from tests.browser.conftest import Open
from tests.browser.page.digitize.conftest import PULSE, Desk, canvas_of, enter
from tests.support.waiting import wait_until

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
    words = page.locator("#cursor-where").inner_text()
    return np.array([float(number) for number in re.findall(r"-?\d+\.\d+", words)])


def _off(desk: Desk, camera: str, thing: str) -> float:
    """How far a mark is from where the thing really is, px."""
    mark = desk.mark(camera, thing)
    return np.inf if mark is None else float(np.abs(np.array(mark["xy"]) - desk.true(camera, thing)).max())


@pytest.mark.long
def test_a_jump_is_measured_by_keys(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=1280, height=800, reduced_motion="reduce")
    for camera in ("K1", "K2", "K3"):
        expect(page.locator(f'.pane[data-camera="{camera}"]')).to_have_class(re.compile("active"))
        for thing in ("P1", "P2", "P3", "P4"):
            while page.locator(f'[data-thing="{thing}"]').get_attribute("aria-pressed") != "true":
                page.keyboard.press("s")
            if thing == "P1":
                page.keyboard.press("Enter")
                expect(page.locator("#cursor-where")).to_contain_text(camera)
            true = desk.true(camera, thing)
            box = canvas_of(page, camera)
            scale = min(box["width"] / SIZE[0], box["height"] / SIZE[1])
            _walk(page, (true - _crosshair(page)) * scale, ("j", "l", "i", "k"), STEPS)
            page.keyboard.press("Enter")
            expect(page.locator(f'[data-thing="{thing}"]')).to_have_attribute("aria-pressed", "false")
            _walk(page, true - _crosshair(page), ("ArrowLeft", "ArrowRight", "ArrowUp", "ArrowDown"), NUDGES)
        page.keyboard.press("d")
    for camera in ("K1", "K2", "K3"):
        for thing in ("P1", "P2", "P3", "P4"):
            wait_until(lambda: _off(desk, camera, thing) < 0.1, f"{thing} is where it is to be in {camera}", 20)  # noqa: B023 - called at once
    page.keyboard.press("2")
    expect(page.locator("#track-said li")).to_have_count(4, timeout=60_000)
    for pulse in (PULSE, PULSE + 2):
        truth = desk.log.truth[pulse]["points"]
        space = desk.view(pulse)["space"]
        for thing in ("P1", "P2", "P3", "P4"):
            off = np.array(space[thing]["X"]) - truth[thing]
            assert (np.abs(off) < 6 * np.array(space[thing]["sigma"])).all(), (pulse, thing)
    page.locator("#compute").focus()
    page.keyboard.press("Enter")
    expect(page.locator("#result-state")).to_contain_text("Computed.", timeout=60_000)
