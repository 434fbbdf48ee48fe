"""The error equations of all cameras at once against each camera's own projection, and against differences."""

from dataclasses import replace

import numpy as np

from analysis.measurements.model import POINTS, SIDES, JumpMeasurements
from analysis.motion.adjustment.bundle import root_of
from analysis.motion.model.channels import CHANNELS, VECTORS, MotionFrame
from analysis.motion.model.equations import linearised
from analysis.motion.model.observations import GROUPS, observations
from analysis.motion.model.prior import STATE
from analysis.motion.quantities import smoothed_states
from analysis.motion.start_values import start_values
from analysis.result.model import QUANTITIES, SmoothedState
from analysis.scene.camera_arrays import CameraArrays, own_root
from analysis.scene.camera_system import CameraSystem
from photogrammetry.geometry.camera_model import Distortion
from rig.arrays import Floats
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump

SEED, PULSES, STEP = 4, slice(10, 15), 1e-5
STRONG = np.array((-8e-8, 1e-14, 0.0, 2e-6, -1e-6, 1e-4, 0.0))  # px at the edge of the images


def _with_distortion() -> CameraSystem:
    """One camera distorts on the projected side, one on the measured side, one not."""
    system = true_cameras()
    cameras = dict(system.cameras)
    for name, side in (("K1", Distortion.PROJECTED), ("K2", Distortion.MEASURED)):
        camera = cameras[name].camera
        interior = np.concatenate((camera.interior[:3], STRONG))
        cameras[name] = replace(cameras[name], camera=replace(camera, interior=interior, distortion=side))
    return replace(system, cameras=cameras)


def _pose() -> tuple[MotionFrame, Floats]:
    """A frame, and channels (1, 16) of a body in flight."""
    frame = MotionFrame(np.zeros(3), np.array(((0.8, -0.6, 0.0), (0.6, 0.8, 0.0), (0.0, 0.0, 1.0))))
    return frame, np.array([[0.1, 0.2, 0.1, 0.3, 0.1, 0.8, 0.3, 0.1, 0.5, 0.0, 0.3, 0.1, 0.2, 0.1, -0.1, 0.3]])


def test_all_cameras_at_once_are_as_each_alone() -> None:
    rng, system = np.random.default_rng(SEED), _with_distortion()
    measured = simulated_measurements(true_jump(SEED), system, rng)
    jump = JumpMeasurements(1, measured.jumps[0].pulses[PULSES])
    cameras, root = CameraArrays.of(system, tuple(measured.cameras)), root_of(system.covariance)
    own = own_root(system, cameras.names, root)
    observed = observations(jump, measured, cameras)
    assert observed.seen.sum() > 0.8 * observed.seen.size
    start = start_values(observed, system)
    assert start is not None
    frame, channels = start.frame, start.channels[:, None] + 0.01 * rng.standard_normal((*observed.shape, CHANNELS))
    found = linearised(observed, cameras, own, frame, channels)
    points, skis = frame.points(channels), frame.skis(channels)
    along = np.linspace(-2, 2, 4001)[:, None]
    for k, pulse in enumerate(jump.pulses):
        for i, name in enumerate(cameras.names):
            of_image = pulse.images[name]
            for g in np.flatnonzero(observed.seen[k, i]):
                v = np.linalg.solve(observed.whitener[k, i, g], found.v[k, i, g])
                if g < len(POINTS):
                    xy = of_image.points[GROUPS[g]].xy
                    assert np.allclose(v, system[name].linearised(points[k, i, g][None], xy[None])[0][0], atol=1e-9)
                    continue
                side = g - len(POINTS)
                line = points[k, i, 2 + side] + along * skis[k, i, side]
                for distance, xy in zip(np.abs(v), observed.xy[k, i, g], strict=True):
                    off = np.linalg.norm(system[name].linearised(line, np.tile(xy, (len(line), 1)))[0], axis=1)
                    assert np.isclose(distance, off.min(), atol=0.01)  # px: the place that the iteration ends at
                ends = system[name].reduced(observed.xy[k, i, g])
                flat = system[name].reduced(of_image.skis[SIDES[side]].xy)
                assert np.allclose(ends.mean(axis=0), flat.mean(axis=0), atol=1e-8)  # all as precise as each other
    for c in range(CHANNELS):
        step = STEP * np.eye(CHANNELS)[c]
        more, less = (linearised(observed, cameras, own, frame, channels + s).v for s in (step, -step))
        by = (more - less) / (2 * STEP)
        assert np.allclose(found.by_channels[..., c], by, rtol=1e-4, atol=1e-4 * np.abs(found.by_channels).max())
    for u in range(root.shape[1]):
        step = STEP * own[..., u]
        more, less = (linearised(observed, cameras.moved(s), own, frame, channels).v for s in (step, -step))
        by = (more - less) / (2 * STEP)
        assert np.allclose(found.by_u[..., u], by, rtol=1e-4, atol=1e-4 * np.abs(found.by_u).max())


def test_cameras_move_as_those_of_the_system() -> None:
    system = _with_distortion()
    names, u = system.names[:2], np.random.default_rng(SEED).standard_normal(len(system.covariance))
    root = root_of(system.covariance)
    step = root @ u[: root.shape[1]]
    expected = CameraArrays.of(system.moved(step), names)
    found = CameraArrays.of(system, names).moved(own_root(system, names, root) @ u[: root.shape[1]])
    assert np.allclose(found.position, expected.position, atol=1e-12)
    assert np.allclose(found.rotation, expected.rotation, atol=1e-12)
    assert np.allclose(found.lens.interior, expected.lens.interior, atol=1e-12)


def _quantities(frame: MotionFrame, states: Floats, by: Floats) -> list[SmoothedState]:
    n = len(states)
    cameras, by_hand = [dict.fromkeys(GROUPS, ("K1", "K2"))] * n, [dict.fromkeys(GROUPS, False)] * n
    known = np.ones(len(GROUPS), bool)
    covariance = np.tile(1e-6 * np.eye(STATE), (n, 1, 1))
    return smoothed_states(frame, 1 / 30, states, covariance, by, cameras, by_hand, known)


def _values(state: SmoothedState) -> Floats:
    of_motion = (state.angle_of_attack, state.height, state.speed)
    found = [value.value for value in (*state.angles.values(), *of_motion) if value is not None]
    return np.array((*found, *state.velocity.value))


def test_sigmas_of_angles_follow_from_the_derivatives_by_the_state() -> None:
    frame, channels = _pose()
    state = np.concatenate((channels[0], np.random.default_rng(SEED).uniform(0.1, 0.5, STATE - CHANNELS)))
    steps = np.concatenate((STEP * np.eye(STATE), -STEP * np.eye(STATE)))
    around = np.array([_values(each) for each in _quantities(frame, state + steps, np.zeros((2 * STATE, STATE, 1)))])
    by = (around[:STATE] - around[STATE:]).T / (2 * STEP)
    found = _quantities(frame, state[None], np.eye(STATE)[None])[0]
    assert found.by_calibration.shape == (len(QUANTITIES), STATE)
    assert np.allclose(found.by_calibration, by, rtol=1e-6, atol=1e-6)


def test_parallel_skis_have_an_angle_as_uncertain_as_they_are() -> None:
    """At an angle of next to nothing, a step of a difference quotient would go beyond zero and see no change."""
    frame, channels = _pose()
    state = np.concatenate((channels, np.full((1, STATE - CHANNELS), 0.1)), axis=1)
    state[:, VECTORS:CHANNELS] = 0.0, 0.0, 0.0, 1e-9
    gamma = _quantities(frame, state, np.zeros((1, STATE, 1)))[0].angles["gamma"]
    assert gamma is not None
    assert np.isclose(gamma.sigma, np.degrees(1e-3), rtol=1e-3)
