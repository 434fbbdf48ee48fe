"""What was not measured for a while: it is stated with a sigma that holds, or not at all."""

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.motion.smoother import smooth
from analysis.result.model import Phase
from bench.analysis.smoothing import Honesty, blanked_out, judge
from tests.analysis.simulated import drawn, simulated_measurements, true_cameras, true_jump

DRAWS = 5
INDEPENDENT = 3 * DRAWS  # errors of one draw are correlated over time: its three coordinates count once
LIMITS = chi2.ppf((0.001, 0.999), INDEPENDENT) / INDEPENDENT
LARGEST = 4.5  # sigmas
VAGUE_DEG = 29.0  # that much, and nothing is known of an angle


@pytest.mark.parametrize(("group", "phase"), [("P4", Phase.TABLE), ("P2", Phase.EDGE)])
def test_predicted_points_err_as_their_sigmas_say(group: str, phase: Phase) -> None:
    honesty = Honesty()
    for draw in range(DRAWS):
        rng, truth, system = np.random.default_rng(draw), true_jump(draw), true_cameras()
        measured = simulated_measurements(truth, system, rng)
        jump = blanked_out(measured.jumps[0], truth, group, phase)
        judge(truth, jump, smooth(jump, measured, drawn(system, rng)), honesty)
    predicted = honesty.figures()[f"{phase.value} {group} predicted"]
    assert LIMITS[0] < predicted["mean_square"] < LIMITS[1]
    assert predicted["mean_sigma"] < 0.05


def test_angles_that_nothing_tells_are_left_out() -> None:
    truth, system = true_jump(17), true_cameras()
    measured = simulated_measurements(truth, system, np.random.default_rng(17))
    jump = blanked_out(measured.jumps[0], truth, "left", Phase.FLIGHT)
    honesty = Honesty()
    motion = smooth(jump, measured, system)
    judge(truth, jump, motion, honesty)
    for (_, quantity), pairs in honesty.pairs.items():
        if quantity in ("alpha", "beta", "gamma", "dphi", "phi", "angle_of_attack"):
            error, sigma = np.array(pairs).T
            assert (np.abs(error) < LARGEST * sigma).all(), quantity
            assert (sigma < VAGUE_DEG).all(), quantity
    last = motion.states[-1]
    assert last is not None
    assert last.skis["left"] is None
    assert last.angles["gamma"] is None
    assert last.angles["beta"] is not None
