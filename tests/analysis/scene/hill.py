"""Static images and surveys of a simulated hill, and how far its truth is from what was oriented."""

from collections.abc import Collection
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from analysis.scene.detection import Detections, detect_balls
from analysis.scene.orientation import Scene, orient_images
from analysis.scene.static_image import StaticImage, static_image
from analysis.scene.survey import Survey
from photogrammetry.geometry.rotation import vector_from_rotation
from photogrammetry.network.file import network_from_json
from rig.arrays import Floats
from rig.pulse import HillPulse
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario, load_scenario
from tests.support.kept import kept_object

SIZE = (640, 480)
RATE_HZ = 30.0
SURVEY_SIGMA = 0.012  # m


@cache
def training() -> Scenario:
    """The scenario that is shipped, without a stamp."""
    return load_scenario(Path("config/scenarios/training.toml")).model_copy(update={"stamp": False})


def hill_images(scenario: Scenario, size: tuple[int, int] = SIZE, frames: int = 15) -> dict[str, StaticImage]:
    """The static image of each camera, from frames in which a jumper flies through."""
    images = {}
    for index, camera in enumerate(scenario.cameras):
        view = CameraView(scenario, index, *size, RATE_HZ)
        shown = []
        for pulse in range(15, 15 + 2 * frames, 2):
            out = np.empty(size[::-1], np.uint8)
            view.render_into(out, HillPulse(pulse))
            shown.append(out)
        images[camera.name] = static_image(camera.name, shown)
    return images


@cache
def training_images() -> dict[str, StaticImage]:
    """Those of the training scenario; not to be changed."""
    found: dict[str, StaticImage] = kept_object("training-images", lambda: hill_images(training()))
    return found


@cache
def training_detections() -> dict[str, Detections]:
    """What is found in them."""

    def detect() -> dict[str, Detections]:
        return {name: detect_balls(image) for name, image in training_images().items()}

    found: dict[str, Detections] = kept_object("training-detections", detect)
    return found


def oriented(data: dict[str, Any]) -> Scene:
    """The training scenario, oriented with a survey file's object."""
    return orient_images(training_images(), survey_of(data), training_detections())


def survey_json(
    scenario: Scenario, seed: int, sigma: float = SURVEY_SIGMA, size: tuple[int, int] = SIZE
) -> dict[str, Any]:
    """The survey of a scenario with errors, as the file holds it; tie balls without coordinates."""
    rng = np.random.default_rng(seed)
    control = {
        ball.name: {"role": "control", "X": list(ball.X + rng.normal(0, sigma, 3)), "sigma": [sigma] * 3}
        for ball in scenario.balls
        if ball.role == "control"
    }
    ties = {ball.name: {"role": "tie", "X": None} for ball in scenario.balls if ball.role == "tie"}
    cameras = {camera.name: {"size": list(size), "c": camera.projection(*size).c} for camera in scenario.cameras}
    return {
        "format": "svev-network/1",
        "length_unit": "m",
        "image_frame": "pixel",
        "cameras": cameras,
        "points": control | ties,
    }


def survey_of(data: dict[str, Any]) -> Survey:
    """A survey file's object as a survey."""
    return Survey(network_from_json({"images": {}, "observations": [], **data}, "survey.json"), "survey.json")


def balls_in(scenario: Scenario, camera: str, size: tuple[int, int] = SIZE) -> dict[str, Floats]:
    """Where each ball in sight really is in a camera's image, px."""
    settings = scenario.cameras[scenario.camera_index(camera)]
    projection = settings.projection(*size)
    places = {ball.name: projection.pixels(ball.X) for ball in scenario.balls}
    return {name: place for name, place in places.items() if projection.sees(place)}


def without_balls(images: dict[str, StaticImage], scenario: Scenario, names: Collection[str]) -> dict[str, StaticImage]:
    """The images with snow over some balls."""
    covered = {}
    for camera, image in images.items():
        grey = image.grey.copy()
        for name, (x, y) in balls_in(scenario, camera).items():
            if name in names:
                column, row = round(float(x)), round(float(y))
                grey[max(0, row - 11) : row + 12, max(0, column - 11) : column + 12] = 150.0
        covered[camera] = replace(image, grey=grey)
    return covered


def normalized_error(scene: Scene, scenario: Scenario, size: tuple[int, int] = SIZE) -> Floats:
    """Errors over sigmas of X0 and of the angles of each oriented camera: (cameras, 6)."""
    errors = []
    for camera in scenario.cameras:
        if camera.name in scene.cameras:
            found, true = scene.cameras[camera.name], camera.projection(*size)
            turn = vector_from_rotation(true.R.T @ found.rotation)
            off = np.concatenate((found.position - true.X0, turn))
            errors.append(off / np.sqrt(np.diagonal(found.covariance)))
    return np.array(errors)
