"""The live filter: its errors are within its sigmas although it knows the past alone."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.measurements.model import ImageMeasurements, PointMeasurement
from analysis.motion.causal import CausalFilter
from analysis.result.model import Status
from rig.arrays import Floats
from tests.analysis.simulated import RATE_HZ, drawn, simulated_measurements, true_cameras, true_jump

SEED = 5
FIRST = 5  # pulses until there is a state
LARGEST = 4.5  # sigmas; 6e-6 of single errors are larger
HIDDEN = range(8, 11)  # pulses without skis
BAD_SKI = 20  # pulse in which one image shows a ski aside
ASIDE_PX = 1.0  # some 4.3 standard deviations against the prediction
AT_CHANGES = 6.0  # where the motion has just changed, the distribution is a mixture with longer tails


def _distance(offset: Floats, covariance: Floats) -> float:
    return float(np.sqrt(offset @ np.linalg.solve(covariance, offset)))


def test_states_err_as_their_covariance_says_and_gaps_are_predicted() -> None:
    rng, truth = np.random.default_rng(SEED), true_jump(SEED)
    measured = simulated_measurements(truth, true_cameras(), rng)
    live = CausalFilter(drawn(true_cameras(), rng), measured.cameras, RATE_HZ)
    sigmas = {}
    for k, given in enumerate(measured.jumps[0].pulses):
        pulse = replace(given, images={}) if k in (20, 21) else given
        if k == 25:
            points = pulse.images["K1"].points
            wrong = {**points, "P1": PointMeasurement(points["P1"].xy + 8.0, points["P1"].covariance)}
            images = {**pulse.images, "K1": ImageMeasurements(wrong, pulse.images["K1"].skis)}
            pulse = replace(pulse, images=images)
        state = live.update(pulse)
        if k < FIRST:
            continue
        assert state is not None
        for i, point in enumerate(state.points.values()):
            assert point is not None
            assert _distance(point.xyz - truth.pose(pulse.pulse).markers[i], point.covariance) < LARGEST
        assert _distance(state.velocity.value - truth.velocity(pulse.pulse), state.velocity.covariance) < AT_CHANGES
        helmet = state.points["P1"]
        assert helmet is not None
        assert (helmet.status is Status.PREDICTED) == (k in (20, 21) or len(helmet.cameras) < 2)
        assert k != 25 or helmet.cameras == ("K2", "K3")
        sigmas[k] = float(np.trace(helmet.covariance)) ** 0.5
    assert sigmas[19] < sigmas[20] < sigmas[21] > sigmas[22]


def test_skis_that_are_hidden_stay_what_skis_are_and_a_prediction_changes_nothing() -> None:
    rng, truth = np.random.default_rng(SEED), true_jump(SEED)
    measured = simulated_measurements(truth, true_cameras(), rng)
    live, other = (CausalFilter(true_cameras(), measured.cameras, RATE_HZ) for _ in range(2))
    for given in measured.jumps[0].pulses[: HIDDEN.stop]:
        images = given.images
        if given.pulse - measured.jumps[0].pulses[0].pulse in HIDDEN:
            images = {name: ImageMeasurements(image.points, {}) for name, image in images.items()}
        pulse = replace(given, images=images)
        predictions = live.predicted(pulse.time)
        state, same = live.update(pulse), other.update(pulse)
    assert state is not None
    assert same is not None
    assert predictions is not None
    predicted, _ = predictions
    assert (state.origin.value == same.origin.value).all()
    for side, heading in zip(("right", "left"), truth.pose(pulse.pulse).skis, strict=True):
        ski = state.skis[side]
        assert ski is not None
        assert ski.status is Status.PREDICTED
        angle = np.degrees(np.arctan2(heading[1], heading[0]))
        assert abs(ski.heading.value - angle) < LARGEST * ski.heading.sigma
        assert 0.5 < ski.heading.sigma < 20.0
    hip = predicted.points["P2"]
    assert hip is not None
    assert _distance(hip.xyz - truth.pose(pulse.pulse).markers[1], hip.covariance) < AT_CHANGES


@pytest.mark.parametrize(("cameras", "used"), [(("K1", "K2", "K3"), True), (("K1", "K2"), False)])
def test_what_two_images_say_of_a_ski_the_motion_controls(cameras: tuple[str, ...], used: bool) -> None:
    """The ski lies aside in one image, by so much that three images would decide themselves."""
    rng, truth = np.random.default_rng(SEED), true_jump(SEED)
    measured = simulated_measurements(truth, true_cameras(), rng)
    live = CausalFilter(true_cameras(), measured.cameras, RATE_HZ)
    for given in measured.jumps[0].pulses[:BAD_SKI]:
        live.update(given)
    given = measured.jumps[0].pulses[BAD_SKI]
    shown = {
        name: ImageMeasurements(
            image.points, {side: ski for side, ski in image.skis.items() if side == "left" or name in cameras}
        )
        for name, image in given.images.items()
    }
    ski = shown["K1"].skis["right"]
    aside = {**shown["K1"].skis, "right": replace(ski, xy=ski.xy + np.array((0.0, ASIDE_PX)))}
    state = live.update(replace(given, images={**shown, "K1": ImageMeasurements(shown["K1"].points, aside)}))
    assert state is not None
    right = state.skis["right"]
    assert right is not None
    assert ("K1" in right.cameras) == used
