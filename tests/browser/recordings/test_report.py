"""The coach's page in a real browser: scrubbing, keys, sizes, accessibility."""

import re

import pytest
from playwright.sync_api import Page, expect

from analysis.report.coach import report_page
from analysis.result.model import Quantity
from tests.analysis.report.jumps import jump_log, measured_recording, measurements
from tests.analysis.simulated import true_cameras
from tests.browser.conftest import Open
from tests.browser.views import AXE

_EVERY = 12  # few pulses have pictures, to save time


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of a page."""
    folder = tmp_path_factory.mktemp("page")
    log = jump_log(_EVERY)
    page = report_page(measured_recording(), measurements(), true_cameras(), log, {1: Quantity(2.052, 0.006)})
    (folder / "report.html").write_text(page, encoding="utf-8")
    return (folder / "report.html").as_uri()


def _mark(page: Page) -> float:
    return float(page.locator(".mark").first.get_attribute("x1") or "nan")


def test_the_slider_moves_pictures_numbers_and_marks(report: str, open_page: Open) -> None:
    page = open_page(report)
    slider, words = page.get_by_role("slider"), page.locator("output")
    slider.fill(str(2 * _EVERY))
    first, mark, stick = words.inner_text(), _mark(page), page.locator(".stick polyline.body").get_attribute("points")
    expect(page.locator(".view img").nth(1)).to_have_js_property("complete", True)
    assert page.locator(".view img").nth(1).evaluate("image => image.naturalWidth") >= 160
    slider.press("ArrowRight")
    expect(words).not_to_have_text(first)
    assert _mark(page) > mark
    assert page.locator(".stick polyline.body").get_attribute("points") != stick
    expect(page.locator(".view p").nth(1)).to_be_visible()  # this pulse has no picture, and says so
    page.locator("h1").click()
    page.keyboard.press("ArrowLeft")
    expect(words).to_have_text(first)
    page.get_by_role("button", name="one pulse on").click()
    expect(words).not_to_have_text(first)


def test_it_plays_to_the_end_and_stops(report: str, open_page: Open) -> None:
    page = open_page(report)
    slider = page.get_by_role("slider")
    last = int(slider.get_attribute("max") or 0)
    slider.fill(str(last - 3))
    page.get_by_role("button", name="Play").click()
    expect(page.get_by_role("button", name="Pause")).to_be_visible()
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    assert int(slider.input_value()) == last


def test_the_stick_figure_turns(report: str, open_page: Open) -> None:
    page = open_page(report, width=360)
    skis = page.locator(".stick polyline.right")
    side = skis.get_attribute("points")
    page.get_by_role("button", name="above").click()
    assert skis.get_attribute("points") != side
    expect(page.get_by_role("button", name="above")).to_have_attribute("aria-pressed", "true")
    page.get_by_role("button", name="side").click()
    assert skis.get_attribute("points") == side


@pytest.mark.parametrize(("scheme", "locale"), [("light", "en-GB"), ("dark", "nb-NO")])
def test_a_phone_shows_all_without_scrolling_sideways(report: str, open_page: Open, scheme: str, locale: str) -> None:
    page = open_page(report, width=360, color_scheme=scheme, locale=locale, bypass_csp=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    small = "[...document.querySelectorAll('button')].map(b => b.getBoundingClientRect()).filter(r => r.height < 44)"
    assert page.evaluate(f"{small}.length") == 0
    if not AXE.exists():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {AXE.parents[2]}, or `make test`")
    page.add_script_tag(path=AXE)
    found = page.evaluate("async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])")
    assert found == []


def test_it_speaks_the_language_of_the_browser_and_the_one_chosen(report: str, open_page: Open) -> None:
    page = open_page(report, locale="nb-NO")
    expect(page.locator("html")).to_have_attribute("lang", "nb")
    expect(page.get_by_role("button", name="Spill av")).to_be_visible()
    expect(page.locator(".verdict strong:visible")).to_have_text("Du kan stole på disse tallene")
    value = page.locator(".five .value").nth(1)
    expect(value).to_have_text("2,052")
    page.get_by_role("slider").fill("12")
    expect(page.locator("output")).to_have_text(re.compile(r"^.?\d,\d{3}.s · .*\d,\d m · puls \d+$"))
    expect(page.locator(".charts svg text:visible", has_text="avstand fra satsen (m)").first).to_be_visible()
    page.get_by_role("button", name="English").click()
    expect(page.get_by_role("button", name="Play")).to_be_visible()
    expect(page.get_by_role("button", name="English")).to_have_attribute("aria-pressed", "true")
    expect(page.locator(".verdict strong:visible")).to_have_text("You can rely on these numbers")
    expect(value).to_have_text("2.052")
    expect(page.locator("output")).to_have_text(re.compile(r" · pulse \d+$"))
    assert page.locator(".scrubber").get_attribute("aria-label") == "Frame by frame"


@pytest.mark.parametrize("locale", ["en-GB", "nb-NO"])
def test_no_word_of_a_title_is_broken_on_a_phone(report: str, open_page: Open, locale: str) -> None:
    page = open_page(report, width=360, locale=locale)
    broken = page.locator(".five dt > span:visible").evaluate_all(
        """titles => titles.flatMap(title => [...title.textContent.matchAll(/[^\\s-]+/g)].filter(word => {
          const range = document.createRange();
          range.setStart(title.firstChild, word.index);
          range.setEnd(title.firstChild, word.index + word[0].length);
          return range.getClientRects().length > 1;
        }).map(word => word[0]))"""
    )
    assert page.locator(".five dt").count() == 5
    assert broken == []


def test_paper_shows_pictures_and_no_buttons(report: str, open_page: Open) -> None:
    page = open_page(report)
    expect(page.locator(".stills")).to_be_hidden()
    page.emulate_media(media="print")
    expect(page.locator(".stills svg").first).to_be_visible()
    expect(page.get_by_role("button", name="Play")).to_be_hidden()
