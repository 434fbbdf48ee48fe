"""Operators who scatter and err by known amounts: the report finds both."""

import numpy as np
import pytest

from analysis.digitizing.geometry.repeatability import repeatability
from analysis.digitizing.marks.journal import Entered, Key
from rig.api.digitizing import MarkState
from rig.errors import BadInputError

BIAS = {"Anna": (0.0, 0.0), "Bo": (0.4, -0.2), "Cy": (0.0, 0.1)}


def _marks(operator: str, sigma: float, seed: int) -> list[tuple[Key, Entered]]:
    random = np.random.default_rng(seed)
    marks = []
    for pulse in range(200):
        x, y = (pulse, 2 * pulse) + random.normal(0, sigma, 2) + BIAS[operator]
        marks.append((Key(pulse, "K1", "P1"), Entered(MarkState.MEASURED, (x, y))))
    return marks


def test_scatter_and_bias_are_found() -> None:
    marks = {operator: _marks(operator, 0.3, seed) for seed, operator in enumerate(BIAS)}
    figures = {
        operator: {pulse: {"alpha": 40 + BIAS[operator][0] + (seed - 1) * (-1) ** pulse} for pulse in range(50)}
        for seed, operator in enumerate(BIAS)
    }
    report = repeatability(marks, figures)
    assert report.things["P1"].count == 200
    assert report.things["P1"].sigma_px == pytest.approx(0.3, rel=0.1)
    mean = np.mean(list(BIAS.values()), axis=0)
    for operator, bias in BIAS.items():
        assert report.things["P1"].bias_px[operator] == pytest.approx(np.array(bias) - mean, abs=0.08)
        assert report.figures["alpha"].bias[operator] == pytest.approx(bias[0] - mean[0], abs=1e-9)
    assert report.figures["alpha"].sigma == pytest.approx(1.0, rel=0.02)


def test_guesses_and_other_pulses_are_not_compared() -> None:
    anna = [*_marks("Anna", 0.3, 1)[:2], (Key(5, "K1", "P1"), Entered(MarkState.GUESS, (1.0, 1.0)))]
    with pytest.raises(BadInputError, match="fewer than 3 points in common"):
        repeatability({"Anna": anna, "Bo": _marks("Bo", 0.3, 2)}, {"Anna": {}, "Bo": {}})
    with pytest.raises(BadInputError, match="name two operators or more"):
        repeatability({"Anna": anna}, {"Anna": {}})
