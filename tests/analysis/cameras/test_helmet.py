"""The helmet as a tie point makes the poses better, and their sigmas stay true."""

import numpy as np
import pytest

from analysis.cameras.helmet import with_helmet
from analysis.cameras.oriented_scene import OrientedScene, scene_of_survey
from analysis.cameras.pose_change import PoseChange
from analysis.cameras.standing import SteadiedJump
from analysis.measurements.model import MeasuredCamera
from analysis.scene.orientation import scene_of
from analysis.scene.static_image import StaticImage
from photogrammetry.geometry.rotation import vector_from_rotation
from photogrammetry.procedures.orientation import orient
from rig.arrays import Floats
from rig.errors import BadInputError
from tests.analysis.scene.hill import SIZE, survey_json, survey_of, training
from tests.analysis.simulated import RATE_HZ, simulated_measurements, true_cameras, true_jump

_BALL_SIGMA = 0.6  # px: in balls that were measured so badly the helmet can help


def _scene(seed: int) -> OrientedScene:
    """The training hill, oriented by image points of balls with errors, without images."""
    rng = np.random.default_rng(seed)
    data = survey_json(training(), seed)
    data["images"] = {camera.name: {"camera": camera.name} for camera in training().cameras}
    data["observations"] = []
    for camera in training().cameras:
        projection = camera.projection(*SIZE)
        for ball in training().balls:
            if projection.sees(place := projection.pixels(ball.X)):
                row = [camera.name, ball.name, *(place + rng.normal(0, _BALL_SIGMA, 2)).tolist(), _BALL_SIGMA]
                data["observations"].append(row)
    network = survey_of(data).network
    blank = np.zeros(SIZE[::-1], np.float32)
    static = {camera.name: StaticImage(camera.name, blank, blank, 1) for camera in training().cameras}
    return scene_of_survey(scene_of(network, orient(network), static, {}, ()))


def _normalized(scene: OrientedScene) -> Floats:
    errors = []
    for camera in training().cameras:
        found, true = scene.system[camera.name], camera.projection(*SIZE)
        off = np.concatenate((found.position - true.X0, vector_from_rotation(true.R.T @ found.rotation)))
        errors.append(off / np.sqrt(np.diagonal(scene.system.covariance))[found.columns[:6]])
    return np.array(errors)


def test_the_helmet_ties_the_images() -> None:
    squares, ratios = [], []
    for seed in (3, 4, 5):
        scene = _scene(seed)
        # K3 is exposed 4 ms longer than the others, so that it shows the helmet 2 ms later
        cameras = {name: MeasuredCamera(SIZE, 0.004 * (name == "K3")) for name in scene.system.names}
        rng = np.random.default_rng(seed)
        measured = simulated_measurements(true_jump(seed), true_cameras(), rng, late_s={"K3": 0.002})
        better, orientation = with_helmet(scene, [SteadiedJump(measured.jumps[0], scene.system)], cameras, RATE_HZ)
        places = sum(point.name.startswith("H") for point in better.network.points)
        assert places > 20
        assert orientation.notes[0] == f"alternative 2: {places} moving points tie the images beside the static ones"
        assert str(better.messages[0]) == f"{places} places of the helmet tie the images beside the balls"
        assert set(better.balls) == set(scene.balls)
        ratios.append(np.sqrt(np.diagonal(better.system.covariance) / np.diagonal(scene.system.covariance)))
        squares.append(_normalized(better) ** 2)
    assert np.mean(ratios) < 0.95
    # three draws of survey and images, the survey's errors common to all cameras: the mean scatters by 0.3
    assert 0.3 < float(np.mean(squares)) < 1.9


def test_a_calibration_is_not_changed_by_helmets() -> None:
    scene = _scene(3)
    still = PoseChange(np.zeros(3), np.zeros(3), np.eye(6), (), (), 1.0)
    calibrated = OrientedScene(scene.system, scene.balls, scene.network, scene.static, {"K1": still}, ())
    with pytest.raises(BadInputError, match="cannot improve poses of a calibration; orient the log with --survey"):
        with_helmet(calibrated, [], {}, RATE_HZ)
    with pytest.raises(BadInputError, match="no helmet was measured by two cameras"):
        with_helmet(scene, [], {}, RATE_HZ)
