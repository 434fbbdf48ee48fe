"""The page itself: gaps and logs without a survey, narrow screens, Norwegian, what axe finds."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import expect

from rig.frame import FrameStatus
from tests.browser.conftest import Open
from tests.browser.page.digitize.conftest import Desk, canvas_of, enter, settled
from tests.browser.page.test_accessibility import _grave
from tests.browser.touch import Fingers
from tests.browser.views import AXE, BROKEN, SMALLEST_TOUCH_PX, TOO_SMALL
from tests.recorder.logs import ALL_OK
from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access

OK = FrameStatus.OK


def test_gaps_are_said_and_without_a_survey_only_images_are_measured(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    lost, missed = (OK, FrameStatus.LOST, OK), (FrameStatus.MISSED, OK, OK)
    write_recording(service.catalogue.directory, "jump-2", (*(ALL_OK,) * 4, lost, *(ALL_OK,) * 3, missed, ALL_OK))
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    page.locator("#recording-digitize").click()
    page.locator("#operator-name").fill("Åse")
    page.locator("#operator-submit").click()
    expect(page.locator("#numbers-none")).to_contain_text("only images are measured")
    expect(page.locator("#orientation-lamp")).to_contain_text("Not oriented")
    page.keyboard.press("g")
    k2 = page.locator('.pane[data-camera="K2"]')
    expect(k2.locator(".pane-fate")).to_have_text("lost: The camera took the frame, but it did not arrive.")
    expect(k2.locator(".pane-where")).to_contain_text("lost")
    page.keyboard.press("g")
    expect(page.locator('.pane[data-camera="K1"] .pane-where')).to_contain_text("missed")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    expect(page.locator("#undo")).to_be_disabled()  # there is no picture to measure in
    page.keyboard.press("d")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    expect(page.locator("#undo")).to_be_enabled()
    page.reload()  # the name is known now, and what was done is there
    expect(page.locator("#operator-shown")).to_have_text("Åse")
    expect(page.locator("#undo")).to_be_enabled()


def test_who_may_only_watch_has_no_tools(
    service: MemoryService, loopback: Loopback, open_page: Open, tmp_path: Path
) -> None:
    write_recording(service.catalogue.directory, "jump-2", (ALL_OK,) * 4)
    file = tmp_path / "tokens"
    file.write_text("watch a-token-to-watch-with\n")
    with serving(service, Access.for_address(loopback.host, file)) as panel:
        page = open_page(f"{panel.url}/digitize.html?recording=jump-2")
        page.locator("#login-token").fill("a-token-to-watch-with")
        page.locator("#login-submit").click()
        page.locator("#operator-name").fill("Cara")
        page.locator("#operator-submit").click()
        expect(page.locator(".only-watching")).to_be_visible()
        for tool in ("undo", "act-remove", "track-on", "orient-clicked", "compute", "import-choose"):
            expect(page.locator(f"#{tool}")).to_be_hidden()
        page.keyboard.press("Enter")
        page.keyboard.press("Enter")
        expect(page.locator("#snacks")).to_contain_text("you may look at what was measured")
        page.close()
    assert not (service.catalogue.directory / "jump-2.digitized").exists()


def test_a_phone_has_pictures_and_slider_on_one_screen(desk: Desk, open_page: Open) -> None:
    page = enter(open_page, desk, width=360, height=780, has_touch=True, is_mobile=True)
    for width, height, scrolled in ((360, 780, 0), (780, 360, "document.querySelector('.view-tools').offsetTop")):
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(f"scrollTo(0, {scrolled})")
        for part in ('.pane[data-camera="K1"] canvas', '.pane[data-camera="K3"] canvas', "#pulse-slider"):
            box = page.locator(part).bounding_box()
            assert box is not None
            assert box["y"] >= 0, (width, part)
            assert box["y"] + box["height"] <= height, (width, part)
        slider = page.locator("#pulse-slider").bounding_box()
        assert slider is not None
        assert slider["width"] > 300


@pytest.mark.parametrize(("width", "height"), [(360, 780), (780, 360)], ids=["upright", "across"])
def test_on_a_phone_one_picture_is_large_and_a_finger_on_a_small_one_only_enlarges_it(
    desk: Desk, open_page: Open, width: int, height: int
) -> None:
    page = enter(open_page, desk, width=width, height=height, has_touch=True, is_mobile=True)
    fingers = Fingers(page)
    expect(page.locator("#view-large")).to_be_hidden()
    page.locator("#panes").evaluate("panes => panes.scrollIntoView({ block: 'center' })")
    for tapped, large in (('.pane[data-camera="K1"] .pane-name', "K2"), ('.pane[data-camera="K3"] canvas', "K3")):
        box = page.locator(tapped).bounding_box()
        assert box is not None
        fingers.down((box["x"] + box["width"] / 2, box["y"] + box["height"] / 2))
        fingers.up()
        expect(page.locator(f'.pane[data-camera="{large}"]')).to_have_class(re.compile("active"))
        settled(page)
        sizes = {camera: canvas_of(page, camera) for camera in ("K1", "K2", "K3")}
        assert sizes[large]["width"] > 0.6 * width, sizes
        assert all(sizes[small]["height"] < 0.6 * sizes[large]["height"] for small in sizes if small != large)
    assert desk.session()["revision"] == 0, "nothing was measured by that"
    picture = canvas_of(page, "K3")
    fingers.down((picture["x"] + picture["width"] / 2, picture["y"] + picture["height"] / 2))
    fingers.up()
    desk.wait_for(1)
    assert desk.mark("K3", "P1") is not None


@pytest.mark.parametrize(
    ("look", "width", "locale"),
    [
        ("dark", 360, "nb-NO"),
        pytest.param("light", 768, "en-GB", marks=pytest.mark.long),
        pytest.param("light", 1280, "nb-NO", marks=pytest.mark.long),
    ],
)
def test_narrow_screens_gloves_and_axe(desk: Desk, open_page: Open, look: str, width: int, locale: str) -> None:
    page = enter(open_page, desk, width=width, height=800, locale=locale, color_scheme=look, reduced_motion="reduce")
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    page.locator("#picture > summary").click()
    page.locator(".desk-more > details:last-child > summary").click()
    expect(page.locator('[data-of="P1"]')).to_be_visible()
    assert page.evaluate("document.documentElement.scrollWidth") == width
    assert not page.evaluate(TOO_SMALL, SMALLEST_TOUCH_PX)
    assert not page.evaluate(BROKEN)
    if not AXE.exists():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {AXE.parents[2]}, or `make test`")
    page.evaluate(AXE.read_text())
    assert not _grave(page)
    page.keyboard.press("?")
    expect(page.locator("#help")).to_be_visible()
    assert not _grave(page), "help"
    expect(page.locator("#help-title")).to_have_text(re.compile("Hjelp" if locale == "nb-NO" else "Help"))
