"""The whole way from images and survey to oriented cameras, on the simulated hill; faults are named, never hidden."""

import json
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.scene.detection import Detections
from analysis.scene.orientation import Scene, orient_images, orient_log
from analysis.scene.survey import read_survey
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.model import Role
from recorder.log.triplet_buffers import TripletBuffers
from rig.errors import BadInputError
from rig.pulse import HillPulse
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario
from tests.analysis.scene.hill import (
    RATE_HZ,
    SIZE,
    balls_in,
    hill_images,
    normalized_error,
    oriented,
    survey_json,
    survey_of,
    training,
    training_detections,
    training_images,
    without_balls,
)
from tests.recorder.logs import LOST, OK, START, acquire, make_tag, open_writer
from tests.support.repeats import repeats


def _check(scene: Scene, scenario: Scenario, size: tuple[int, int] = SIZE) -> None:
    """Poses within 3 sigma; no ball measured where another one is; ties where balls are."""
    assert not scene.failures
    assert (np.abs(normalized_error(scene, scenario, size)) < 3.5).all()
    truth = {ball.name: (ball.role, np.array(ball.X)) for ball in scenario.balls}
    for camera in scenario.cameras:
        places = balls_in(scenario, camera.name, size)
        for ball in scene.balls.values():
            if camera.name in ball.images and ball.role is Role.CONTROL:
                off = ball.images[camera.name][:2] - places[ball.name]
                assert np.hypot(*off) < 0.2, f"{ball.name} in {camera.name}"
    for ball in scene.balls.values():
        if ball.role is Role.TIE:
            nearest = min(float(np.linalg.norm(ball.xyz - xyz)) for _, xyz in truth.values())
            assert nearest < 0.1, ball.name


def _write_log(path: Path, scenario: Scenario, pulses: int) -> None:
    """What a recorder would have written; K2 fails now and then."""
    shape = (SIZE[1], SIZE[0] * len(scenario.cameras))
    views = [CameraView(scenario, i, *SIZE, RATE_HZ) for i in range(len(scenario.cameras))]
    buffers = TripletBuffers(shape, 4)
    with open_writer(path, buffers) as log:
        for pulse in range(1, pulses + 1):
            slot = acquire(buffers)
            image = buffers.pixels(slot)
            statuses = tuple(LOST if i == 1 and pulse % 4 == 0 else OK for i in range(len(views)))
            for i, view in enumerate(views):
                block = image[:, i * SIZE[0] : (i + 1) * SIZE[0]]
                block[:] = 0
                if statuses[i] is OK:
                    view.render_into(block, HillPulse(pulse))
            log.write_pulse(make_tag(pulse, statuses, shape), slot, START)
    buffers.close()


def test_a_log_and_a_survey_file_give_the_poses(tmp_path: Path) -> None:
    _write_log(tmp_path / "log.mcap", training(), 45)
    (tmp_path / "survey.json").write_text(json.dumps(survey_json(training(), 1)))
    scene = orient_log(tmp_path / "log.mcap", read_survey(tmp_path / "survey.json"))
    _check(scene, training())
    assert list(scene.cameras) == ["K1", "K2", "K3"]
    assert sum(ball.role is Role.CONTROL for ball in scene.balls.values()) == 15
    assert [name for name, ball in scene.balls.items() if ball.role is Role.TIE] == [f"T{i}" for i in range(1, 7)]
    assert not [message for message in map(str, scene.messages) if "wrong" in message or "residuals" in message]
    assert "camera K1: 15 of 15 surveyed balls in sight named, 21 balls measured" in str(scene.messages[0])


@pytest.mark.long
def test_errors_of_the_poses_agree_with_their_sigmas() -> None:
    squares = np.array(
        [normalized_error(oriented(survey_json(training(), seed)), training()) ** 2 for seed in range(10, 22)]
    )
    # twelve surveys; the errors of one survey are common to all three cameras, so the mean scatters by 0.15
    assert 0.5 < float(squares.mean()) < 1.6


def test_uncertain_interior_orientations_are_estimated_with_the_poses() -> None:
    data = survey_json(training(), 2)
    for camera, off in zip(data["cameras"].values(), (4.0, -3.0, 6.0), strict=True):
        camera.update({"c": camera["c"] + off, "estimate": ["c"], "sigma": {"c": 5.0}})
    scene = oriented(data)
    _check(scene, training())
    assert not [message for message in map(str, scene.messages) if "residuals" in message]
    adjustment = scene.orientation.outcome.adjustment
    for index, camera in enumerate(training().cameras):
        ((c,), _) = adjustment.parameters(index)
        assert c.name == "c"
        assert abs(c.value - camera.projection(*SIZE).c) < 4 * c.sigma < 4.0


def _other_hill(seed: int) -> Scenario:
    """Other noise, other cameras on both sides, other balls, harder light."""
    rng = np.random.default_rng(seed)
    scenario = training()
    cameras = []
    for i, camera in enumerate(scenario.cameras):
        moved = np.array(camera.X0) + rng.uniform(-3, 3, 3)
        moved[1] *= -1 if i == 1 else 1
        change = {"X0": tuple(moved), "roll_deg": float(rng.uniform(-8, 8)), "c": camera.c * rng.uniform(0.8, 0.95)}
        cameras.append(camera.model_copy(update={**change, "gain": float(rng.uniform(0.5, 0.95))}))
    balls = tuple(
        ball.model_copy(update={"X": tuple(np.array(ball.X) + rng.uniform(-0.8, 0.8, 3))}) for ball in scenario.balls
    )
    image = scenario.image.model_copy(update={"noise_sigma": 4.0, "blur_sigma_px": 0.8, "snow_flakes": 300})
    return scenario.model_copy(update={"seed": seed, "cameras": tuple(cameras), "balls": balls, "image": image})


@pytest.mark.parametrize("seed", repeats([5, 6, 7]))
def test_other_hills_and_cameras_are_oriented_too(seed: int) -> None:
    scenario = _other_hill(seed)
    scene = orient_images(hill_images(scenario), survey_of(survey_json(scenario, seed)))
    _check(scene, scenario)
    assert sum(ball.role is Role.CONTROL for ball in scene.balls.values()) >= 12


def _best_detections() -> dict[str, Detections]:
    """The best of each image, where a search that finds nothing shall end soon: most of them are balls."""
    return {name: found.only(np.arange(16)) for name, found in training_detections().items()}


def test_an_approximate_pose_may_be_metres_and_degrees_off() -> None:
    rng = np.random.default_rng(8)
    data = survey_json(training(), 3)
    data["images"] = {}
    for camera in training().cameras:
        true = camera.projection(*SIZE)
        turn = rotation_from_vector(rng.normal(0, 0.04, 3))
        pose = {"X0": list(true.X0 + rng.normal(0, 1.5, 3)), "R": (true.R @ turn).tolist()}
        data["images"][f"view of {camera.name}"] = {"camera": camera.name, **pose}
    scene = oriented(data)
    _check(scene, training())
    assert list(scene.cameras) == ["K1", "K2", "K3"]
    data["images"]["view of K2"]["R"] = np.eye(3).tolist()  # worse than that is no hindrance either
    _check(orient_images(training_images(), survey_of(data), _best_detections()), training())


def test_three_balls_under_snow_are_named() -> None:
    images = without_balls(training_images(), training(), {"B2", "B9", "T4"})
    scene = orient_images(images, survey_of(survey_json(training(), 4)))
    _check(scene, training())
    assert "surveyed balls found in no image: B2, B9" in map(str, scene.messages)
    assert len(scene.balls) == 18


def test_a_camera_that_sees_no_balls_is_named_and_the_others_are_oriented() -> None:
    images = training_images()
    blind = images | {"K2": without_balls(images, training(), {b.name for b in training().balls})["K2"]}
    scene = orient_images(blind, survey_of(survey_json(training(), 5)))
    assert list(scene.cameras) == ["K1", "K3"]
    assert (np.abs(normalized_error(scene, training())) < 3.5).all()
    assert any(message.startswith("camera K2 is not oriented: ") for message in map(str, scene.messages))


def test_a_camera_that_the_survey_lacks_is_named_and_the_others_are_oriented() -> None:
    data = survey_json(training(), 5)
    del data["cameras"]["K3"]
    scene = oriented(data)
    assert list(scene.cameras) == ["K1", "K2"]
    assert (np.abs(normalized_error(scene, training())) < 3.5).all()
    words = "survey.json: camera K3 of the log is missing (there: K1, K2); name the cameras as in the log"
    assert f"camera K3 is not oriented: {words}" in map(str, scene.messages)
    assert {name: str(why) for name, why in scene.failures.items()} == {"K3": words}


def test_wrong_spots_in_all_images_are_thrown_out() -> None:
    rng = np.random.default_rng(9)
    images = {}
    for name, image in training_images().items():
        grey = image.grey.copy()
        y, x = np.mgrid[: SIZE[1], : SIZE[0]]
        for _ in range(20):
            place, radius = rng.uniform((15, 15), np.array(SIZE) - 15), rng.uniform(2, 4)
            if min(np.hypot(*(place - ball)) for ball in balls_in(training(), name).values()) > 16:
                cover = np.clip(radius - np.hypot(x - place[0], y - place[1]) + 0.5, 0, 1)
                grey += (cover * (rng.choice([20, 230]) - grey)).astype(np.float32)
        images[name] = replace(image, grey=grey)
    _check(orient_images(images, survey_of(survey_json(training(), 6))), training())


def test_a_ball_that_was_surveyed_wrong_is_found() -> None:
    data = survey_json(training(), 7)
    data["points"]["B7"]["X"][0] += 0.2
    scene = oriented(data)
    assert (np.abs(normalized_error(scene, training())) < 3.5).all()
    (noted,) = [
        message for message in map(str, scene.messages) if message.startswith("the images show a ball at B7 + (")
    ]
    assert float(noted.split("(")[1].split(",")[0]) == pytest.approx(-0.2, abs=0.05)
    assert any(message.startswith("control point B7: wrong by about (0.") for message in map(str, scene.messages))


def test_coordinates_of_two_balls_that_were_exchanged_leave_the_poses_right() -> None:
    """Nothing in the images tells a ball's name: its name is that of the coordinates at which it is."""
    data = survey_json(training(), 8)
    points = data["points"]
    points["B3"]["X"], points["B14"]["X"] = points["B14"]["X"], points["B3"]["X"]
    scene = oriented(data)
    assert (np.abs(normalized_error(scene, training())) < 3.5).all()
    assert scene.balls["B3"].xyz == pytest.approx(points["B3"]["X"], abs=0.05)


def test_a_check_point_is_measured_but_does_not_take_part() -> None:
    data = survey_json(training(), 9)
    data["points"]["B5"] = {"role": "check", "X": data["points"]["B5"]["X"]}
    scene = oriented(data)
    assert scene.balls["B5"].role is Role.CHECK
    assert len(scene.balls["B5"].images) == 3


def _scrambled(data: dict[str, Any]) -> dict[str, Any]:
    other = deepcopy(data)
    rng = np.random.default_rng(10)
    for point in other["points"].values():
        if point["role"] == "control":
            point["X"] = list(np.array(point["X"]) + rng.uniform(-4, 4, 3))
    return other


def _metric(data: dict[str, Any]) -> dict[str, Any]:
    return data | {"image_frame": "metric"}


def _resized(data: dict[str, Any]) -> dict[str, Any]:
    other = deepcopy(data)
    other["cameras"]["K2"]["size"] = [1936, 1216]
    return other


def _renamed(data: dict[str, Any]) -> dict[str, Any]:
    other = deepcopy(data)
    other["cameras"]["Cam2"] = other["cameras"].pop("K2")
    other["cameras"]["Cam3"] = other["cameras"].pop("K3")
    return other


def _few(data: dict[str, Any]) -> dict[str, Any]:
    other = deepcopy(data)
    other["points"] = {name: other["points"][name] for name in ("B1", "B2", "B3", "T1")}
    return other


def _wrong_c(data: dict[str, Any]) -> dict[str, Any]:
    other = deepcopy(data)
    for camera in other["cameras"].values():
        camera["c"] *= 1.4
    return other


def _with_coordinates(change: Callable[[list[float]], list[float]]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    def spoil(data: dict[str, Any]) -> dict[str, Any]:
        other = deepcopy(data)
        for point in other["points"].values():
            if point["X"] is not None:
                point["X"] = change(point["X"])
        return other

    return spoil


def _same_place(data: dict[str, Any]) -> dict[str, Any]:
    other = deepcopy(data)
    other["points"]["B7"]["X"] = other["points"]["B2"]["X"]
    return other


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (
            _with_coordinates(lambda xyz: [1000 * x for x in xyz]),
            "the balls in the images are .* m across, .* in metres",
        ),
        pytest.param(
            _with_coordinates(lambda xyz: [xyz[1], xyz[0], xyz[2]]),
            "as in a mirror: its axes are left-handed",
            marks=pytest.mark.long,
        ),
        (_same_place, "balls B2 and B7 have the same coordinates; correct one of them"),
        pytest.param(
            _scrambled,
            r"camera K1: \d+ round spots found, which do not fit the 15 surveyed balls.*; camera K2: .*K3: ",
            marks=pytest.mark.long,
        ),
        pytest.param(
            _wrong_c,
            "camera K1: .* do not fit the 15 surveyed balls .*; check survey and interior orientation",
            marks=pytest.mark.long,
        ),
        (_resized, "camera K2 is calibrated for images of 1936 x 1216 px, those of the log have 640 x 480 px; give"),
        (_renamed, r"camera K2 of the log is missing \(there: K1, Cam2, Cam3\); name the cameras as in the log"),
        (_few, "has 3 surveyed balls .* at least 4"),
        (_metric, '"image_frame" is "metric"; a survey for a log needs c, x0, y0 in px'),
        (lambda data: data | {"length_unit": "ft"}, '"length_unit" is "ft", but jumps are measured in metres'),
    ],
    ids=[
        "millimetres",
        "left-handed",
        "twice the same",
        "survey of another hill",
        "other calibration",
        "image size",
        "camera's name",
        "few balls",
        "metric",
        "feet",
    ],
)
def test_what_does_not_belong_to_the_log_is_refused_in_one_line(tmp_path: Path, spoil: Any, message: str) -> None:
    (tmp_path / "survey.json").write_text(json.dumps(spoil(survey_json(training(), 11))))
    with pytest.raises(BadInputError, match=message) as error:
        orient_images(training_images(), read_survey(tmp_path / "survey.json"), _best_detections())
    assert "\n" not in str(error.value)


def test_a_measured_network_is_no_survey(tmp_path: Path) -> None:
    data = survey_json(training(), 12)
    data["images"] = {"K1": {"camera": "K1"}}
    data["observations"] = [["K1", "B1", 1.0, 2.0, 0.1]]
    (tmp_path / "survey.json").write_text(json.dumps(data))
    with pytest.raises(BadInputError, match='has "observations", so it is a measured network'):
        read_survey(tmp_path / "survey.json")
    data |= {"observations": [], "images": {name: {"camera": "K1"} for name in ("a", "b")}}
    (tmp_path / "survey.json").write_text(json.dumps(data))
    with pytest.raises(BadInputError, match="camera K1 has several images; give one approximate pose at most"):
        read_survey(tmp_path / "survey.json")


@pytest.mark.long
def test_a_principal_distance_that_is_a_little_wrong_is_said() -> None:
    data = survey_json(training(), 13)
    data["cameras"]["K1"]["c"] *= 1.01
    scene = oriented(data)
    assert any(message.startswith("the residuals are ") for message in map(str, scene.messages))
    assert (np.abs(normalized_error(scene, training())) < 4).all()
