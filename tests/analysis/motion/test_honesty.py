"""What was not measured for a while, and what happens at the edge: stated with sigmas that hold, or not at all."""

from dataclasses import dataclass, fields, replace

import numpy as np
import pytest
from scipy.stats import chi2

from analysis.motion.smoother import smooth
from analysis.result.model import Phase
from bench.analysis.smoothing import Honesty, blanked_out, judge
from rig.arrays import Floats
from simrig.world.jumper import Jump
from tests.analysis.simulated import drawn, simulated_measurements, true_cameras, true_jump

pytestmark = pytest.mark.long

DRAWS = 5
INDEPENDENT = 3 * DRAWS  # errors of one draw are correlated over time: its three coordinates count once
LIMITS = chi2.ppf((0.001, 0.999), INDEPENDENT) / INDEPENDENT
LARGEST = 4.5  # sigmas
PUSH_S, BEHIND_S = 0.15, 0.2  # how long a gentle push lasts; how long the push matters
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


@dataclass(frozen=True, slots=True)
class GradualJump(Jump):
    """Skis that take over the upward speed of the legs with an acceleration that grows from zero and ends."""

    def origin(self, time_s: float) -> Floats:
        """O; of the speed 1 - 3 u^2 + 2 u^3 is missing at u times `PUSH_S`."""
        if time_s <= 0:
            return Jump.origin(self, time_s)
        u = min(time_s / PUSH_S, 1.0)
        return np.asarray(self.flight.position(time_s) - self.push * PUSH_S * (u - u**3 + u**4 / 2))


@pytest.mark.parametrize("gradual", [False, True])
def test_take_offs_of_any_shape_err_as_their_sigmas_say(gradual: bool) -> None:
    """Acceleration that begins at once and fades, and one that begins and ends gently: the model is neither."""
    takeoff, upward, system = [], [], true_cameras()
    for draw in range(DRAWS):
        rng, truth = np.random.default_rng(draw), true_jump(draw)
        if gradual:
            jump = GradualJump(**{field.name: getattr(truth.jump, field.name) for field in fields(Jump)})
            truth = replace(truth, jump=jump)
        measured = simulated_measurements(truth, system, rng)
        motion = smooth(measured.jumps[0], measured, drawn(system, rng))
        assert motion.takeoff is not None
        takeoff.append((motion.takeoff.pulse - truth.takeoff_pulse) / motion.takeoff.sigma_pulses)
        for pulse, state in zip(measured.jumps[0].pulses, motion.states, strict=True):
            if state is not None and 0 < truth.since_takeoff(pulse.pulse) < BEHIND_S:
                off = state.velocity.value[2] - truth.velocity(pulse.pulse)[2]
                upward.append(off / np.sqrt(state.velocity.covariance[2, 2]))
    assert np.mean(np.square(takeoff)) < chi2.ppf(0.999, DRAWS) / DRAWS
    assert np.mean(np.square(upward)) < 1.5
