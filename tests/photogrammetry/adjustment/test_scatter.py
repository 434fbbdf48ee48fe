"""Simulated repetitions scatter as the covariance says."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.adjustment.equations.problem import build_problem
from photogrammetry.adjustment.solution.adjustment import adjust_once, refine
from tests.photogrammetry.synthetic import Synthetic, hill, lab_frame, rods, with_noise, with_state
from tests.support.repeats import repeats

_RUNS = 200


@pytest.mark.parametrize(
    "case",
    repeats([lambda: hill(1, noise=0.0), lambda: lab_frame(5, points=16, noise=0.0), lambda: rods(1, noise=0.0)]),
    ids=["hill", "lab", "rods"],
)
def test_scatter_equals_covariance(case: Callable[[], Synthetic]) -> None:
    """Standardised errors have mean square one: its sigma is below sqrt(2 / runs) = 0.1 for a single unknown."""
    made = case()
    exact = with_state(made.network, made.truth)
    reference = adjust_once(exact, made.truth)
    rng = np.random.default_rng(11)
    unknowns = reference.problem.unknowns
    squares, sums, ratios = np.zeros(unknowns.count), np.zeros(unknowns.count), []
    for _ in range(_RUNS):
        noisy = replace(with_noise(exact, rng, 0.1), datum=exact.datum)  # small: the covariance is linear
        adjusted = refine(build_problem(noisy), reference)
        ratios.append(adjusted.ratio)
        moved = np.zeros(unknowns.count)
        moved[unknowns.point[unknowns.point >= 0]] = (adjusted.state.xyz - reference.state.xyz)[unknowns.point >= 0]
        positions = adjusted.state.position - reference.state.position
        moved[unknowns.pose[:, :3].ravel()] = positions.ravel()
        interior = (adjusted.state.interior - reference.state.interior)[:, unknowns.selection]
        moved[unknowns.camera[unknowns.camera >= 0]] = interior[unknowns.camera >= 0]
        squares += (moved / 0.1) ** 2
        sums += moved / 0.1
    tested = np.concatenate([unknowns.point.ravel(), unknowns.pose[:, :3].ravel(), unknowns.camera.ravel()])
    tested = tested[tested >= 0]
    variance = np.diagonal(reference.cofactors)[tested]
    spread = squares[tested] / _RUNS / variance
    assert spread.mean() == pytest.approx(1.0, abs=0.1)
    assert np.all((spread > 0.55) & (spread < 1.6))  # 4.5 and more sigma of a single one
    bias = sums[tested] / _RUNS / np.sqrt(variance / _RUNS)
    assert np.abs(bias).max() < 4.5
    # the estimated sigma0 is unbiased as well
    expected = 0.1 * (1.0 - 0.25 / reference.redundancy)
    assert np.mean(ratios) == pytest.approx(expected, abs=4.0 * 0.1 / np.sqrt(2.0 * reference.redundancy * _RUNS))
