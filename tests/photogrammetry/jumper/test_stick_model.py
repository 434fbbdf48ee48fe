"""The stick model gives the angles that the simulated jumper was made with."""

import numpy as np
import pytest

from photogrammetry.jumper.stick_model import ANGLES, body_angle_derivatives, body_angles, direction_of
from rig.settings.file import CONFIG
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import load_scenario
from simrig.world.truth import angles


def test_poses_of_the_simulated_jumper() -> None:
    scenario = load_scenario(CONFIG / "scenarios" / "training.toml")
    poses = []
    series = JumpSeries(scenario)
    for time_s in np.linspace(0.0, 0.7, 8):
        seen = series.at(scenario.first_takeoff_s + time_s)
        assert seen is not None
        poses.append(seen[0].pose(seen[1]))
    markers, skis = np.stack([pose.markers for pose in poses]), np.stack([pose.skis for pose in poses])
    origin = markers[:, 2:].mean(axis=1)
    found = np.degrees(body_angles(markers[:, 0], markers[:, 1], origin, 2.0 * skis[:, 0], skis[:, 1]))
    for row, pose in zip(found, poses, strict=True):
        expected = angles(pose)
        assert row == pytest.approx([getattr(expected, name) for name in ANGLES], abs=1e-9)
    assert np.ptp(found[:, 0]) > 5.0


def test_a_pose_that_can_be_worked_out_by_hand() -> None:
    up, forward = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    right, left = direction_of(np.radians([[10.0, -15.0], [4.0, 15.0]]))
    found = np.degrees(body_angles(up + forward, up, np.zeros(3), right, left))
    assert found[1] == pytest.approx(90.0)
    assert found[3] == pytest.approx(6.0)
    assert found[0] + found[4] == pytest.approx(90.0, abs=0.1)  # legs upright, in the plane of X' but for its heading


def test_derivatives_are_those_of_the_angles() -> None:
    rng, step = np.random.default_rng(6), 1e-6
    places = rng.standard_normal((5, 20, 3))  # helmet, hip, origin, right, left
    found = body_angle_derivatives(*places)
    for thing in range(5):
        for axis in range(3):
            off = np.zeros_like(places)
            off[thing, :, axis] = step
            by = (body_angles(*(places + off)) - body_angles(*(places - off))) / (2 * step)
            assert np.allclose(found[:, :, thing, axis], by, rtol=1e-5, atol=1e-5)
    straight = np.array(((0.0, 0.0, 2.0), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0)))
    assert np.isfinite(body_angle_derivatives(*straight)).all()
