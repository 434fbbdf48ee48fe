"""The global test: chance, misjudged sigmas and nonsense are told apart."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from photogrammetry.adjustment.solution.global_test import GLOBAL_RISK, GlobalTest, Verdict
from photogrammetry.adjustment.solution.statistics import posterior_scale
from photogrammetry.network.file_writer import write_network
from svev.cli import main
from tests.photogrammetry.synthetic import hill


@pytest.mark.parametrize(
    ("ratio", "redundancy", "verdict"),
    [
        (1.09, 133, Verdict.AGREES),
        (1.09, 3725, Verdict.LARGER),
        (0.85, 133, Verdict.AGREES),
        (0.5, 133, Verdict.SMALLER),
        (1.6, 133, Verdict.LARGER),
        (42.8, 133, Verdict.ABSURD),
        (3.0, 1, Verdict.LARGER),
        (2.0, 1, Verdict.AGREES),
        (float("nan"), 5, Verdict.ABSURD),
        (1.0, 0, Verdict.UNTESTED),
    ],
)
def test_verdict(ratio: float, redundancy: int, verdict: Verdict) -> None:
    assert GlobalTest(ratio, redundancy).verdict is verdict


@pytest.mark.parametrize(
    ("square_sum", "redundancy", "scale"),
    [
        (18.0, 2, 3.0),
        (0.08, 2, (4.08 / 6.0) ** 0.5),
        (0.5, 6, (4.5 / 10.0) ** 0.5),
        (1e-12, 2, (1e-12 / 2.0) ** 0.5),
        (2e-8, 6, (2e-8 / 6.0) ** 0.5),
        (20.0, 31, (20.0 / 31.0) ** 0.5),
        (2980.0, 3725, 0.8**0.5),
        (0.0, 0, 1.0),
    ],
)
def test_sigmas_carry_the_estimated_sigma0_but_chance_shrinks_none(
    square_sum: float, redundancy: int, scale: float
) -> None:
    """With few redundant observations the a-priori variance counts as four more, unless chance cannot explain it."""
    assert posterior_scale(square_sum, redundancy) == pytest.approx(scale)


def test_limits_are_those_of_the_risk() -> None:
    for limit in GlobalTest(1.0, 20).limits:
        assert GlobalTest(limit, 20).chance == pytest.approx(GLOBAL_RISK)


@pytest.mark.parametrize(
    ("factor", "words", "verdict"),
    [
        (1.0, "agree with their sigmas", "agrees"),
        (0.25, "times less accurate than their sigmas say, which is not chance", "larger"),
        (0.02, "do not use this result", "absurd"),
    ],
)
def test_the_sentence_depends_on_it(
    factor: float, words: str, verdict: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    network = hill(1).network
    o = network.observations
    points = tuple(p if p.sigma is None else replace(p, sigma=p.sigma * factor) for p in network.points)
    network = replace(network, observations=replace(o, sigma=o.sigma * factor), points=points)
    write_network(network, tmp_path / "hill.json")
    assert main(["adjust", str(tmp_path / "hill.json"), "--force", "-o", str(tmp_path / "result.json")]) == 0
    assert words in capsys.readouterr().out
    assert json.loads((tmp_path / "result.json").read_text())["global_test"]["verdict"] == verdict
