"""Similarity transformation: exact, least squares, and points that leave it open."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.geometry.similarity import Similarity, fit_similarity
from rig.errors import BadInputError

seeds = st.integers(0, 2**32 - 1)


def _random(rng: np.random.Generator) -> Similarity:
    return Similarity(float(10 ** rng.uniform(-3, 3)), rotation_from_vector(rng.normal(0, 2, 3)), rng.normal(0, 1e3, 3))


@settings(max_examples=30)
@given(seeds, st.integers(3, 12), st.booleans())
def test_exact(seed: int, n: int, planar: bool) -> None:
    rng = np.random.default_rng(seed)
    true = _random(rng)
    source = rng.normal(0, 5, (n, 3))
    if planar:
        source[:, 2] = 0.0
    fit = fit_similarity(source, true.apply(source))
    assert fit.scale == pytest.approx(true.scale, rel=1e-9)
    np.testing.assert_allclose(fit.rotation, true.rotation, atol=1e-7)
    np.testing.assert_allclose(fit.apply(source), true.apply(source), atol=1e-9 * true.scale + 1e-9)
    np.testing.assert_allclose(fit.turn(np.eye(3)), true.rotation, atol=1e-7)


def test_is_the_minimum_and_sigma0_is_that_of_the_noise() -> None:
    rng = np.random.default_rng(3)
    true = _random(rng)
    source = rng.normal(0, 5, (400, 3))
    target = true.apply(source) + rng.normal(0, 0.01, (400, 3))
    found = fit_similarity(source, target)
    best = ((found.apply(source) - target) ** 2).sum()
    for turn in np.vstack((np.eye(3), -np.eye(3))) * 1e-5:
        other = Similarity(found.scale, rotation_from_vector(turn) @ found.rotation, found.translation)
        centred = other.apply(source) - target
        centred -= centred.mean(axis=0)
        assert (centred**2).sum() > best
    for factor in (1 - 1e-6, 1 + 1e-6):
        fixed = fit_similarity(source, target, scale=found.scale * factor)
        assert ((fixed.apply(source) - target) ** 2).sum() > best
    # relative standard deviation of sigma0: 1 / sqrt(2 r) = 2 %; five of them
    assert np.sqrt(best / (3 * 400 - 7)) == pytest.approx(0.01, rel=0.1)


def test_points_that_leave_it_open_are_refused() -> None:
    line = np.outer(np.arange(5.0), (1.0, 2.0, 3.0))
    with pytest.raises(BadInputError, match="lie on a line: add one beside it"):
        fit_similarity(line, 2 * line)
    with pytest.raises(BadInputError, match="2 common points: give at least three"):
        fit_similarity(line[:2], line[:2])
