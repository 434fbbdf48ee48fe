"""Balls in a plane, seen from afar: names are told, and no pose is believed between two that fit them alike."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from analysis.scene.detection import Detections
from analysis.scene.naming import Spots, name_balls
from analysis.scene.orientation import orient_images
from analysis.scene.reflection import with_better_pose
from analysis.scene.static_image import StaticImage
from analysis.scene.survey import Survey
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.diagnosis import NotSolvableError
from photogrammetry.network.file import network_from_json
from rig.arrays import Floats
from rig.images.viewing import look_at

SIZE = (640, 480)
SIGMA_PX, BALL_M = 0.3, 0.05
#: Thirteen balls on a slope of 3 m by 2 m.
SLOPE = np.column_stack((np.random.default_rng(31).uniform((0, 0), (3.0, 2.0), (13, 2)), np.zeros(13)))


@dataclass(frozen=True, slots=True, eq=False)
class Field:
    """A survey, what two cameras show of it, and where these are."""

    survey: Survey
    static: dict[str, StaticImage]
    detections: dict[str, Detections]
    cameras: dict[str, IdealCamera]


def _field(distance: float, sigma: float, poses: bool = False) -> Field:
    rng = np.random.default_rng(5)
    tilted = SLOPE @ np.array([[1.0, 0.0, 0.0], [0.0, np.cos(0.9), np.sin(0.9)], [0.0, -np.sin(0.9), np.cos(0.9)]])
    middle = tilted.mean(axis=0)
    c = 150.0 * distance
    cameras, static, detections = {}, {}, {}
    for name, azimuth in (("K1", -0.35), ("K2", 0.25)):
        place = middle + distance * np.array([np.sin(azimuth), -np.cos(azimuth), 0.1])
        camera = cameras[name] = IdealCamera(c, place, look_at(place, middle))
        xy = camera.project(tilted) * (1.0, -1.0) + (np.array(SIZE) - 1) / 2 + rng.normal(0.0, SIGMA_PX, (13, 2))
        blank = np.zeros(SIZE[::-1], np.float32)
        static[name] = StaticImage(name, blank, blank, 1)
        covariance, ones = np.tile(np.eye(2) * SIGMA_PX**2, (13, 1, 1)), np.ones(13)
        detections[name] = Detections(xy, covariance, ones * c * BALL_M / distance, 100 * ones, 100 * ones)
    return Field(_survey(tilted, sigma, cameras, poses, rng), static, detections, cameras)


def _survey(
    xyz: Floats, sigma: float, cameras: dict[str, IdealCamera], poses: bool, rng: np.random.Generator
) -> Survey:
    near = {
        f"of {name}": {"camera": name, "X0": (camera.X0 + np.array([2.0, 3.0, -1.0])).tolist(), "R": camera.R.tolist()}
        for name, camera in cameras.items()
    }
    data: dict[str, Any] = {
        "format": "svev-network/1",
        "length_unit": "m",
        "image_frame": "pixel",
        "cameras": {name: {"size": list(SIZE), "c": camera.c} for name, camera in cameras.items()},
        "images": near if poses else {},
        "points": {
            f"B{i + 1}": {"role": "control", "X": list(x + rng.normal(0.0, sigma, 3)), "sigma": [sigma] * 3}
            for i, x in enumerate(xyz)
        },
        "observations": [],
    }
    return Survey(network_from_json(data, "survey.json"), "survey.json")


def _off(field: Field) -> float:
    scene = orient_images(field.static, field.survey, field.detections)
    return max(float(np.linalg.norm(scene.cameras[name].position - field.cameras[name].X0)) for name in field.cameras)


def test_a_plane_of_balls_from_afar_is_not_oriented_by_chance() -> None:
    field = _field(250.0, 0.004)
    with pytest.raises(NotSolvableError, match="image K1 has 2 poses between which the residuals do not decide"):
        orient_images(field.static, field.survey, field.detections)


def test_approximate_poses_in_the_survey_decide() -> None:
    assert _off(_field(250.0, 0.004, poses=True)) < 10.0


def test_from_near_the_residuals_decide() -> None:
    assert _off(_field(20.0, 0.001)) < 0.5


def test_a_naming_at_the_reflected_pose_gets_the_better_one() -> None:
    for distance, sigma, doubtful in ((20.0, 0.001, False), (250.0, 0.004, True)):
        field = _field(distance, sigma)
        camera, known = field.survey.camera("K1"), field.survey.surveyed()
        seen = field.detections["K1"]
        spots = Spots((seen.xy - (np.array(SIZE) - 1) / 2) * (1.0, -1.0), seen.covariance)
        named = with_better_pose(name_balls(camera, spots, known), camera, spots, known)
        assert named.doubtful is doubtful
        assert sorted(named.points[np.argsort(named.spots)]) == list(range(13))
        if not doubtful:
            assert np.linalg.norm(named.pose.position - field.cameras["K1"].X0) < 0.5
