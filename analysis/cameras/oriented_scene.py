"""The oriented cameras and balls of a recording, wherever the poses come from, and what its result says about them."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.cameras.pose_change import Displacements, PoseChange
from analysis.result.model import BallResult, CameraMove, OrientationResult, OrientedImage
from analysis.scene.camera_system import CameraSystem, camera_system
from analysis.scene.orientation import Ball, Scene
from analysis.scene.static_image import StaticImage
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import Network
from photogrammetry.reports.result_file import POSE
from rig.arrays import Floats
from rig.phrase import Phrase

_DIGITS = 16  # of the hash that identifies a calibration


@dataclass(frozen=True, slots=True, eq=False)
class OrientedScene:
    """The cameras of a recording and the balls that they show.

    Attributes:
        system: the cameras with their joint covariance.
        balls: by name; their image points are those of this recording's static images.
        network: the balls as they were measured, as `svev orient` takes them.
        static: the static images.
        changes: by camera, the change of its pose from `system` to the static image. Empty if the poses were
            estimated from the static images themselves.
        messages: what a person should know.
        given: identifies survey and interior orientation that the cameras were oriented with; empty if not known.
    """

    system: CameraSystem
    balls: Mapping[str, Ball]
    network: Network
    static: Mapping[str, StaticImage]
    changes: Mapping[str, PoseChange]
    messages: tuple[Phrase, ...]
    given: str = ""


def scene_of_survey(scene: Scene, given: str = "") -> OrientedScene:
    """A scene that was oriented from its own images and a survey; `given` identifies the latter (`survey_id`)."""
    system = camera_system(scene.orientation, tuple(scene.static))
    return OrientedScene(system, scene.balls, scene.network, scene.static, {}, scene.messages, given)


def orientation_result(
    scene: OrientedScene, moved: Sequence[CameraMove] = (), messages: Sequence[Phrase] = ()
) -> OrientationResult:
    """What the result of a recording says about its cameras.

    Args:
        scene: cameras and balls.
        moved: cameras that moved.
        messages: more of what a person should know.
    """
    system = scene.system
    images = {}
    for name, placed in system.cameras.items():
        sigma = np.sqrt(np.maximum(np.diagonal(system.covariance)[placed.columns[:6]], 0.0))
        images[name] = OrientedImage(placed.position, placed.rotation, sigma[:3], np.degrees(sigma[3:]))
    balls = {name: BallResult(b.role.value, b.xyz, b.sigma, b.images) for name, b in scene.balls.items()}
    return OrientationResult(
        images,
        balls,
        tuple(moved),
        tuple(message.text for message in (*scene.messages, *messages)),
        parameter_names(system),
        system.covariance,
        calibration_id(system),
        scene.given if system.given is not None else "",
        system.given,
    )


def parameter_names(system: CameraSystem) -> tuple[str, ...]:
    """Names of the uncertain parameters, such as "K1.X0", "K1.angle1" (about the camera's own axis r1) or "K2.c"."""
    names = [""] * len(system.covariance)
    for camera, placed in system.cameras.items():
        of_camera = (*POSE, *(INTERIOR[i] for i in placed.interior))
        for column, parameter in zip(placed.columns, of_camera, strict=True):
            names[column] = f"{camera}.{parameter}"
    return tuple(names)


def calibration_id(system: CameraSystem) -> str:
    """Identifies oriented cameras: the hash of all values and of their covariance."""
    digest = hashlib.sha256()
    for name, placed in system.cameras.items():
        digest.update(name.encode())
        for values in (placed.position, placed.rotation, placed.camera.interior):
            digest.update(np.ascontiguousarray(values, "<f8").tobytes())
    digest.update(np.ascontiguousarray(system.covariance, "<f8").tobytes())
    return digest.hexdigest()[:_DIGITS]


def survey_id(survey: Network) -> str:
    """Identifies what was given: the hash of interior orientations and coordinates with their sigmas."""
    digest = hashlib.sha256()
    for camera in survey.cameras:
        digest.update(f"{camera.name} {camera.balance} {camera.distortion} {sorted(camera.sigma.items())}".encode())
        digest.update(np.ascontiguousarray(camera.interior, "<f8").tobytes())
    for point in survey.points:
        digest.update(f"{point.name} {point.role}".encode())
        for values in (point.xyz, point.sigma):
            digest.update(b"-" if values is None else np.ascontiguousarray(values, "<f8").tobytes())
    return digest.hexdigest()[:_DIGITS]


def displacements(
    before: Mapping[str, Floats], after: Mapping[str, Floats], balls: Mapping[str, Floats], model_sigma: float
) -> Displacements:
    """Displacements of the balls that are in two images of one camera.

    Args:
        before: by ball (4,) x, y, sigma x, sigma y, px.
        after: likewise.
        balls: their coordinates (3,).
        model_sigma: of each coordinate of the difference, px: what the shape of the balls leaves out.
    """
    names = tuple(name for name in before if name in after and name in balls)
    rows = np.array([(before[n], after[n]) for n in names], float).reshape(-1, 2, 4)
    variance = (rows[:, :, 2:] ** 2).sum(axis=1) + model_sigma**2
    xyz = np.array([balls[n] for n in names], float).reshape(-1, 3)
    return Displacements(names, xyz, rows[:, 0, :2], rows[:, 1, :2], variance[:, :, None] * np.eye(2))
