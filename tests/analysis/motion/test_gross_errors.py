"""Errors that last: a ski that is measured wrong in the same way for a while, where little else tells."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.measurements.model import ImageMeasurements, PointMeasurement, SkiMeasurement
from analysis.motion.adjustment.gross_errors import deserted
from analysis.motion.smoother import smooth
from analysis.procedure.jump import compute_jump
from analysis.pulses.solution import solve_pulses
from rig.arrays import Flags
from tests.analysis.simulated import drawn, simulated_measurements, true_cameras, true_jump
from tests.support.repeats import repeats

SEED, RATE_HZ = 11, 100.0
HIDDEN_S, SHADOW_S = -0.03, -0.1  # since the take-off: P4 is half hidden until, the ski not seen from, until
LARGEST = 4.5  # sigmas
RENDERED_HZ, LONE_PX = 30.0, 0.4
SEEN_S = {"P3": -0.04, "P4": 0.1}  # since the take-off: when they come into sight
LONE_S = -0.07
ASIDE_S, ASIDE_PX = (0.28, 0.45), 3.9  # since the take-off: K3 takes something beside P4 for it, which K1 does not see


def _half_hidden(image: ImageMeasurements, camera: str, off: float | None) -> ImageMeasurements:
    """K3 alone sees P4, and K2 alone the left ski, whose axis seems to be `off` px aside; None: not at all."""
    points = {name: point for name, point in image.points.items() if name != "P4" or camera == "K3"}
    skis = {side: ski for side, ski in image.skis.items() if side != "left"}
    if camera == "K2" and off is not None and (ski := image.skis.get("left")) is not None:
        axis = ski.xy[-1] - ski.xy[0]
        across = np.array((-axis[1], axis[0])) / np.linalg.norm(axis)
        skis["left"] = SkiMeasurement(ski.xy + off * across, ski.sigma)
    return ImageMeasurements(points, skis)


@pytest.mark.parametrize("off", [0.0, -1.0])
def test_a_binding_is_not_where_a_wrong_ski_says(off: float) -> None:
    rng, truth = np.random.default_rng(SEED), true_jump(SEED, RATE_HZ)
    measured = simulated_measurements(truth, true_cameras(), rng)
    pulses = list(measured.jumps[0].pulses)
    since = [truth.since_takeoff(pulse.pulse) for pulse in pulses]
    hidden = [k for k, seconds in enumerate(since) if seconds < HIDDEN_S]
    for k in hidden:
        wrong = off if since[k] < SHADOW_S else None
        images = {name: _half_hidden(image, name, wrong) for name, image in pulses[k].images.items()}
        pulses[k] = replace(pulses[k], images=images)
    jump = replace(measured.jumps[0], pulses=tuple(pulses))
    motion = smooth(jump, measured, drawn(true_cameras(), rng))
    assert {(test.camera, test.what) for test in motion.removed} == ({("K2", "left")} if off else set())
    for k in hidden:
        state = motion.states[k]
        if state is not None and (binding := state.points["P4"]) is not None:
            error = binding.xyz - truth.pose(pulses[k].pulse).markers[3]
            assert error @ np.linalg.solve(binding.covariance, error) < LARGEST**2


def _late_bindings(image: ImageMeasurements, camera: str, since: float, off: float) -> ImageMeasurements:
    """The bindings come into sight one at the edge, one behind it; K3 saw the latter once before, `off` px aside."""
    points = {name: point for name, point in image.points.items() if since > SEEN_S.get(name, -np.inf)}
    if camera == "K3" and abs(since - LONE_S) < 0.5 / RENDERED_HZ and (binding := image.points.get("P4")) is not None:
        points["P4"] = PointMeasurement(binding.xy + np.array((off, 0.0)), LONE_PX**2 * np.eye(2))
    return ImageMeasurements(points, image.skis)


def test_a_lone_ray_that_is_wrong_does_not_bend_what_was_not_seen() -> None:
    """The take-off is found by the skis where the bindings are seen from the edge on only."""
    rng, truth = np.random.default_rng(SEED), true_jump(SEED, RENDERED_HZ)
    measured = simulated_measurements(truth, true_cameras(), rng)
    pulses = [
        replace(
            pulse,
            images={
                name: _late_bindings(image, name, truth.since_takeoff(pulse.pulse), -9 * LONE_PX)
                for name, image in pulse.images.items()
            },
        )
        for pulse in measured.jumps[0].pulses
    ]
    motion = smooth(replace(measured.jumps[0], pulses=tuple(pulses)), measured, drawn(true_cameras(), rng))
    assert motion.takeoff is not None
    assert abs(motion.takeoff.pulse - truth.takeoff_pulse) < LARGEST * motion.takeoff.sigma_pulses
    assert {(test.camera, test.what) for test in motion.removed} == {("K3", "P4")}
    for pulse, state in zip(pulses, motion.states, strict=True):
        if state is not None and (binding := state.points["P4"]) is not None:
            error = binding.xyz - truth.pose(pulse.pulse).markers[3]
            assert error @ np.linalg.solve(binding.covariance, error) < LARGEST**2


def _beside(image: ImageMeasurements, camera: str, since: float) -> ImageMeasurements:
    """P4 is hidden from K1 and K3 for a while, and K3 takes what is beside it for it."""
    if camera == "K2" or not ASIDE_S[0] < since < ASIDE_S[1]:
        return image
    points = dict(image.points)
    binding = points.pop("P4", None)
    if camera == "K3" and binding is not None:
        points["P4"] = PointMeasurement(binding.xy + np.array((ASIDE_PX, -0.7)), LONE_PX**2 * np.eye(2))
    return ImageMeasurements(points, image.skis)


@pytest.mark.parametrize("seed", repeats(range(3)))
def test_what_is_beside_a_marker_for_a_while_neither_bends_the_motion_nor_is_it_a_point(seed: int) -> None:
    rng, truth = np.random.default_rng(seed), true_jump(seed, RENDERED_HZ)
    measured = simulated_measurements(truth, true_cameras(), rng)
    pulses = [
        replace(
            pulse,
            images={n: _beside(image, n, truth.since_takeoff(pulse.pulse)) for n, image in pulse.images.items()},
        )
        for pulse in measured.jumps[0].pulses
    ]
    jump, system = replace(measured.jumps[0], pulses=tuple(pulses)), drawn(true_cameras(), rng)
    computed, two_rays = compute_jump(jump, measured, system).jump, solve_pulses(jump, measured, system).states
    wrong = 0
    for pulse, alone in zip(computed.pulses, two_rays, strict=True):
        true = truth.pose(pulse.pulse).markers[3]
        if pulse.smoothed is not None and (smoothed := pulse.smoothed.points["P4"]) is not None:
            off = smoothed.xyz - true
            assert off @ np.linalg.solve(smoothed.covariance, off) < LARGEST**2
        if ASIDE_S[0] < truth.since_takeoff(pulse.pulse) < ASIDE_S[1] and (point := alone.points["P4"]) is not None:
            off = point.xyz - true
            assert off @ np.linalg.solve(point.covariance, off) > LARGEST**2, "a point that two rays determine wrongly"
            assert pulse.raw.points["P4"] is None
            wrong += 1
    assert wrong > 2


def test_what_stands_among_more_that_had_to_go_goes_too() -> None:
    """`x`: left out, `u`: used, `d`: used and to go, `.`: not measured, of one thing in one camera at 30 Hz."""
    for run in ("..xxdx..uuu", "uuxuuu", "uuuuxux", "uu.xdx", "..xu..", "u.....xx", "xxxxd.....u"):
        told = np.array(list(run))
        used: Flags = np.isin(told, ["u", "d"])
        seen: Flags = told != "."
        found = deserted(np.arange(len(told)) / RENDERED_HZ, seen[:, None, None], used[:, None, None])
        assert (found[:, 0, 0] == (told == "d")).all(), run
