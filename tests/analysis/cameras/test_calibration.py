"""Poses that `svev orient` found: the same cameras with the same covariance, compared with the balls of a log."""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.cameras.comparison import scene_of_calibration
from analysis.cameras.oriented_scene import OrientedScene, orientation_result, scene_of_survey
from analysis.cameras.poses_file import read_poses
from analysis.scene.survey import read_survey
from photogrammetry.network.file_writer import write_network
from photogrammetry.procedures.orientation import orient
from photogrammetry.reports.procedures import orientation_to_json
from rig.errors import BadInputError
from svev.cli import main
from tests.analysis.scene.hill import oriented, survey_json, training, training_detections, training_images
from tests.support.kept import kept_object


@cache
def _surveyed() -> OrientedScene:
    data = survey_json(training(), 1)
    for camera in data["cameras"].values():
        camera |= {"estimate": ["c"], "sigma": {"c": 0.5}}
    found: OrientedScene = kept_object("surveyed-scene", lambda: scene_of_survey(oriented(data)))
    return found


@cache
def _poses() -> dict[str, Any]:
    orientation = orient(_surveyed().network, uncertain_interior=True)
    result: dict[str, Any] = json.loads(json.dumps(orientation_to_json(orientation)))
    return result


@pytest.fixture
def read(tmp_path: Path) -> Callable[[dict[str, Any]], OrientedScene]:
    def compared(data: dict[str, Any]) -> OrientedScene:
        (tmp_path / "poses.json").write_text(json.dumps(data))
        return scene_of_calibration(training_images(), read_poses(tmp_path / "poses.json"), training_detections())

    return compared


Read = Callable[[dict[str, Any]], OrientedScene]


@pytest.mark.long
def test_the_network_beside_the_result_gives_the_same_poses(tmp_path: Path) -> None:
    scene = _surveyed()
    write_network(scene.network, tmp_path / "network.json")
    arguments = ["orient", str(tmp_path / "network.json"), "-o", str(tmp_path / "poses.json"), "--uncertain-interior"]
    assert main(arguments) == 0
    system, sizes = read_poses(tmp_path / "poses.json").system, {n: i.size for n, i in scene.static.items()}
    assert sizes == {name: system[name].camera.size for name in system.names}
    np.testing.assert_allclose(system.covariance, scene.system.covariance, rtol=1e-6, atol=1e-15)
    for name, placed in scene.system.cameras.items():
        sigma = np.sqrt(np.diagonal(scene.system.covariance))[placed.columns]
        assert (np.abs(system[name].position - placed.position) < 1e-6 * sigma[:3]).all()
        assert np.abs(system[name].rotation - placed.rotation).max() < 1e-6 * sigma[3:6].min()
        assert system[name].camera.interior[0] == pytest.approx(placed.camera.interior[0], abs=1e-6 * sigma[6])


def test_a_calibration_is_compared_with_the_balls_of_the_log(read: Read) -> None:
    scene = read(_poses())
    assert tuple(map(str, scene.messages)) == tuple(
        f"camera K{i}: {n} of {n} balls of the calibration found" for i, n in _counts()
    )
    for name, change in scene.changes.items():
        assert not change.left_out, name
        assert np.abs(change.turn).max() < 1e-6  # the images are those of the calibration
    result = orientation_result(scene)
    again = orientation_result(_surveyed())
    np.testing.assert_allclose(result.covariance, again.covariance, rtol=1e-9, atol=1e-18)
    assert result.parameters == again.parameters
    assert result.parameters[5:8] == ("K1.angle3", "K1.c", "K2.X0")
    assert result.images["K2"].sigma_angles == pytest.approx(again.images["K2"].sigma_angles)
    assert result.balls["B7"].images["K1"][:2] == pytest.approx(again.balls["B7"].images["K1"][:2], abs=1e-4)
    assert result.balls["B7"].sigma == pytest.approx(again.balls["B7"].sigma)
    assert result.source == orientation_result(read(_poses())).source


def _counts() -> list[tuple[int, int]]:
    return [(i, sum(f"K{i}" in b.images for b in _surveyed().balls.values())) for i in (1, 2, 3)]


def test_the_network_of_a_calibrated_log_is_near_its_poses(read: Read, tmp_path: Path) -> None:
    scene = read(_poses())
    write_network(scene.network, tmp_path / "network.json")
    assert main(["orient", str(tmp_path / "network.json"), "-o", str(tmp_path / "again.json")]) == 0
    system = read_poses(tmp_path / "again.json").system
    for name, placed in scene.system.cameras.items():
        sigma = np.sqrt(np.diagonal(scene.system.covariance))[placed.columns]
        assert (np.abs(system[name].position - placed.position) < sigma[:3]).all()


def test_without_joint_covariance_the_sigmas_stand_alone(read: Read) -> None:
    data = _poses() | {}
    del data["calibration"]
    scene = read(data)
    assert "holds no joint covariance, so that the poses' correlations are missing" in str(scene.messages[0])
    expected = np.diag(np.diagonal(_surveyed().system.covariance))
    np.testing.assert_allclose(scene.system.covariance, expected, rtol=1e-9, atol=1e-18)


def test_a_sigma_makes_an_interior_parameter_uncertain(tmp_path: Path) -> None:
    data = survey_json(training(), 2)
    data["cameras"]["K2"]["sigma"] = {"c": 2.0}
    (tmp_path / "survey.json").write_text(json.dumps(data))
    survey = read_survey(tmp_path / "survey.json")
    assert [camera.estimate for camera in survey.network.cameras] == [(), ("c",), ()]


def test_a_ball_that_was_moved_is_named(read: Read) -> None:
    data = json.loads(json.dumps(_poses()))
    data["points"]["B7"]["X"][2] += 0.05
    scene = read(data)
    (line,) = [message for message in map(str, scene.messages) if "B7" in message]
    assert line == "ball B7 is not where the calibration has it (cameras K1, K2, K3); it was moved, survey it again"
    assert "B7" not in scene.balls


def _without(camera: str) -> Callable[[dict[str, Any]], None]:
    def spoil(data: dict[str, Any]) -> None:
        del data["images"][camera]

    return spoil


def _twice(data: dict[str, Any]) -> None:
    data["images"]["again"] = data["images"]["K2"]


def _resized(data: dict[str, Any]) -> None:
    data["cameras"]["K3"]["size"] = [1936, 1216]


def _other_hill(data: dict[str, Any]) -> None:
    rng = np.random.default_rng(3)
    for point in data["points"].values():
        point["X"] = list(np.array(point["X"]) + rng.uniform(-4, 4, 3))


def _failed(data: dict[str, Any]) -> None:
    data |= {"converged": False}


def _torn(data: dict[str, Any]) -> None:
    data["calibration"]["covariance"].pop()


def _in_feet(data: dict[str, Any]) -> None:
    data |= {"length_unit": "ft"}


def _without_scale(data: dict[str, Any]) -> None:
    data |= {"length_unit": "", "control": []}


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (_in_feet, '"length_unit" is "ft", but jumps are measured in metres; write coordinates and sigmas in metres'),
        (_without_scale, 'says no "length_unit", and nothing surveyed gives its scale; adjust a network with surveyed'),
        (_without("K2"), r"camera K2 of the log is missing \(there: K1, K3\); name the result of svev orient"),
        (_twice, "camera K2 has several images, so where it stands is open; name the result of svev orient"),
        (_resized, "camera K3 was oriented with images of 1936 x 1216 px, those of the log have 640 x 480 px; orient"),
        (_other_hill, "in no camera are the balls where this calibration has them; name the calibration of these"),
        (_failed, "this calibration has no result"),
        (_torn, "calibration.covariance is not 21 x 21"),
    ],
    ids=["feet", "no scale", "camera missing", "two images", "image size", "other hill", "not converged", "covariance"],
)
def test_a_calibration_that_does_not_belong_to_the_log_is_refused(
    read: Read, spoil: Callable[[dict[str, Any]], None], message: str
) -> None:
    data = json.loads(json.dumps(_poses()))
    spoil(data)
    with pytest.raises(BadInputError, match=message) as error:
        read(data)
    assert "\n" not in str(error.value)


def test_a_survey_is_no_calibration(tmp_path: Path) -> None:
    (tmp_path / "survey.json").write_text(json.dumps(survey_json(training(), 1)))
    with pytest.raises(BadInputError, match=r"is a network or survey, .* a survey is given as --survey"):
        read_poses(tmp_path / "survey.json")
