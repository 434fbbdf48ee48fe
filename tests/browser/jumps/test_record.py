"""The page of a record: nothing of it is cut on a desk or on paper, and a phone shows it without scrolling aside."""

from collections.abc import Callable
from pathlib import Path

from playwright.sync_api import Page

from photogrammetry.adjustment.run import adjust
from photogrammetry.reports.adjusted import Wishes, adjusted_sections
from photogrammetry.reports.document import Report, write_report
from tests.photogrammetry.synthetic import hill

_CUT = "[...document.querySelectorAll('.table')].filter(t => t.scrollWidth > t.clientWidth + 1).length"
_WIDEST = "Math.max(...[...document.querySelectorAll('table')].map(t => t.offsetWidth))"
_PAPER = 703  # px: A4 without its margins of 12 mm


def test_no_table_is_cut(open_page: Callable[..., Page], tmp_path: Path) -> None:
    wishes = Wishes(detectable=True, covariance=("B1*",))
    _, page = write_report(Report("Hill", adjusted_sections(adjust(hill(1).network), wishes)), tmp_path)
    desk = open_page(page.as_uri(), width=1200)
    assert desk.evaluate(_CUT) == 0
    desk.emulate_media(media="print")
    desk.set_viewport_size({"width": _PAPER, "height": 1000})
    assert desk.evaluate(_WIDEST) <= _PAPER
    phone = open_page(page.as_uri(), width=360, color_scheme="dark")
    assert phone.evaluate("document.documentElement.scrollWidth") == 360  # wide tables scroll within their boxes
