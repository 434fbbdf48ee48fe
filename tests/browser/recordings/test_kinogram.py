"""The kinogram on the page of a recording: seen, large by a tap, sent."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from rig.api.measuring import MeasuringQueue, MeasuringState
from service.measuring.keeping import keep_renamed
from service.measuring.results import names_of
from tests.browser.conftest import Open, write_kinogram
from tests.browser.views import assert_fits_a_phone
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel

#: A phone whose browser can share files: what is shared stays in `window.shared`.
PHONE = """
navigator.canShare = ({ files }) => files.every((file) => file.type === "image/jpeg");
navigator.share = async ({ files }) => { window.shared = files.map(({ name, size }) => [name, size]); };
"""


def _first_card(page: Page) -> str | None:
    return page.locator("#recording .card:visible").first.get_attribute("id")


def test_the_picture_comes_first_is_shown_large_and_saved(panel: Panel, jumps: None, open_page: Open) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    picture = page.locator("#kinogram-jumps img")
    expect(picture).to_have_js_property("naturalWidth", 1080)
    assert _first_card(page) == "kinogram"
    expect(picture).to_have_attribute("alt", re.compile(r"^Kinogram of 4 · Ola <b>Nordmann</b>: pictures "))
    page.get_by_title("Show it large").click()
    expect(page.locator("#kinogram-picture")).to_be_visible()
    assert page.locator("#kinogram-picture").evaluate("image => image.clientWidth") > 1000
    page.get_by_role("button", name="Close").click()
    expect(page.locator("#kinogram-picture")).to_be_hidden()
    with page.expect_download() as got:
        page.get_by_role("link", name="Save the picture").click()
    assert got.value.suggested_filename == "jump-2-kinogram.jpg"
    with page.expect_popup() as opened:
        page.get_by_role("link", name="As a page, to print").click()
    expect(opened.value.locator("h1")).to_have_text("Five pictures")
    expect(page.locator("#measurement-others a")).to_have_text(["jumper.json", "protocol.txt"])
    page.goto(f"{panel.url}/#/recordings/jump-1")
    expect(page.locator("#recording-title")).to_have_text("17 · Anna Berg")
    expect(page.locator("#kinogram")).to_be_hidden()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_sends_it(panel: Panel, jumps: None, open_page: Open, scheme: str) -> None:
    look = {"width": 360, "height": 780, "locale": "nb-NO", "color_scheme": scheme}
    page = open_page(panel.url, **look, has_touch=True, is_mobile=True)
    page.add_init_script(PHONE)
    page.goto(f"{panel.url}/?phone#/recordings/jump-2")
    page.get_by_role("button", name="Send").tap()
    page.wait_for_function("window.shared")
    ((name, size),) = page.evaluate("window.shared")
    assert name == "jump-2-kinogram.jpg"
    assert size > 1000
    assert_fits_a_phone(page)
    page.get_by_title("Vis stort").tap()
    expect(page.locator("#kinogram-picture")).to_be_visible()
    page.locator("#kinogram-picture").tap()
    expect(page.locator("#kinogram-picture")).to_be_hidden()


def test_a_picture_with_the_name_before_a_correction_is_nowhere_until_it_is_drawn_anew(
    panel: Panel, service: MemoryService, jumps: None, open_page: Open, tmp_path: Path
) -> None:
    page = open_page(f"{panel.url}/#/recordings/jump-2")
    picture = page.locator("#kinogram-jumps img")
    expect(picture).to_have_js_property("naturalWidth", 1080)
    page.locator("#recording-athlete").fill("Kari")
    page.locator("#recording-athlete").press("Enter")
    expect(page.locator("#kinogram")).to_be_hidden()
    expect(page.locator("#measurement-state")).to_contain_text("The corrected name is being written")
    expect(page.get_by_role("link", name="The coach's page")).to_have_count(0)
    with panel.client() as client:
        for name in ("report.html", "kinogram.jpg", "kinogram.html", "jumper.json"):
            assert client.get(f"/api/recordings/jump-2/measurement/files/{name}").status_code == 409
    log, made = service.catalogue.file("jump-2"), tmp_path / "made"
    made.mkdir()
    write_kinogram(made, "4", "Kari", width=900)
    keep_renamed(made, log, names_of(log))
    service.measuring = MeasuringQueue(recording="jump-2", state=MeasuringState.MEASURING)
    service._wake()
    expect(picture).to_have_js_property("naturalWidth", 900)
    expect(page.get_by_role("link", name="The coach's page")).to_be_visible()
