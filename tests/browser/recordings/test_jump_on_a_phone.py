"""A measured jump on a phone: one camera in full width, moved by fingers; the loop of the take-off; full screen."""

import re
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.analysis.simulated import RATE_HZ
from tests.browser.conftest import Open
from tests.browser.recordings.conftest import FIRST, TAKEOFF, WATCH, shows
from tests.browser.touch import Fingers, Place
from tests.browser.views import AXE, assert_fits_a_phone
from tests.support.waiting import wait_until
from tests.webpanel.serving import Panel

UPRIGHT, ACROSS = (360, 780), (780, 360)
#: How far down the controls in sight stand.
ROWS = """() => [...document.querySelectorAll("#player :is(button, select, input, a)")]
    .filter(e => e.checkVisibility() && !e.closest(".viewer, .curves") && e.id !== "frame-full")
    .map(e => Math.round(e.getBoundingClientRect().top))"""
#: Whether a finger at the middle of an element hits it.
IN_REACH = """element => {
    const { left, top, width, height } = element.getBoundingClientRect();
    return element.contains(document.elementFromPoint(left + width / 2, top + height / 2));
}"""
#: A browser that gives nobody the screen, as on iPhones.
NO_SCREEN = "Object.defineProperty(document, 'fullscreenEnabled', { value: false })"


def _phone(open_page: Open, panel: Panel, script: str = "", **more: Any) -> Page:
    """The page of the jump on a phone, with its picture and stick figure."""
    look = {"width": UPRIGHT[0], "height": UPRIGHT[1], "has_touch": True, "is_mobile": True}
    page = open_page("about:blank", **look, **more)
    page.add_init_script(script)
    page.goto(f"{panel.url}/#/recordings/jump")
    shows(page, TAKEOFF)
    expect(page.locator(".stick").first).to_be_attached()
    return page


def _box(part: Locator) -> dict[str, float]:
    box: Any = part.bounding_box()
    assert box is not None
    return box  # type: ignore[no-any-return]


def _middle(part: Locator) -> Place:
    box = _box(part)
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def _camera(page: Page) -> Locator:
    return page.locator("#frames .block:visible .name")


def _swipe_to(page: Page, right: float, camera: str) -> None:
    """Swipe over the picture until a camera is shown: a busy machine may take a swipe for a long press."""
    before = _camera(page).inner_text()

    def swiped() -> bool:
        Fingers(page).swipe(_middle(page.locator("#frames")), right)
        page.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
        return _camera(page).inner_text() != before

    wait_until(swiped, "the swipe is taken")
    expect(_camera(page)).to_have_text([camera])


@pytest.mark.parametrize("locale", ["en-GB", "nb-NO"])
def test_a_phone_shows_one_camera_in_full_width_with_two_rows_of_controls(
    panel: Panel, overlay: Path, open_page: Open, locale: str
) -> None:
    page = _phone(open_page, panel, locale=locale)
    expect(page.locator(".curve:visible")).to_have_count(2)
    picture = _box(page.locator("#frames"))
    assert picture["width"] > 300
    assert picture["height"] > 220
    assert len(set(page.evaluate(ROWS))) == 2
    assert_fits_a_phone(page)
    plot = page.locator("[data-curve=speed] .plot")
    plot.scroll_into_view_if_needed()
    where = _box(plot)
    page.touchscreen.tap(where["x"] + 0.52 * where["width"], where["y"] + 20)
    shows(page, 41)
    page.locator("#curves-all").tap()
    expect(page.locator(".curve:visible")).to_have_count(8)
    page.locator("#frame-more").tap()
    expect(page.locator("#frame-cameras")).to_be_visible()
    assert_fits_a_phone(page)
    page.evaluate(AXE.read_text())
    assert page.evaluate("axe.run().then(found => found.violations.map(each => each.id))") == []


def test_a_finger_swipes_to_the_next_camera_and_moves_what_two_have_enlarged(
    panel: Panel, overlay: Path, open_page: Open
) -> None:
    page = _phone(open_page, panel)
    frames = page.locator("#frames")
    expect(_camera(page)).to_have_text(["K1"])
    for right, camera in ((-120, "K2"), (-120, "K3"), (-120, "K1"), (120, "K3"), (120, "K2")):
        _swipe_to(page, right, camera)
    shows(page, TAKEOFF)

    x, y = _middle(frames)
    Fingers(page).drag(((x - 30, y), (x - 90, y)), ((x + 30, y), (x + 90, y)))
    expect(frames).to_have_class(re.compile("zoomed"))
    assert float(frames.evaluate("element => element.style.getPropertyValue('--zoom')")) > 1.5
    plane = page.locator("#frames .plane")
    before = _box(plane)["x"]
    Fingers(page).swipe((x, y), -60)
    wait_until(lambda: _box(plane)["x"] < before - 30, "the picture is moved")
    expect(_camera(page)).to_have_text(["K2"])
    Fingers(page).drag(((x - 120, y), (x - 20, y)), ((x + 120, y), (x + 20, y)))
    expect(frames).not_to_have_class(re.compile("zoomed"))
    expect(_camera(page)).to_have_text(["K2"])

    Fingers(page).swipe(_middle(frames), 15, -150)
    wait_until(lambda: page.evaluate("scrollY") > 50, "a finger that goes up scrolls the page")
    expect(_camera(page)).to_have_text(["K2"])
    shows(page, TAKEOFF)


def test_one_tap_loops_the_take_off_also_in_the_next_camera(panel: Panel, overlay: Path, open_page: Open) -> None:
    page = _phone(open_page, panel)
    page.locator("#frame-loop").tap()
    expect(page.locator("#frame-loop")).to_have_attribute("aria-pressed", "true")
    expect(page.locator("#frame-speed")).to_have_value("5")
    _swipe_to(page, -120, "K2")
    page.locator("#frame-speed").select_option("1")
    page.evaluate(WATCH)
    wait_until(lambda: page.evaluate("seen.some((pulse, i) => pulse < seen[i - 1])"), "it goes round")
    seen = page.evaluate("seen")
    assert min(seen) == FIRST  # the log begins less than 0.5 s before the take-off
    assert max(seen) <= TAKEOFF + RATE_HZ
    expect(_camera(page)).to_have_text(["K2"])
    page.locator("#frame-loop").tap()
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    expect(page.locator("#frame-loop")).to_have_attribute("aria-pressed", "false")


@pytest.mark.parametrize("script", ["", NO_SCREEN], ids=["screen", "window"])
def test_the_jump_fills_the_screen_and_turns_with_the_phone(
    panel: Panel, overlay: Path, open_page: Open, script: str
) -> None:
    page = _phone(open_page, panel, script)
    full, player = page.locator("#frame-full"), page.locator("#player")
    before = _box(player)
    _swipe_to(page, -120, "K2")
    full.tap()
    expect(full).to_have_attribute("aria-pressed", "true")
    assert page.evaluate("document.fullscreenElement?.id") == (None if script else "player")
    wait_until(lambda: _fills(page, UPRIGHT), "the player is as large as the screen")
    _in_reach(page)
    _swipe_to(page, -120, "K3")

    _turn(page, ACROSS)
    wait_until(lambda: _fills(page, ACROSS), "it turns with the phone")
    expect(_camera(page)).to_have_text(["K3"])
    assert _box(page.locator("#frames"))["height"] > 0.65 * ACROSS[1]
    _in_reach(page)
    _swipe_to(page, 120, "K2")

    _turn(page, UPRIGHT)
    wait_until(lambda: _fills(page, UPRIGHT), "it turns back")
    expect(_camera(page)).to_have_text(["K2"])
    full.tap()
    expect(full).to_have_attribute("aria-pressed", "false")
    wait_until(lambda: _box(player)["width"] == before["width"], "the player is as it was")
    assert_fits_a_phone(page)


def _turn(page: Page, size: tuple[int, int]) -> None:
    """Turn the phone, whatever fills its screen."""
    metrics = {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": True}
    page.context.new_cdp_session(page).send("Emulation.setDeviceMetricsOverride", metrics)


def _fills(page: Page, size: tuple[int, int]) -> bool:
    box = _box(page.locator("#player"))
    return (box["x"], box["y"], box["width"], box["height"]) == (0, 0, *size)


def _in_reach(page: Page) -> None:
    """What one needs is within the screen, and nothing lies over it."""
    for name in ("frame-full", "frame-play", "frame-loop", "frame-back", "frame-on", "frame-speed", "frame-slider"):
        assert page.locator(f"#{name}").evaluate(IN_REACH), name
