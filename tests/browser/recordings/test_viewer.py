"""Looking through the frames of a recording."""

import re

from playwright.sync_api import expect

from rig.api.recordings import RecordingOrder
from tests.browser.conftest import Open
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel


def test_looking_through_a_jump(panel: Panel, jumps: None, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    where, frames = page.locator("#frame-where"), page.locator("#frames")
    expect(where).to_have_text(re.compile("^1 / 30"))
    expect(page.locator("#frames .block").nth(1).locator(".cover")).to_contain_text("lost")
    speed = page.locator("#frame-speed")
    speed.select_option(label="1/10")  # at full speed a crowded machine may see the end of this second only
    page.get_by_role("button", name="Play").click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    page.get_by_role("button", name="Pause").click()
    speed.select_option(label="1/1")
    page.locator("#frame-where").click()
    page.keyboard.press("Space")
    expect(where).to_have_text(re.compile("^30 / 30"))
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    page.keyboard.press("g")
    expect(where).to_have_text(re.compile("^1 / 30"))
    strip = page.locator(".strip-lines").bounding_box()
    assert strip is not None
    page.mouse.click(strip["x"] + strip["width"] * 0.55, strip["y"] + 5)
    expect(where).to_have_text(re.compile("^17 / 30"))

    page.get_by_role("button", name="Enlarge", exact=True).click()
    expect(frames).to_have_class(re.compile("zoomed"))
    box = frames.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 300, box["y"] + 100)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 80, steps=5)
    page.mouse.up()
    expect(frames).not_to_have_class(re.compile("single"))
    page.mouse.click(box["x"] + 300, box["y"] + 100)
    expect(frames).to_have_class(re.compile("single"))
    expect(frames).not_to_have_class(re.compile("zoomed"))


def test_a_jump_that_runs_can_be_looked_at_once_it_is_stopped(
    panel: Panel, service: MemoryService, open_page: Open
) -> None:
    service.arm()
    started = service.start_recording(RecordingOrder(bib="5"))
    page = open_page(f"{panel.url}/#/recordings/{started.id}")
    expect(page.locator("#recording-verdict")).to_contain_text("is being recorded")
    expect(page.locator("#player")).to_be_hidden()
    service.stop_recording(started.id)
    expect(page.locator("#frame-strip li")).to_have_count(1)
    expect(page.locator("#recording-verdict")).to_contain_text("Complete")
