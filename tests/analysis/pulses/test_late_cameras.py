"""Cameras that show the jumper later than they say: what is told of him is where he was, or as uncertain as that is."""

import numpy as np
import pytest

from analysis.measurements.model import POINTS
from analysis.procedure.jump import ComputedJump, compute_jump
from analysis.result.model import JumperState
from rig.arrays import Floats
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump
from tests.support.repeats import repeats

LATE_S = 0.003  # 8 cm of the jumper's way


def _computed(cameras: tuple[str, ...], late: str, seed: int) -> ComputedJump:
    system = true_cameras().only(cameras)
    measured = simulated_measurements(true_jump(seed), system, np.random.default_rng(seed), late_s={late: LATE_S})
    return compute_jump(measured.jumps[0], measured, system)


def _errors(computed: ComputedJump, seed: int, *, smoothed: bool) -> tuple[Floats, Floats]:
    """Squares of the errors of all measured points over their covariances, and the errors, m."""
    truth = true_jump(seed)
    squares, errors = [], []
    for pulse in computed.jump.pulses:
        state: JumperState | None = pulse.smoothed if smoothed else pulse.raw
        true = truth.pose(pulse.pulse).markers
        for name, place in zip(POINTS, true, strict=True):
            point, alone = None if state is None else state.points[name], pulse.raw.points[name]
            if point is not None and alone is not None:
                off = point.xyz - place
                squares.append(float(off @ np.linalg.solve(point.covariance, off)))
                errors.append(float(np.linalg.norm(off)))
    return np.array(squares), np.array(errors)


@pytest.mark.parametrize("late", repeats(["K1", "K2", "K3"]))
def test_a_camera_that_two_others_prove_late_shifts_no_raw_point(late: str) -> None:
    computed = _computed(("K1", "K2", "K3"), late, 3)
    assert [name for name, offset in computed.synchrony.items() if offset.said is not None] == [late]
    squares, errors = _errors(computed, 3, smoothed=False)
    assert len(errors) > 100
    assert np.median(errors) < 0.01
    assert squares.mean() / 3 < 1.4


@pytest.mark.parametrize("smoothed", [False, True])
@pytest.mark.parametrize("late", repeats(["K1", "K3"]))
def test_of_two_cameras_nobody_knows_which_is_late(late: str, *, smoothed: bool) -> None:
    """As the mean of both instants may be off by half of what they are apart, so are the points."""
    computed = _computed(("K1", "K3"), late, 3)
    assert any(offset.said is not None for offset in computed.synchrony.values())
    squares, errors = _errors(computed, 3, smoothed=smoothed)
    assert len(errors) > 60
    assert 0.02 < np.median(errors) < 0.06
    assert 0.2 < squares.mean() / 3 < 1.0  # one draw of the instant: the same for all pulses
