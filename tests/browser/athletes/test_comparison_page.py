"""The page that compares two jumps, in a real browser: languages, a phone, accessibility."""

from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from analysis.comparison.aligned import measured_jump
from analysis.comparison.alignment import align
from analysis.comparison.difference import difference
from analysis.comparison.report import Comparison
from analysis.report.compared.page import comparison_page
from tests.analysis.result.recordings import recording
from tests.browser.conftest import Open
from tests.browser.views import AXE

_SCREENS = 3  # of a phone


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of a page."""
    alignment = align([measured_jump(recording(seed=seed, leg_deg=3.0 * seed), 1, "") for seed in range(2)])
    page = comparison_page(Comparison(alignment, difference(alignment, 400), None), (None, None))
    path: Path = tmp_path_factory.mktemp("compared") / "comparison.html"
    path.write_text(page, encoding="utf-8")
    return path.as_uri()


def test_a_phone_has_it_on_three_screens_in_both_languages(address: str, open_page: Open) -> None:
    page: Page = open_page(address, width=360, height=780)
    for language, heading in (("English", "What differs"), ("Norsk", "Hva som er ulikt")):
        page.get_by_text(language, exact=True).click()
        expect(page.get_by_role("heading", name=heading)).to_be_visible()
        wide, high = page.evaluate("[document.documentElement.scrollWidth, document.documentElement.scrollHeight]")
        assert (wide, high <= _SCREENS * 780) == (360, True), (wide, high)
    expect(page.get_by_role("heading", name="What differs")).to_be_hidden()
    for folded in page.locator("summary").all():
        folded.click()
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    expect(page.locator("figure svg:visible")).to_have_count(22)


@pytest.mark.parametrize("look", ["light", "dark"])
def test_axe_finds_nothing(address: str, open_page: Open, look: str) -> None:
    page = open_page(address, color_scheme=look, bypass_csp=True)
    for folded in page.locator("summary").all():
        folded.click()
    page.evaluate(AXE.read_text())
    found = page.evaluate("async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])")
    assert found == []
