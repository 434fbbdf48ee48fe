"""The sigma of an axis by how its points scatter: drawn points whose errors are alone, or alike in neighbours."""

import numpy as np
import pytest

from analysis.candidates.skis.axis_scatter import axis_scatter
from rig.arrays import Floats

LENGTH = 80.0  # px


def _squares(factor: float, size: float, draws: int = 150) -> tuple[Floats, Floats]:
    """Mean squares of turn and shift over their sigmas (2,): as stated, and as the points' own sigmas would have it."""
    rng, stated, own = np.random.default_rng(3), [], []
    for _ in range(draws):
        t, sigma = np.sort(rng.uniform(0, LENGTH, 16)), rng.uniform(0.05, 0.15, 16)
        covariance = factor * np.diag(sigma**2) + size**2 * np.exp(-np.abs(t[:, None] - t) / (0.15 * LENGTH))
        off = np.linalg.cholesky(covariance) @ rng.standard_normal(16)
        found = axis_scatter(t, off, sigma, LENGTH)
        stated.append(_normalized(t, off, found.sigma, found.common))
        own.append(_normalized(t, off, sigma, 0.0))
    return np.mean(np.square(stated), axis=0), np.mean(np.square(own), axis=0)


def _normalized(t: Floats, off: Floats, sigma: Floats, common: float) -> tuple[float, float]:
    weight = sigma**-2.0
    place = t - np.average(t, weights=weight)
    place /= np.sqrt(np.average(place**2, weights=weight))
    own = 1 / weight.sum()
    turn, shift = np.average(place * off, weights=weight), np.average(off, weights=weight)
    return float(turn / np.sqrt(own)), float(shift / np.hypot(np.sqrt(own), common))


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_independent_errors_are_told_by_their_size(factor: float) -> None:
    stated, own = _squares(factor, 0.0)
    assert ((stated > 0.4) & (stated < 1.3)).all()
    assert own == pytest.approx(factor, rel=0.35)


@pytest.mark.parametrize("size", [0.1, 0.3])
def test_errors_that_neighbours_share_make_the_axis_less_sure(size: float) -> None:
    stated, own = _squares(1.0, size)
    assert (stated < 3.5).all()
    assert (stated < own / 1.8).all()


def test_three_points_tell_little_and_are_believed_little() -> None:
    t, sigma = np.array((0.0, 30.0, 60.0)), np.full(3, 0.05)
    straight, bent = (axis_scatter(t, off, sigma, LENGTH) for off in (np.zeros(3), np.array((0.0, 0.5, 0.0))))
    assert 0.04 < straight.sigma.mean() < 0.1
    assert bent.sigma.mean() > 4 * straight.sigma.mean()
