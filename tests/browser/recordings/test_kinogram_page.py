"""The kinogram's own page in a real browser: on a phone, dark and light, and on paper."""

import re
from dataclasses import replace
from datetime import timedelta

import pytest
from playwright.sync_api import expect

from analysis.report.kinogram.earlier import read_earlier
from analysis.report.kinogram.folder import write_kinograms
from analysis.result.model import Quantity
from tests.analysis.report.jumps import jump_log, measured_recording, measurements
from tests.analysis.simulated import true_cameras
from tests.browser.conftest import Open
from tests.browser.views import AXE

_EVERY = 7  # the edge has a picture then, and the other places have none


@pytest.fixture(scope="module")
def kinogram(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of a page with pictures, places without one, and marks."""
    folder = tmp_path_factory.mktemp("kinogram")
    log = jump_log(_EVERY)
    given = measured_recording(), measurements(), true_cameras(), log, folder
    write_kinograms(*given)
    (own,) = read_earlier(folder)
    earlier = [
        replace(
            own,
            time=own.time - timedelta(days=day),
            figures={
                name: Quantity(q.value - (name == "takeoff_speed") + (name == "v_angle") * 9 + day / 99, 0.01)
                for name, q in own.figures.items()
            },
        )
        for day in range(1, 6)
    ]
    write_kinograms(*given, earlier=earlier)
    return (folder / "kinogram.html").as_uri()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_all_of_it_without_scripts(kinogram: str, open_page: Open, scheme: str) -> None:
    page = open_page(kinogram, width=360, color_scheme=scheme, bypass_csp=True)
    assert page.evaluate("document.documentElement.scrollWidth") == 360
    expect(page.locator("figure")).to_have_count(5)
    expect(page.locator("figure image")).to_have_count(1)
    expect(page.locator(".mark.good")).to_have_text(re.compile(r"^better \+\d\.\d+ bedre$"))
    expect(page.locator(".mark.other").first).to_have_text(re.compile(r"^lower .\d+ lavere$"))
    if not AXE.exists():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {AXE.parents[2]}, or `make test`")
    page.add_script_tag(path=AXE)
    found = page.evaluate("async () => (await axe.run()).violations.map(v => [v.id, v.nodes.map(n => n.html)])")
    assert found == []


def test_it_is_one_sheet_of_paper(kinogram: str, open_page: Open) -> None:
    page = open_page(kinogram)
    sheet = page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type /Page\b(?!s)", sheet)) == 1
