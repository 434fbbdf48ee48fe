"""A measured jump on its page: the stick figure over the pictures, curves that move the video."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.analysis.simulated import RATE_HZ, SIZE
from tests.browser.conftest import Open
from tests.browser.recordings.conftest import FIRST, TAKEOFF, WATCH, shows
from tests.support.waiting import wait_until
from tests.webpanel.serving import Panel


def _drawn(overlay: Path, pulse: int) -> dict[str, Any]:
    (jump,) = json.loads(overlay.read_text())["jumps"]
    found: dict[str, Any] = next(each for each in jump["pulses"] if each["pulse"] == pulse)
    return found


def _middle(part: Locator) -> tuple[float, float]:
    box = part.bounding_box()
    assert box is not None
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def _lies_on_the_picture(page: Page, overlay: Path, pulse: int) -> None:
    """The helmet of each camera is drawn where its picture shows it."""
    expect(page.locator(".stick").first).to_be_attached()
    box = page.locator("#frames img:not(.ghost)").bounding_box()
    assert box is not None
    scale = box["width"] / (3 * SIZE[0])
    for k, (camera, seen) in enumerate(_drawn(overlay, pulse)["images"].items()):
        x, y = seen["points"]["P1"]
        there = box["x"] + (k * SIZE[0] + x + 0.5) * scale, box["y"] + (y + 0.5) * scale
        assert _middle(page.locator(f".stick[data-camera={camera}] .P1")) == pytest.approx(there, abs=1.5)


def test_stick_figure_and_curves_follow_the_video_and_move_it(panel: Panel, overlay: Path, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump", width=1280, height=900)
    shows(page, TAKEOFF)
    expect(page.locator("#jump-verdict")).to_have_text("Measured well")
    expect(page.locator("#curves-where")).to_have_text("0.00\u202fs  ·  0.0\u202fm")
    expect(page.locator("#frames img:not(.ghost)")).to_have_js_property("complete", True)
    _lies_on_the_picture(page, overlay, TAKEOFF)
    page.locator("#zoom-in").click()
    box = page.locator("#frames").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 300, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 220, box["y"] + 130, steps=4)
    page.mouse.up()
    _lies_on_the_picture(page, overlay, TAKEOFF)

    expect(page.locator(".curve")).to_have_count(8)
    speed = page.locator("[data-curve=speed]")
    expect(speed).to_have_text(re.compile(r"Speed2\d\.\d+ ± 0\.\d+\u202fm/s  ·  9\d\.\d\u202fkm/h"))
    expect(page.locator("[data-curve=alpha] strong")).to_have_text(re.compile(r"^\d+\.\d° ± \d\.\d+°$"))
    plot = speed.get_by_role("slider", name="Speed")
    plot.scroll_into_view_if_needed()
    where = plot.bounding_box()
    assert where is not None
    page.mouse.move(where["x"] + 0.9 * where["width"], where["y"] + 20)
    page.mouse.down()
    page.mouse.move(where["x"] + 0.52 * where["width"], where["y"] + 20, steps=3)
    page.mouse.up()
    middle = 41  # of pulses 23 to 58
    shows(page, middle)
    plot.press("ArrowRight")
    shows(page, middle + 1)
    plot.press("End")
    shows(page, 58)
    expect(plot).to_have_attribute("aria-valuenow", "58")
    page.locator("#frame-slider").fill("15")
    shows(page, FIRST + 15)
    expect(plot).to_have_attribute("aria-valuenow", str(FIRST + 15))
    assert _middle(plot.locator("i"))[0] == pytest.approx(where["x"] + where["width"] * 14 / 35, abs=3)
    page.keyboard.press("Home")  # nobody is in sight yet
    expect(page.locator("#curves-where")).to_have_text("the jumper is not in sight")
    expect(page.locator(".stick")).to_have_count(0)
    page.locator("#frame-moment").click()
    page.locator("#frame-stick").click()
    page.reload()
    shows(page, TAKEOFF)
    expect(page.locator("#frame-stick")).to_have_attribute("aria-pressed", "false")
    expect(page.locator(".curve")).to_have_count(8)
    expect(page.locator(".stick")).to_have_count(0)
    page.locator("#frame-stick").click()
    expect(page.locator(".stick")).to_have_count(3)


def test_one_tap_loops_the_take_off_in_slow_motion(panel: Panel, overlay: Path, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump")
    shows(page, TAKEOFF)
    page.evaluate(WATCH)
    page.locator("#frame-loop").click()
    expect(page.locator("#frame-speed")).to_have_value("5")
    page.locator("#frame-speed").select_option("1")
    wait_until(lambda: page.evaluate("seen.some((pulse, i) => pulse < seen[i - 1])"), "it goes round")
    page.locator("#frame-loop").click()
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    seen = page.evaluate("seen")
    assert min(seen) == FIRST  # the log begins less than 0.5 s before the take-off
    assert max(seen) <= TAKEOFF + RATE_HZ
    page.locator("#frame-loop").click()
    page.locator("#frame-play").click()  # stopped, but still in a loop
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    page.locator("#frame-loop").click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()


def test_a_result_of_an_older_version_says_why_there_is_no_stick_figure(
    panel: Panel, overlay: Path, open_page: Open
) -> None:
    overlay.unlink()
    page = open_page(f"{panel.url}/#/recordings/jump", locale="nb-NO")
    expect(page.locator("#stick-missing")).to_contain_text("Mål det på nytt")
    expect(page.locator("#curves")).to_be_hidden()
    expect(page.locator("#frame-stick")).to_be_hidden()
    shows(page, TAKEOFF)
