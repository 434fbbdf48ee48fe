"""Where the balls should be in a picture: by the last orientation, by poses, by an approximate pose, by a plan."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from analysis.cameras.oriented_scene import OrientedScene, survey_id
from analysis.scene.orientation import Ball
from analysis.scene.survey import read_survey
from photogrammetry.network.model import Role
from rig.api.cameras.balls import BallSource, CameraBalls
from rig.clocks import UtcNs
from rig.errors import StorageError, UnknownCameraError
from rig.settings.file import CONFIG, load_rig
from rig.settings.model import AnalysisSettings, RigSettings
from service.aiming.balls import ORIENTATION, BallPlaces
from service.aiming.kept import keep
from service.aiming.places import Balls, places
from simrig.world.scenario import Scenario, SceneCamera, load_scenario
from tests.analysis.scene.hill import SIZE, balls_in, survey_json, survey_of, training
from tests.analysis.simulated import true_cameras

SIM = load_rig(CONFIG / "rigs" / "sim.toml")
HARD = load_scenario(CONFIG / "scenarios" / "hard.toml")
TIME = UtcNs(1_795_216_434_000_000_000)


def survey_file(path: Path, scenario: Scenario, poses: Callable[[SceneCamera], dict[str, Any]] | None = None) -> Path:
    """A survey without errors, of all balls, with poses of the cameras if they are asked for."""
    data = survey_json(scenario, 1)
    data["points"] = {b.name: {"role": "control", "X": list(b.X), "sigma": [0.012] * 3} for b in scenario.balls}
    for camera in scenario.cameras:
        lens = {key: value for key, value in camera.lens.model_dump().items() if value}
        data["cameras"][camera.name] |= lens | {"distortion": "projected"}
    if poses is not None:
        data["images"] = {camera.name: {"camera": camera.name} | poses(camera) for camera in scenario.cameras}
    path.write_text(json.dumps(data))
    return path


def true_pose(camera: SceneCamera) -> dict[str, Any]:
    projection = camera.projection(*SIZE)
    return {"X0": list(projection.X0), "R": projection.R.tolist()}


def surveyed(path: Path, rig: RigSettings = SIM) -> RigSettings:
    return rig.model_copy(update={"analysis": AnalysisSettings(survey=path)})


def largest_error(found: CameraBalls, scenario: Scenario) -> float:
    """Of the balls in the picture, px; all of them must be told, and no others."""
    true = balls_in(scenario, found.camera)
    told = {ball.name: np.array((ball.x, ball.y), float) for ball in found.balls if ball.inside}
    assert told.keys() == true.keys()
    return max(float(np.abs(told[name] - xy).max()) for name, xy in true.items())


@pytest.mark.parametrize("scenario", [training(), HARD], ids=["straight lens", "distorting lens"])
def test_an_approximate_pose_shows_where_the_balls_will_be(tmp_path: Path, scenario: Scenario) -> None:
    rig = surveyed(survey_file(tmp_path / "hill.json", scenario, true_pose))
    for name in ("K1", "K2", "K3"):
        found = BallPlaces(lambda: rig, tmp_path).of(name)
        assert (found.source, found.file, found.statement) == (BallSource.SURVEY, "hill.json", None)
        assert largest_error(found, scenario) < 0.01
        assert all(ball.sigma is None and ball.seen is None for ball in found.balls)
    with pytest.raises(UnknownCameraError, match="no camera K9"):
        BallPlaces(lambda: rig, tmp_path).of("K9")


def test_a_pose_that_says_how_good_it_is_gives_sigmas(tmp_path: Path) -> None:
    sigma = {"sigma": {"X0": [0.5] * 3, "angles": [0.01] * 3}}
    path = survey_file(tmp_path / "hill.json", training(), lambda camera: true_pose(camera) | sigma)
    (ball,) = [ball for ball in BallPlaces(lambda: surveyed(path), tmp_path).of("K1").balls if ball.name == "B10"]
    assert ball.sigma is not None
    # half a metre across at a distance of 48 m, and 0.01 rad, both seen with c = 1420 px
    assert ball.sigma[0] == pytest.approx(1420 * np.hypot(0.5 / 48, 0.01), rel=0.1)


def test_what_lies_beyond_the_picture_is_told_and_what_lies_behind_too() -> None:
    camera = replace(true_cameras()["K1"].camera, interior=np.array([1420, 0, 0, 0, 0, -4e-18, 0, 0, 0, 0], float))
    placed = replace(true_cameras()["K1"], camera=camera)
    aside = placed.position - 40 * placed.rotation[:, 2] + np.outer([-12.0, -60.0, 0.0], placed.rotation[:, 0])
    xyz = np.vstack((aside, placed.position + 5 * placed.rotation[:, 2]))
    left, far, middle, behind = places(
        placed, None, Balls(["left", "far", "middle", "behind"], xyz, np.zeros((4, 3, 3)))
    )
    assert (left.inside, far.inside, middle.inside, behind.inside) == (False, False, True, False)
    assert left.x is not None
    assert far.x is not None
    assert left.x == pytest.approx(319.5 - 426 * (1 - 4e-18 * 426**6), abs=0.01)
    assert far.x < left.x, "the polynomial of this lens would fold it back"
    assert (middle.x, middle.y) == pytest.approx((319.5, 239.5), abs=0.01)
    assert (behind.x, behind.y) == (None, None)


def test_the_last_orientation_counts_until_survey_or_region_is_another(tmp_path: Path) -> None:
    path = survey_file(tmp_path / "hill.json", training(), lambda camera: true_pose(camera) | {"X0": [0.0, -50.0, 9.0]})
    rig = surveyed(path)
    places_ = BallPlaces(lambda: rig, tmp_path)
    assert places_.of("K1").source is BallSource.SURVEY
    (tmp_path / ORIENTATION).write_text("{")  # a damaged file is no obstacle
    keep(scene(survey_id(read_survey(path).network), "K1", "K2"), "a", TIME, rig, tmp_path)
    keep(scene(survey_id(read_survey(path).network), "K2"), "b", TIME, rig, tmp_path)
    found = places_.of("K1")
    assert (found.source, found.recording, found.file) == (BallSource.ORIENTATION, "a", "hill.json")
    assert found.oriented is not None
    assert found.oriented.timestamp() * 1e9 == TIME
    assert largest_error(found, training()) < 0.01
    assert all(ball.sigma is not None and max(ball.sigma) < 1.0 for ball in found.balls if ball.inside)
    assert {ball.name for ball in found.balls if ball.seen} == {"B1", "B2"}
    assert (places_.of("K2").recording, places_.of("K3").source) == ("b", BallSource.SURVEY)
    moved = rig.cameras[0].model_copy(update={"region": rig.cameras[0].region.model_copy(update={"x": 8})})
    other = rig.model_copy(update={"cameras": (moved, *rig.cameras[1:])})
    assert BallPlaces(lambda: other, tmp_path).of("K1").source is BallSource.SURVEY
    survey_file(path, HARD, true_pose)
    assert places_.of("K1").source is BallSource.SURVEY, "another interior orientation"
    (tmp_path / ORIENTATION).unlink()
    (tmp_path / ORIENTATION).mkdir()
    with pytest.raises(StorageError, match=r"\.svev-orientation\.json: cannot be written .*make room"):
        keep(scene("", "K1"), "c", TIME, rig, tmp_path)


def scene(given: str, *names: str) -> OrientedScene:
    """True cameras and balls; two of the balls were found in the pictures of K1."""
    measured = {
        name: {"K1": np.zeros(4)} if name in {"B1", "B2"} else {} for name in (b.name for b in training().balls)
    }
    balls = {
        ball.name: Ball(ball.name, Role.CONTROL, np.array(ball.X), np.full(3, 0.01), measured[ball.name])
        for ball in training().balls
    }
    network = survey_of(survey_json(training(), 1)).network
    return OrientedScene(true_cameras().only(names), balls, network, {}, {}, (), given)


def test_poses_of_the_rig_file_come_first_and_what_is_missing_is_said(tmp_path: Path) -> None:
    assert said(BallPlaces(lambda: SIM, tmp_path).of("K1")) == ("balls_no_file", "info")
    path = survey_file(tmp_path / "hill.json", training())
    assert said(BallPlaces(lambda: surveyed(path), tmp_path).of("K1")) == ("balls_not_oriented", "info")
    path.write_text("{}")
    found = BallPlaces(lambda: surveyed(path), tmp_path).of("K1")
    assert said(found) == ("balls_unknown", "warning")
    assert found.statement is not None
    assert found.statement.text.startswith(f"where K1 shows the balls is not known: {path}: ")


def test_a_camera_that_the_survey_lacks_is_shown_by_the_plan_and_the_others_by_the_survey(tmp_path: Path) -> None:
    path = survey_file(tmp_path / "hill.json", training(), true_pose)
    data = json.loads(path.read_text())
    del data["cameras"]["K3"], data["images"]["K3"]
    path.write_text(json.dumps(data))
    missing = "camera K3 of the log is missing (there: K1, K2); name the cameras as in the log"
    without_plan = BallPlaces(lambda: surveyed(path), tmp_path)
    assert without_plan.of("K1").source is BallSource.SURVEY
    found = without_plan.of("K3")
    assert said(found) == ("balls_unknown", "warning")
    assert found.statement is not None
    assert missing in found.statement.text
    rig = SIM.model_copy(update={"plan": plan_file(tmp_path / "plan.toml", training())})
    planned = BallPlaces(lambda: surveyed(path, rig), tmp_path)
    assert planned.of("K1").source is BallSource.SURVEY
    found = planned.of("K3")
    assert found.source is BallSource.PLAN
    assert largest_error(found, training()) < 0.01
    assert found.statement is not None
    assert (found.statement.code, found.statement.level.value) == ("balls_by_plan", "warning")
    assert missing in found.statement.text


def said(found: CameraBalls) -> tuple[str, str]:
    assert (found.source, found.balls) == (None, ())
    assert found.statement is not None
    return found.statement.code, found.statement.level.value


PLAN = """name = "first day"
length_unit = "m"
sigma = { image = 0.33, control = 0.012 }
balls = [BALLS]
CAMERAS
"""


def plan_file(path: Path, scenario: Scenario, size: tuple[int, int] = SIZE) -> Path:
    balls = ", ".join(f'{{ name = "{b.name}", role = "{b.role}", X = {list(b.X)} }}' for b in scenario.balls)
    cameras = "\n".join(
        f'[[cameras]]\nname = "{c.name}"\nsize = {list(size)}\nc = {c.c}\n'
        f"images = [{{ X0 = {list(c.X0)}, look_at = {list(c.look_at or ())} }}]\n"
        for c in scenario.cameras
    )
    path.write_text(PLAN.replace("BALLS", balls).replace("CAMERAS", cameras))
    return path


def test_before_there_is_a_survey_the_plan_shows_them(tmp_path: Path) -> None:
    rig = SIM.model_copy(update={"plan": plan_file(tmp_path / "plan.toml", training())})
    for name in ("K1", "K2", "K3"):
        found = BallPlaces(lambda: rig, tmp_path).of(name)
        assert (found.source, found.file) == (BallSource.PLAN, "plan.toml")
        assert largest_error(found, training()) < 0.01
    survey = survey_file(tmp_path / "hill.json", training())
    assert BallPlaces(lambda: surveyed(survey, rig), tmp_path).of("K1").source is BallSource.PLAN, (
        "no camera is oriented yet"
    )
    plan_file(tmp_path / "plan.toml", training(), (1032, 778))
    found = BallPlaces(lambda: rig, tmp_path).of("K1")
    assert said(found) == ("balls_unknown", "warning")
    assert found.statement is not None
    assert "pictures of 1032 x 778 px there, and of 640 x 480 px in the rig file" in found.statement.text
    text = (tmp_path / "plan.toml").read_text().replace('"K1"', '"West"')
    (tmp_path / "plan.toml").write_text(text)
    found = BallPlaces(lambda: rig, tmp_path).of("K1")
    assert found.statement is not None
    assert "has 0 stations of K1" in found.statement.text
