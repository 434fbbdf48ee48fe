"""The page of a season: what it says, where its dots lead, and how it looks in a browser."""

import re
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest

from season.campaign import read_campaign
from season.page.content import Means
from season.page.drawings import hill_chart
from season.page.page import write_page
from season.page.words import TEXTS, counted
from season.running.logs import find_logs
from season.running.outcome import LogState
from season.running.task import give_up
from season.tables.comparison import groups
from season.tables.database import build, opened
from tests.season.drawn import draw_season
from tests.season.files import campaign_file, log_file


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    season = draw_season(tmp_path_factory.mktemp("a season"), jumps=160, years=2)
    season.campaign.out.mkdir()
    build(season.campaign, find_logs(season.campaign))
    return write_page(season.campaign.out)


def test_every_dot_leads_to_a_report(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    links = re.findall(r'<a href="([^"]+)"', text)
    assert len(links) > 160 * 2
    folders = {Path(page.parent, unquote(link)).resolve().parent for link in links}
    assert folders <= set(page.parents[1].glob("*/*.season"))
    assert len(folders) == 160
    assert not re.search(r"(?:src|href)=\"(?:https?:|//)|<script", text)


def test_stars_are_those_of_the_comparison(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    with opened(page.parent) as database:
        starred = {group.of["athlete"] for group in groups(database, "alpha", 10) if group.differs}
    alpha = text.split("<details")[1]
    assert starred
    assert set(re.findall(r'<strong>([^<]+) <b class="star">', alpha)) == starred


def test_a_season_without_jumps_names_what_was_passed_over(tmp_path: Path) -> None:
    log_file(tmp_path / "hill" / "a<b>.mcap")
    campaign = read_campaign(campaign_file(tmp_path))
    campaign.out.mkdir()
    (log,) = find_logs(campaign)
    assert give_up(log, {}, "is <damaged>", 1.0).state is LogState.FAILED
    build(campaign, find_logs(campaign))
    text = write_page(campaign.out).read_text(encoding="utf-8")
    assert "No jump is measured yet." in text
    assert "is &lt;damaged&gt;" in text
    assert "a&lt;b&gt;.mcap" in text


def test_means_that_are_nearly_equal_have_a_short_scale() -> None:
    means = Means(np.arange(3.0), np.array([1.65556, 1.65557, 1.65559]), np.full(3, 1e-5))
    labels = re.findall(r'text-anchor="end"[^>]*>([^<]+)<', hill_chart({"Hill": means}, "", "m", "means"))
    assert len(labels) > 2
    assert max(map(len, labels)) <= 5, labels


def test_one_of_something_is_said_so() -> None:
    assert [counted("athletes", count) for count in (1, 2)] == [("1 athlete", "1 utøver"), ("2 athletes", "2 utøvere")]


def test_every_text_is_in_both_languages() -> None:
    for key, (english, norwegian) in TEXTS.items():
        assert english
        assert norwegian
        assert sorted(re.findall(r"{\w+}", english)) == sorted(re.findall(r"{\w+}", norwegian)), key
