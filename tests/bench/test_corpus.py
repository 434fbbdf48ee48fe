"""The yardstick of the analysis: scenes drawn at random, judged, summed up."""

import json
from pathlib import Path

import msgspec
import pytest

from bench.corpus.__main__ import main
from bench.corpus.draws import PIXELS_MOST, Half, draw
from bench.corpus.judging import Row
from bench.corpus.tables import GROUPS, summed, table

#: Pixels of a log that is quickly rendered and measured.
_FEW = 40_000_000


def test_the_same_number_gives_the_same_scene_and_no_scene_is_in_both_halves() -> None:
    names = [draw(half, number).scenario.name for half in Half for number in range(10)]
    assert names == [draw(half, number).scenario.name for half in Half for number in range(10)]
    assert len(set(names)) == len(names)


def test_scenes_are_of_many_kinds_and_none_is_too_large() -> None:
    scenes = [draw(Half.WORK, number) for number in range(40)]
    assert len({len(scene.scenario.cameras) for scene in scenes}) >= 3
    assert len({scene.size for scene in scenes}) >= 4
    assert len({scene.rate_hz for scene in scenes}) >= 4
    assert {scene.renderer for scene in scenes} == {"hill", "drawn"}
    assert {len({camera.X0[1] > 0 for camera in scene.scenario.cameras}) for scene in scenes} == {1, 2}
    for scene in scenes:
        assert len(scene.pulses) * len(scene.scenario.cameras) * scene.size[0] * scene.size[1] <= PIXELS_MOST


@pytest.mark.long
def test_a_scene_is_rendered_measured_and_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    asked = ["--scenes", "1", "--first", "1", "--pixels", str(_FEW), "--workers", "1", "--results", str(tmp_path)]
    main([*asked, "--cache", str(tmp_path / "rows")])
    (kept,) = (tmp_path / "rows").glob("*/work-1.json")
    row = msgspec.json.decode(kept.read_bytes(), type=Row)
    assert row.error == ""
    assert 0 < row.solved <= row.points
    assert row.oriented == row.cameras
    assert row.pose[1] == 6 * row.cameras
    assert row.squares["raw flight points"][0] > 0
    assert row.cpu_s > 0
    (case,) = json.loads((tmp_path / "corpus-work.json").read_text())["cases"]
    assert case["groups"]["all"]["figures"]["points solved"] == pytest.approx(row.solved / row.points)
    assert "before" not in capsys.readouterr().out
    changed = msgspec.structs.replace(row, solved=row.points)
    kept.write_bytes(msgspec.json.encode(changed))
    main([*asked, "--cache", str(tmp_path / "rows")])
    assert f"before {row.solved / row.points:9.3f}" in capsys.readouterr().out


def _row(number: int, **of: object) -> Row:
    return msgspec.convert(
        {"half": "work", "number": number, "cameras": 3, "width": 640, "marker_px": 2.5, "renderer": "hill"} | of, Row
    )


def test_shares_are_of_all_scenes_together_and_sigmas_of_their_scatter() -> None:
    rows = [_row(0, points=100, solved=50), _row(1, points=300, solved=300, width=320)]
    both = summed(rows)
    assert both.figures["points solved"] == pytest.approx(350 / 400)
    assert both.figures["skis solved"] is None
    # Ratio estimator: residuals 50 - 0.875 * 100 = -37.5 and 300 - 0.875 * 300 = 37.5, twice their squares, of 400.
    assert both.sigmas["points solved"] == pytest.approx((2 * 2 * 37.5**2) ** 0.5 / 400)
    assert summed([row for row in rows if GROUPS["rigs for measurements"](row)]).scenes == 1


def test_errors_over_sigma_are_root_mean_squares_over_all_phases() -> None:
    rows = [
        _row(0, squares={"raw edge points": (10, 40.0), "raw flight points": (30, 0.0), "raw flight phi": (1, 9.0)})
    ]
    assert summed(rows).figures["raw points"] == pytest.approx(1.0)
    assert summed(rows).figures["raw phi"] == pytest.approx(3.0)
    assert summed(rows).figures["smoothed points"] is None


def test_a_difference_beyond_the_scatter_is_pointed_at() -> None:
    def rows(solved: int) -> list[Row]:
        return [_row(n, points=100, solved=solved + n % 3) for n in range(30)]

    before = {"all": msgspec.to_builtins(summed(rows(60)))}
    (line,) = [line for line in table(rows(80), before) if "points solved" in line and "before" in line]
    assert line.endswith("<- differs")
    (line,) = [line for line in table(rows(60), before) if "points solved" in line and "before" in line]
    assert not line.endswith("<- differs")
