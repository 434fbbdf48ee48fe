"""What skis of other pulses say: which fit contradicts them, and where they lead."""

import numpy as np

from analysis.identification.over_time.flights import Flight
from analysis.identification.ski_turns import led, smooth
from analysis.ski_bars.bars import Poses
from analysis.ski_bars.fitting import FittedBars
from photogrammetry.jumper.stick_model import direction_of
from rig.arrays import Floats

FLIGHT = Flight(0.0, 1.2, 0.6, np.zeros((2, 3)), np.eye(3), ())
TIME_S = np.arange(12) / 30.0
SIGMA_RAD = 0.01


def _turning(time_s: float) -> Floats:
    """Directions (2, 3) of skis that rise by 20 degrees a second and open."""
    slope = np.radians(-10.0 + 20.0 * time_s)
    return direction_of(np.array([(slope, np.radians(-6.0)), (slope, np.radians(6.0))]))


def _fits(off: dict[int, float]) -> list[FittedBars]:
    """Skis of all pulses; at some of them the right one is off, rad."""
    fits = []
    for t, time_s in enumerate(TIME_S.tolist()):
        poses = Poses(np.zeros((2, 3)), _turning(time_s)).moved(np.zeros((2, 5)))
        step = np.zeros((2, 5))
        step[0, 4] = off.get(t, 0.0)
        covariance = SIGMA_RAD**2 * np.eye(10)
        shape = np.zeros((2, 3))
        fits.append(FittedBars(poses.moved(step), covariance, shape, shape, {}, (t not in (4, 5), True), 0.0))
    return fits


def test_a_fit_that_contradicts_the_others_is_left_out() -> None:
    kept = smooth(_fits({7: 0.2}), TIME_S, FLIGHT)
    assert np.flatnonzero(~kept[:, 0]).tolist() == [4, 5, 7]
    assert kept[:, 1].all()


def test_the_others_lead_to_a_ski_that_was_not_seen() -> None:
    fits = _fits({7: 0.2})
    toward, leads = led(fits, smooth(fits, TIME_S, FLIGHT), TIME_S, FLIGHT)
    assert leads[[4, 5, 7]].all()
    off = [np.linalg.norm(toward[t] - _turning(TIME_S[t]), axis=1).max() for t in (4, 5, 7)]
    assert max(off) < 2 * SIGMA_RAD


def test_nothing_leads_where_no_ski_is_seen() -> None:
    fits = _fits({})
    toward, leads = led(fits, np.zeros((len(fits), 2), bool), TIME_S, FLIGHT)
    assert toward.shape == (len(fits), 2, 3)
    assert not leads.any()
