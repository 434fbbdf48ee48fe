"""The prior of the motion: many possible times of the take-off at once are as each alone."""

from itertools import pairwise

import numpy as np

from analysis.motion.model.prior import prior, start_densities, transitions, white_jerk
from analysis.result.model import EDGE_S

UNIT = 1 / 30
TIMES = np.arange(9) * UNIT + np.array([0, 0, 0, 0, 0.01, 0, 0, 0, 0])
TAKEOFFS = np.array((-1.0, 0.0, 0.5 * UNIT, 3 * UNIT, 4.2 * UNIT, 8 * UNIT, 1.0))


def test_many_takeoffs_at_once_are_as_each_alone() -> None:
    found = prior(TIMES, UNIT, TAKEOFFS, start_densities())
    channels = np.array((0, 5, 12))
    for g, takeoff in enumerate(TAKEOFFS):
        alone = prior(TIMES, UNIT, float(takeoff), start_densities())
        assert np.array_equal(found.noise()[g], alone.noise())
        assert np.array_equal(found.noise(channels)[g], alone.noise()[:, channels])


def test_an_interval_gains_what_its_regimes_add() -> None:
    """By the definition: white noise of each regime's part, carried on to the end of the interval."""
    takeoff = 2.25 * UNIT
    found = prior(TIMES, UNIT, takeoff, start_densities())
    for k, (start, end) in enumerate(pairwise(TIMES)):
        bounds = np.clip((-np.inf, takeoff, takeoff + EDGE_S, np.inf), start, end)
        for regime in range(3):
            move = transitions(np.array((end - bounds[regime + 1]) / UNIT))
            added = white_jerk(bounds[regime + 1] - bounds[regime], UNIT)
            assert np.allclose(found.by_density[k, regime], move @ added @ move.T)
        assert found.by_break[k].any() == (start < takeoff <= end)
    unknown = prior(TIMES, UNIT, None, start_densities(), airborne=takeoff)
    assert np.allclose(unknown.by_density[:, 0], 0.0)
    assert np.allclose(unknown.by_density[-1, 1], 0.0)
    assert not unknown.by_break.any()
