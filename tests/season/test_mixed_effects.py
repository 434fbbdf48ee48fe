"""Athletes, days and hills at once, against the effects that a season was drawn with."""

import json
from pathlib import Path

import numpy as np
import pytest

from season.running.logs import find_logs
from season.tables.database import build, opened
from season.tables.mixed_effects import TooLittleError, mixed_effects
from tests.season.drawn import ATHLETE, DAY, JUMP, SIGMA, draw_season
from tests.support.commands import run_svev


def test_effects_are_those_that_were_drawn(tmp_path: Path) -> None:
    season = draw_season(tmp_path, jumps=400, athletes=12, days=12)
    season.campaign.out.mkdir()
    build(season.campaign, find_logs(season.campaign))
    done = run_svev("season", "compare", "--in", str(season.file), "--json", timeout_s=120)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    middle = float(np.mean(list(season.effects.values())))
    off = [
        (effect["value"] - (season.effects[effect["name"]] - middle)) / effect["sigma"] for effect in found["athletes"]
    ]
    assert np.abs(off).max() < 4
    assert float(np.sqrt(np.mean(np.square(off)))) < 1.6
    assert found["sd_rest"] == pytest.approx(np.hypot(JUMP, SIGMA), rel=0.1)
    assert 0.4 * DAY < found["sd_days"] < 1.8 * DAY
    assert 0.5 * ATHLETE < found["sd_athletes"] < 1.7 * ATHLETE
    (hill,) = found["hills"]
    assert abs(hill["value"]) < 4 * hill["sigma"]
    assert found["sigma"] == pytest.approx(SIGMA)


@pytest.mark.parametrize(
    ("jumps", "athletes", "days", "message"),
    [
        (20, 4, 5, "good jumps"),
        (60, 2, 5, "2 athletes"),
        (60, 5, 1, "2 days"),
        (60, 60, 30, "twice|share no day"),
    ],
)
def test_too_little_is_refused_with_its_reason(
    tmp_path: Path, jumps: int, athletes: int, days: int, message: str
) -> None:
    season = draw_season(tmp_path, jumps=jumps, athletes=athletes, days=days)
    season.campaign.out.mkdir()
    build(season.campaign, find_logs(season.campaign))
    with opened(season.campaign.out) as database, pytest.raises(TooLittleError, match=message):
        mixed_effects(database, "alpha", 10)
