"""The global test: chance, misjudged sigmas and nonsense are told apart."""

import pytest

from photogrammetry.adjustment.solution.global_test import GLOBAL_RISK, GlobalTest, Verdict


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


def test_limits_are_those_of_the_risk() -> None:
    for limit in GlobalTest(1.0, 20).limits:
        assert GlobalTest(limit, 20).chance == pytest.approx(GLOBAL_RISK)
