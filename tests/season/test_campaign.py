"""The file of a campaign, and the logs that it names."""

from datetime import date
from pathlib import Path

import pytest

from rig.errors import BadInputError
from season.campaign import read_campaign
from season.running.logs import day_of, find_logs, with_outcomes
from tests.recorder.logs import write_log
from tests.recorder.split import split_log
from tests.season.drawn import draw_season
from tests.season.files import SURVEY, campaign_file, log_file


def test_places_are_relative_to_the_file(tmp_path: Path) -> None:
    campaign = read_campaign(campaign_file(tmp_path, logs=["hill", "s3://bucket/hill/*.mcap"]))
    assert campaign.out == tmp_path / "season"
    assert campaign.hills[0].logs == (str(tmp_path / "hill"), "s3://bucket/hill/*.mcap")
    assert campaign.hills[0].survey == tmp_path / "survey.json"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('surveys = "x"', 'unknown key "hills.1.surveys"; did you mean "survey"?'),
        ('calibration = "poses.json"', "give either survey or calibration"),
        ('[[hills.days]]\nfirst = 2026-12-02\nlast = 2026-12-01\nsurvey = "x"', "is before first"),
        ('[[hills]]\nname = "Hill"\nlogs = ["x"]\nsurvey = "x"', "two hills are called"),
        ("[cluster]\nmemory_gb = 0", "cluster.memory_gb"),
        ('[store]\nsecret = "x"', "secret is a secret, and others read this file"),
        ('[store]\naccount_key = "x"', "account_key is a secret"),
    ],
)
def test_what_is_wrong_in_the_file_is_said(tmp_path: Path, more: str, message: str) -> None:
    with pytest.raises(BadInputError, match=message.replace("[", r"\[").replace("?", r"\?")):
        read_campaign(campaign_file(tmp_path, more=more))


def test_logs_are_found_in_folders_and_by_patterns_each_once(tmp_path: Path) -> None:
    deep, flat = log_file(tmp_path / "hill" / "day" / "b.mcap"), log_file(tmp_path / "hill" / "a.mcap")
    campaign = read_campaign(campaign_file(tmp_path, logs=["hill", "hill/*.mcap", "hill/a.mcap"]))
    assert [log.url for log in find_logs(campaign)] == [str(flat), str(deep)]


def test_a_split_recording_is_measured_once(tmp_path: Path) -> None:
    write_log(tmp_path / "whole.mcap")
    (tmp_path / "hill").mkdir()
    first, *_ = split_log(tmp_path / "whole.mcap", tmp_path / "hill" / "r1.mcap", (1, 2))
    campaign = read_campaign(campaign_file(tmp_path, logs=["hill"]))
    assert [log.url for log in find_logs(campaign)] == [str(first)]


def test_a_place_without_logs_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"nothing.*no log"):
        find_logs(read_campaign(campaign_file(tmp_path, logs=["nothing"])))


def test_a_log_of_two_hills_is_refused(tmp_path: Path) -> None:
    log_file(tmp_path / "hill" / "a.mcap")
    more = f'[[hills]]\nname = "Other"\nlogs = ["hill/a.mcap"]\nsurvey = "{SURVEY}"'
    with pytest.raises(BadInputError, match="belongs to Hill and to Other"):
        find_logs(read_campaign(campaign_file(tmp_path, more=more)))


def test_a_day_may_have_a_survey_of_its_own(tmp_path: Path) -> None:
    before = log_file(tmp_path / "hill" / "2026-11-21T19-40-18Z.mcap")
    after = log_file(tmp_path / "hill" / "2026-12-02T19-40-18Z.mcap")
    more = '[[hills.days]]\nfirst = 2026-12-01\nlast = 2026-12-31\nsurvey = "december.json"'
    campaign = read_campaign(campaign_file(tmp_path, more=more))
    (tmp_path / "december.json").write_text((tmp_path / SURVEY).read_text() + " ")
    found = {log.url: log.orienting.name for log in find_logs(campaign)}
    assert found == {str(before): SURVEY, str(after): "december.json"}
    log_file(tmp_path / "hill" / "jump.mcap")
    with pytest.raises(BadInputError, match="does not begin with its day"):
        find_logs(campaign)


def test_the_day_of_a_log_is_that_of_its_name() -> None:
    assert day_of("/data/2026-11-21T19-40-18Z.mcap") == date(2026, 11, 21)
    assert day_of("s3://bucket/2026-13-21T19-40-18Z.mcap") is None
    assert day_of("jump.mcap") is None


def test_a_result_by_another_survey_does_not_count(tmp_path: Path) -> None:
    season = draw_season(tmp_path, jumps=2)
    assert all(log.is_settled for log in find_logs(season.campaign))
    survey = tmp_path / SURVEY
    survey.write_text(survey.read_text() + " ")
    logs = find_logs(season.campaign)
    assert not any(log.is_settled for log in logs)
    assert [log.outcome for log in with_outcomes(logs, {})] == [None, None]
