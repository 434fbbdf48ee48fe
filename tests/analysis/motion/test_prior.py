"""The prior of the motion: what it adds between pulses, and how its densities follow a jump."""

from itertools import pairwise

import numpy as np

from analysis.motion.model.channels import CHANNELS
from analysis.motion.model.prior import (
    STATE,
    Prior,
    prior,
    re_estimated,
    start_densities,
    transitions,
    white_jerk,
)
from analysis.result.model import EDGE_S
from rig.arrays import Floats

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
        slices = np.linspace(start, end, 500)
        middle = (slices[1:] + slices[:-1]) / 2 - takeoff
        move = transitions((end - slices[1:]) / UNIT)
        added = move @ white_jerk(np.diff(slices), UNIT) @ move.swapaxes(1, 2)
        flight = (middle > 0).astype(float)
        # The edge ends by itself: half of the phase later there is 1 / e of it.
        for regime, density in enumerate((1 - flight, flight * np.exp(-2 * middle / EDGE_S), flight)):
            expected = np.tensordot(density, added, 1)
            # The take-off lies in a slice; 1 % of one of them is allowed for.
            assert np.allclose(found.by_density[k, regime], expected, rtol=0.01, atol=0.01 * added.max() / 500)
        assert found.by_break[k].any() == (start < takeoff <= end)
    unknown = prior(TIMES, UNIT, None, start_densities(), airborne=takeoff)
    assert np.allclose(unknown.by_density[:, 0], 0.0)
    assert np.allclose(unknown.by_density[-1, 1], 0.0)
    assert not unknown.by_break.any()


def test_densities_follow_a_still_jumper_and_stay_where_nothing_is_known() -> None:
    n = len(TIMES)
    given = prior(TIMES, UNIT, 2.25 * UNIT, start_densities())
    still = np.zeros((n, STATE))
    for _ in range(6):
        exactly = np.zeros((n, STATE, STATE))
        given = given.with_density(re_estimated(given, still, exactly, exactly[1:]))
    assert (np.sqrt(given.density / start_densities()) < 0.02).all()
    for density in (start_densities(), start_densities() / 100, start_densities() * 100):
        unseen = prior(TIMES, UNIT, 2.25 * UNIT, density)
        for _ in range(20):
            unseen = unseen.with_density(re_estimated(unseen, still, *_unseen(unseen)))
        assert np.allclose(unseen.density, start_densities(), rtol=0.05)


def _unseen(given: Prior) -> tuple[Floats, Floats]:
    """Covariances of states, and of neighbouring ones, of which nothing is known but the prior."""
    own, following = [np.eye(STATE)], []
    for move, noise in zip(given.transition, given.noise(), strict=True):
        whole = np.kron(move, np.eye(CHANNELS))
        added = np.zeros((3, CHANNELS, 3, CHANNELS))
        added[:, range(CHANNELS), :, range(CHANNELS)] = noise
        following.append(own[-1] @ whole.T)
        own.append(whole @ own[-1] @ whole.T + added.reshape(STATE, STATE))
    return np.array(own), np.array(following)
