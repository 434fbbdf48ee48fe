"""Moves of cameras are named, shake is no move, and what a shaken frame shows is put right."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.cameras.comparison import scene_of_calibration
from analysis.cameras.live_watch import LiveWatch
from analysis.cameras.moves import Block, Move, find_moves, move_said, turn_words
from analysis.cameras.oriented_scene import OrientedScene, scene_of_survey
from analysis.cameras.poses_file import Calibration, KnownBall
from analysis.cameras.standing import FrameShake, Standing, steadied
from analysis.cameras.steadiness import standing_in, watch
from analysis.measurements.model import ImageMeasurements, PointMeasurement, PulseMeasurements, SkiMeasurement
from analysis.scene.camera_system import PlacedCamera
from analysis.scene.naming import MODEL_SIGMA
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from rig.transport.wire import to_builtins
from tests.analysis.cameras.moving_hill import Film, moving, shaken_film, shaken_scene
from tests.analysis.scene.hill import oriented, survey_json, training
from tests.analysis.simulated import true_cameras


def test_shake_is_measured_frame_by_frame_and_is_no_move() -> None:
    film, scene = shaken_film(), shaken_scene()
    steadiness = watch(scene, film)
    assert steadiness.moved == ()
    assert steadiness.messages == ()
    standing = steadiness.during(film.pulses)
    assert list(standing.shake) == ["K2"]
    found = np.array([standing.shake["K2"][p].turn for p in film.pulses])
    sigma = np.sqrt([np.diagonal(standing.shake["K2"][p].covariance) for p in film.pulses])
    true = film.true_turns("K2")
    error = (found - found.mean(axis=0)) - (true - true.mean(axis=0))
    assert np.degrees(true.std(axis=0)).max() > 0.008
    assert np.degrees(error.std(axis=0)).max() < 0.001  # a fifteenth of a pixel, of a third
    # what matching leaves out is part of the sigma and hardly differs from frame to frame, so errors are smaller
    assert (np.sqrt(((error / sigma) ** 2).mean(axis=0)) < 1.3).all()
    for name in ("K1", "K3"):
        assert np.array_equal(standing.system[name].rotation, scene.system[name].rotation)


def test_live_the_shake_is_measured_in_the_frames_of_cameras_that_shake() -> None:
    film, watched = shaken_film(), LiveWatch(standing_in(shaken_scene())[0])
    frames = [dict(of_pulse) for _, of_pulse in film.frames(film.pulses)]
    assert watched.stood(frames[0]) == {}, "nothing is known yet"
    watched.begin(frames[::6])
    stood = [watched.stood(of_pulse) for of_pulse in frames]
    assert all(list(of_pulse) == ["K2"] for of_pulse in stood)
    found, true = np.array([of_pulse["K2"].turn for of_pulse in stood]), film.true_turns("K2")
    error = (found - found.mean(axis=0)) - (true - true.mean(axis=0))
    assert np.degrees(error.std(axis=0)).max() < 0.001
    hidden = watched.stood({**frames[0], "K2": np.zeros_like(frames[0]["K2"])})["K2"]
    assert not hidden.turn.any()
    assert np.sqrt(np.diagonal(hidden.covariance)) == pytest.approx(true.std(axis=0), rel=0.4)


def test_a_knock_is_named_with_direction_size_and_time() -> None:
    film = Film(moving("K2", moves=[{"from_s": 1.7, "rotation_deg": (0.0, -0.05, 0.0)}]), 75)
    scene = film.scene()
    steadiness = watch(scene, film)
    (moved,) = steadiness.moved
    assert moved.camera == "K2"
    assert moved.rotation_deg == pytest.approx([0, -0.05, 0], abs=0.003)
    assert moved.message.startswith("camera K2 turned by 0.05")
    assert " to the right between pulse " in moved.message
    before, after = (int(word) for word in moved.message.split(" pulse ")[1].split(" and "))
    assert before < 1.7 * 30 <= after < before + 12
    late = steadiness.during(range(60, 90))
    change = scene.system["K2"].rotation.T @ late.system["K2"].rotation
    early = scene.system["K2"].rotation.T @ steadiness.during(range(15, 45)).system["K2"].rotation
    assert np.degrees((change @ early.T)[0, 2]) == pytest.approx(-0.05, abs=0.002)


def _calibration(scene: OrientedScene) -> Calibration:
    """A scene as `svev orient` would have written it."""
    balls = {}
    for name, ball in scene.balls.items():
        images = {
            camera: np.concatenate((scene.system[camera].project(ball.xyz) - place[:2], place[2:]))
            for camera, place in ball.images.items()
        }
        balls[name] = KnownBall(ball.xyz, np.diag(ball.sigma**2), surveyed=True, images=images)
    return Calibration("poses.json", scene.system, balls, "m", ())


def test_a_camera_that_was_turned_since_the_calibration_is_named_and_put_right() -> None:
    calibration = _calibration(scene_of_survey(oriented(survey_json(training(), 1))))
    film = Film(moving("K3", moves=[{"from_s": 0.0, "rotation_deg": (0.05, 0.0, 0.0)}]), 40, first=200)
    scene = scene_of_calibration(film.static(), calibration)
    assert np.array_equal(scene.system["K3"].rotation, calibration.system["K3"].rotation)
    steadiness = watch(scene, film)
    (moved,) = steadiness.moved
    assert moved.message.startswith("camera K3 turned by 0.0")
    assert moved.message.endswith(" deg up since the calibration")
    assert moved.rotation_deg == pytest.approx([0.05, 0, 0], abs=0.004)
    standing = steadiness.during(film.pulses)
    point = np.array((8.0, 0.0, -2.0))
    true = _turned(calibration.system["K3"], 0.05).project(point)
    assert standing.system["K3"].project(point) == pytest.approx(true, abs=2 * MODEL_SIGMA)
    assert np.array_equal(standing.system["K1"].rotation, calibration.system["K1"].rotation)


def _turned(placed: PlacedCamera, up_deg: float) -> PlacedCamera:
    turn = np.radians((up_deg, 0.0, 0.0))
    return replace(placed, rotation=placed.rotation @ rotation_from_vector(turn))


def test_measurements_of_a_shaken_frame_are_put_right_and_back() -> None:
    system = true_cameras()
    shake = FrameShake(np.radians((0.02, -0.03, 0.05)), np.radians(np.diag((1e-3, 1e-3, 4e-3))) ** 2)
    placed = system["K1"]
    xyz = np.array([(5.0, 0.3, -1.0), (12.0, -0.4, -3.0)])
    shaken = replace(placed, rotation=placed.rotation @ rotation_from_vector(shake.turn))
    xy, added = steadied(placed, shake, shaken.project(xyz))
    assert np.allclose(xy, placed.project(xyz), atol=1e-6)
    by_turn = placed.linearised(xyz, placed.project(xyz))[2][:, :, 3:6]
    assert np.allclose(added, by_turn @ shake.covariance @ by_turn.transpose(0, 2, 1), rtol=0.01, atol=1e-5)
    image = ImageMeasurements(
        {"P1": PointMeasurement(shaken.project(xyz[0]), 0.01 * np.eye(2))},
        {"right": SkiMeasurement(shaken.project(xyz), np.full(2, 0.3))},
    )
    seen = PulseMeasurements(PulseNumber(7), UtcNs(0), {"K1": image, "K2": image})
    standing = Standing(system, {"K1": {PulseNumber(7): shake}})
    right = standing.measurements(seen)
    assert right.images["K2"] is image
    assert right.images["K1"].points["P1"].xy == pytest.approx(placed.project(xyz[0]), abs=1e-6)
    assert (np.linalg.eigvalsh(right.images["K1"].points["P1"].covariance - 0.01 * np.eye(2)) > 0).all()
    assert 0.02 < right.images["K1"].skis["right"].common < 0.05
    back = standing.in_frames(right)
    assert back.images["K1"].skis["right"].xy == pytest.approx(shaken.project(xyz), abs=1e-6)


def test_blocks_that_scatter_alike_show_no_move() -> None:
    rng = np.random.default_rng(4)
    noise = np.radians((0.004, 0.004, 0.002))
    alarms = 0
    for _ in range(100):
        blocks = [Block(10 * i, 10 * i + 9, rng.normal(0, noise), np.full(3, 1e-14)) for i in range(16)]
        alarms += bool(find_moves(blocks, 1))
        with_knock = [
            Block(b.first, b.last, b.turn + np.radians((0.05, 0, 0)) * (b.first >= 80), b.variance) for b in blocks
        ]
        (move,) = find_moves(with_knock, 1)
        assert (move.drift, move.before, move.after) == (False, 79, 80)
        drifting = [Block(b.first, b.last, b.turn + np.radians((0, 6e-4, 0)) * b.first, b.variance) for b in blocks]
        assert find_moves(drifting, 1)[0].drift
    assert alarms == 0  # 0.03 are expected


def test_a_move_in_words_has_a_form_in_json() -> None:
    said = move_said(
        "K2", np.radians((0.02, 0.05, 0.03)), np.array((0.02, 0.0, -0.01)), Move(True, 1, 90, np.zeros(3), 0.0)
    )
    assert to_builtins(said)["values"]["how"]["values"]["metres"] == 0.022


def test_turns_are_said_in_directions() -> None:
    assert [str(each) for each in turn_words(np.radians((0.0, 0.05, 0.001)))] == ["0.050 deg to the left"]
    assert [str(each) for each in turn_words(np.radians((-0.02, -0.05, 0.04)))] == [
        "0.050 deg to the right",
        "0.040 deg counter-clockwise",
        "0.020 deg down",
    ]
