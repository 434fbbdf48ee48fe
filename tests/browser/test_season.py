"""The page of a season in a browser: accessible, no wider than a phone, in both languages, light and dark."""

from pathlib import Path

import pytest
from playwright.sync_api import expect

from season.page.page import write_page
from season.running.logs import find_logs
from season.tables.database import build
from tests.browser.conftest import Open
from tests.browser.views import AXE, BROKEN
from tests.season.drawn import draw_season


def test_the_page_of_a_season_can_be_read_by_everybody(tmp_path: Path, open_page: Open) -> None:
    season = draw_season(tmp_path, jumps=60)
    season.campaign.out.mkdir()
    build(season.campaign, find_logs(season.campaign))
    address = write_page(season.campaign.out).as_uri()
    if not AXE.exists():
        pytest.fail(f"the npm packages are not installed: run `npm ci` in {AXE.parents[2]}, or `make test`")
    for width, scheme in ((360, "dark"), (768, "light"), (1280, "light")):
        # Its own policy forbids scripts; the checks are one.
        page = open_page(address, width=width, color_scheme=scheme, bypass_csp=True)
        page.evaluate("document.querySelectorAll('details').forEach(each => { each.open = true; })")
        assert page.evaluate("document.documentElement.scrollWidth") == width
        page.get_by_label("Norsk").check()
        expect(page.get_by_text("Kameraenes vandring")).to_be_visible()
        expect(page.get_by_text("Drift of the cameras")).to_be_hidden()
        assert page.evaluate(BROKEN) == []
        page.evaluate(AXE.read_text(encoding="utf-8"))
        found = page.evaluate("axe.run().then(({violations}) => violations.map(v => v.id + ' ' + v.nodes[0].html))")
        assert found == []
