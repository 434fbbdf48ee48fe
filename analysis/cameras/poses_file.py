"""Reads oriented cameras from a result file of `svev orient` (`svev-adjustment/1`), for logs of the same cameras.

Besides poses and their covariance the file tells where each image showed each ball. A log's balls are compared with
those places, camera by camera, so that errors of the survey cancel.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import numpy as np
from pydantic import BaseModel, Field

from analysis.scene.camera_system import CameraSystem, PlacedCamera
from analysis.scene.units import require_metres
from photogrammetry.geometry.camera_model import INTERIOR, Distortion
from photogrammetry.geometry.rotation import nearest_rotation
from photogrammetry.network.calibration_file import read_calibration
from photogrammetry.network.entries import Finite, Rotation, Triple
from photogrammetry.network.model import Camera
from photogrammetry.network.strict_text import read_json
from photogrammetry.reports.result_file import POSE
from rig.arrays import Floats, Integers
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase
from rig.settings.strict_toml import validate

_NotNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0)]
_Sigmas = Annotated[list[_NotNegative], Field(min_length=3, max_length=3)]
_ASYMMETRY: Final = 1e-6  # of a covariance, relative; more is no rounding


@dataclass(frozen=True, slots=True, eq=False)
class KnownBall:
    """A ball of the calibration.

    Attributes:
        xyz: (3,) adjusted coordinates.
        covariance: (3, 3).
        surveyed: whether it was a control point.
        images: by camera (4,) residuals x, y (adjusted - observed), sigmas of the observation x, y; px, pixel frame.
    """

    xyz: Floats
    covariance: Floats
    surveyed: bool
    images: Mapping[str, Floats]


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Oriented cameras as a file holds them.

    Attributes:
        source: the file, for messages.
        system: the cameras with their joint covariance; a camera's size is None where the file does not say it.
        balls: by name.
        length_unit: of the object system.
        messages: what a person should know.
        ball_radius_m: of the balls; None if it is not known.
    """

    source: str
    system: CameraSystem
    balls: Mapping[str, KnownBall]
    length_unit: str
    messages: tuple[Phrase, ...]
    ball_radius_m: float | None = None

    def of_images(self, sizes: Mapping[str, tuple[int, int]]) -> tuple[CameraSystem, list[Phrase]]:
        """The cameras of a log, in its order, and what there is to say.

        Args:
            sizes: width and height of the images of each camera of the log.

        Raises:
            BadInputError: a camera is missing, or was oriented with images of another size.
        """
        placed: dict[str, PlacedCamera] = {}
        notes: list[Phrase] = []
        for name, size in sizes.items():
            if name not in self.system.cameras:
                there = ", ".join(self.system.names)
                raise BadInputError(
                    phrase(
                        "poses_no_camera",
                        "{source}: camera {camera} of the log is missing (there: {there}); name the result of svev "
                        "orient for these cameras, named as in the log",
                        source=self.source,
                        camera=name,
                        there=there,
                    )
                )
            known = self.system[name].camera.size
            if known is None:
                text = "{source} does not say the image size of camera {camera}; taken as that of the log"
                notes.append(phrase("poses_size_taken", text, source=self.source, camera=name))
            elif known != size:
                raise BadInputError(
                    phrase(
                        "poses_size",
                        "{source}: camera {camera} was oriented with images of {size} px, those of the log have "
                        "{here} px; orient it with images of this size",
                        source=self.source,
                        camera=name,
                        size=f"{known[0]} x {known[1]}",
                        here=f"{size[0]} x {size[1]}",
                    )
                )
            placed[name] = replace(self.system[name], camera=replace(self.system[name].camera, size=size))
        notes += [
            phrase("poses_no_image", "camera {camera} of the calibration has no image in the log", camera=name)
            for name in self.system.names
            if name not in sizes
        ]
        return CameraSystem(placed, self.system.covariance).only(tuple(placed)), notes


class _Image(BaseModel):
    """One of `images` of a result."""

    camera: Annotated[str, Field(strict=True)]
    X0: Triple
    R: Rotation
    sigma_X0: _Sigmas  # noqa: N815
    sigma_angles: _Sigmas


class _Point(BaseModel):
    """One of `points` of a result."""

    X: Triple
    covariance: Annotated[list[Triple], Field(min_length=3, max_length=3)]


class _Observation(BaseModel):
    """One of `observations` of a result."""

    image: Annotated[str, Field(strict=True)]
    point: Annotated[str, Field(strict=True)]
    vx: Finite
    vy: Finite
    sigma: Annotated[list[_NotNegative], Field(min_length=2, max_length=2)] | None = None


class _Parameter(BaseModel):
    """What a row of the joint covariance belongs to."""

    image: str | None = None
    camera: str | None = None
    parameter: Annotated[str, Field(strict=True)]


class _Joint(BaseModel):
    """`calibration` of a result."""

    parameters: list[_Parameter]
    covariance: list[list[Finite]]


class _CameraExtras(BaseModel):
    """What `read_calibration` leaves out."""

    size: Annotated[list[int], Field(min_length=2, max_length=2)] | None = None
    sigma: dict[str, _NotNegative] = {}


class _Result(BaseModel):
    """The members of a result that an orientation has; all others are ignored."""

    image_frame: Literal["pixel", "metric"] = "pixel"
    length_unit: str = "m"
    ball_radius_m: Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0.0)] | None = None
    cameras: dict[str, Any]
    images: dict[str, Any]
    points: dict[str, Any] = {}
    observations: list[Any] = []
    control: list[Any] = []
    calibration: _Joint | None = None


def read_poses(path: Path) -> Calibration:
    """Read the result of `svev orient`.

    Raises:
        BadInputError: no result file, one without poses or without a result, several images of a camera, a metric
            image frame, another unit than the metre or none, or a covariance that does not fit; one line that says
            what to do.
    """
    interior = read_calibration(path)
    result = validate(_Result, read_json(path), path)
    if result.image_frame != "pixel":
        raise BadInputError(
            phrase(
                "poses_metric",
                '{path}: "image_frame" is "{frame}"; cameras of a log need c, x0, y0 in px',
                path=str(path),
                frame=result.image_frame,
            )
        )
    require_metres(result.length_unit, str(path))
    if not result.length_unit and not result.control:
        raise BadInputError(
            phrase(
                "poses_no_scale",
                '{path}: says no "length_unit", and nothing surveyed gives its scale; adjust a network with surveyed '
                'balls or distances, and with "length_unit": "m"',
                path=str(path),
            )
        )
    images = {name: validate(_Image, body, f"{path}: images.{name}") for name, body in result.images.items()}
    if not images:
        raise BadInputError(
            phrase("poses_none", "{path}: has no images, so no poses; name the result of svev orient", path=str(path))
        )
    _require_one_image_each(images, interior, path)
    sigmas: list[dict[str, float]] = []
    placed: dict[str, PlacedCamera] = {}
    for image in images.values():
        extras = validate(_CameraExtras, result.cameras[image.camera], f"{path}: cameras.{image.camera}")
        lens = interior[image.camera]
        values = np.array([getattr(lens, parameter) for parameter in INTERIOR], float)
        size = None if extras.size is None else (extras.size[0], extras.size[1])
        uncertain = [i for i, parameter in enumerate(INTERIOR) if extras.sigma.get(parameter, 0.0) > 0.0]
        named = dict(zip(POSE, (*image.sigma_X0, *image.sigma_angles), strict=True))
        named |= {INTERIOR[i]: extras.sigma[INTERIOR[i]] for i in uncertain}
        first = sum(len(others) for others in sigmas)
        sigmas.append(named)
        placed[image.camera] = PlacedCamera(
            Camera(image.camera, values, lens.r0, Distortion(lens.distortion), size),
            np.array(image.X0, float),
            nearest_rotation(np.array(image.R, float)),
            np.array(uncertain, np.intp),
            np.arange(first, first + len(named)),
        )
    covariance, notes = _covariance(result.calibration, images, sigmas, path)
    balls = _balls(result, images, path)
    return Calibration(
        str(path), CameraSystem(placed, covariance), balls, result.length_unit, tuple(notes), result.ball_radius_m
    )


def _require_one_image_each(images: Mapping[str, _Image], cameras: Mapping[str, Any], path: Path) -> None:
    named = [image.camera for image in images.values()]
    for name, image in images.items():
        if image.camera not in cameras:
            raise BadInputError(
                phrase(
                    "poses_unlisted",
                    '{path}: images.{image}: camera "{camera}" is not listed under "cameras"',
                    path=str(path),
                    image=name,
                    camera=image.camera,
                )
            )
        if named.count(image.camera) > 1:
            raise BadInputError(
                phrase(
                    "poses_images",
                    "{path}: camera {camera} has several images, so where it stands is open; name the result of svev "
                    "orient, with one image of each camera",
                    path=str(path),
                    camera=image.camera,
                )
            )


def _covariance(
    joint: _Joint | None, images: Mapping[str, _Image], sigmas: Sequence[Mapping[str, float]], path: Path
) -> tuple[Floats, list[Phrase]]:
    """The joint covariance of all cameras; from their sigmas alone where the file has no other."""
    wanted = [(image, name) for image, named in zip(images, sigmas, strict=True) for name in named]
    if joint is None:
        variance = [sigma**2 for named in sigmas for sigma in named.values()]
        text = (
            "{path} holds no joint covariance, so that the poses' correlations are missing in all sigmas; orient again"
        )
        return np.diag(variance), [phrase("poses_no_joint", text, path=str(path))]
    image_of = {image.camera: name for name, image in images.items()}
    there = {
        (p.image if p.image is not None else image_of.get(p.camera or "", ""), p.parameter): i
        for i, p in enumerate(joint.parameters)
    }
    n = len(joint.parameters)
    if any(len(row) != n for row in joint.covariance) or len(joint.covariance) != n:
        raise BadInputError(
            phrase(
                "poses_covariance",
                "{path}: calibration.covariance is not {n} x {n}, as its parameters are; orient again",
                path=str(path),
                n=n,
            )
        )
    whole = np.array(joint.covariance, float).reshape(n, n)
    if np.abs(whole - whole.T).max(initial=0.0) > _ASYMMETRY * np.abs(whole).max(initial=0.0):
        raise BadInputError(
            phrase("poses_asymmetric", "{path}: calibration.covariance is not symmetric; orient again", path=str(path))
        )
    rows: Integers = np.array([there.get(key, -1) for key in wanted], np.intp)
    block = np.where((rows >= 0)[:, None] & (rows >= 0), np.pad(whole, (0, 1))[np.ix_(rows, rows)], 0.0)
    return (block + block.T) / 2, []


def _balls(result: _Result, images: Mapping[str, _Image], path: Path) -> dict[str, KnownBall]:
    control = {entry.get("point") for entry in result.control if isinstance(entry, dict)}
    seen: dict[str, dict[str, Floats]] = {name: {} for name in result.points}
    for i, body in enumerate(result.observations):
        entry = validate(_Observation, body, f"{path}: observations.{i}")
        if entry.image in images and entry.point in seen and entry.sigma is not None:
            seen[entry.point][images[entry.image].camera] = np.array([entry.vx, entry.vy, *entry.sigma])
    balls = {}
    for name, body in result.points.items():
        point = validate(_Point, body, f"{path}: points.{name}")
        covariance = np.array(point.covariance, float)
        balls[name] = KnownBall(np.array(point.X, float), covariance, name in control, seen[name])
    return balls
