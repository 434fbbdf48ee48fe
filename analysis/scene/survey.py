"""Reads the survey of the balls: a `svev-network/1` file, JSON or TOML, without observations."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.scene.units import check_principal_distances, check_sigmas, require_metres
from photogrammetry.network.file import network_from_json
from photogrammetry.network.formats import NETWORK, require_format
from photogrammetry.network.model import Camera, Image, ImageFrame, Network, Role
from photogrammetry.network.strict_text import read_object
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase

_SURVEYED = (Role.CONTROL, Role.FIXED)
_BALLS_LEAST = 4  # surveyed balls
_TABLES: Final = (".csv", ".txt", ".obc")  # what a total station or another program writes


@dataclass(frozen=True, slots=True, eq=False)
class KnownPoints:
    """Points with known coordinates.

    Attributes:
        names: n names.
        xyz: (n, 3) coordinates.
        covariance: (n, 3, 3).
    """

    names: tuple[str, ...]
    xyz: Floats
    covariance: Floats

    def joined(self, other: "KnownPoints") -> "KnownPoints":
        """These points and others."""
        return KnownPoints(
            self.names + other.names,
            np.concatenate((self.xyz, other.xyz)),
            np.concatenate((self.covariance, other.covariance)),
        )

    def mirrored(self) -> "KnownPoints":
        """The points with Y to the other side; coordinates do not covary."""
        return KnownPoints(self.names, self.xyz * (1.0, -1.0, 1.0), self.covariance)


@dataclass(frozen=True, slots=True, eq=False)
class Survey:
    """Balls and cameras as somebody surveyed and calibrated them.

    Attributes:
        network: cameras and points; per camera at most one image, with its approximate pose if one is known.
        source: the file, for messages.
    """

    network: Network
    source: str

    def camera(self, name: str) -> Camera:
        """Interior orientation of a camera.

        Raises:
            BadInputError: the survey has no such camera.
        """
        for camera in self.network.cameras:
            if camera.name == name:
                return camera
        raise BadInputError(self.lacks(name))

    def has(self, camera: str) -> bool:
        """Whether it has a camera's interior orientation."""
        return any(there.name == camera for there in self.network.cameras)

    def lacks(self, camera: str) -> Phrase:
        """Says that it has not a camera."""
        there = ", ".join(camera.name for camera in self.network.cameras) or "none"
        return phrase(
            "survey_no_camera",
            "{source}: camera {camera} of the log is missing (there: {there}); name the cameras as in the log",
            source=self.source,
            camera=camera,
            there=there,
        )

    def lacks_all(self, cameras: tuple[str, ...]) -> Phrase:
        """Says that it has none of the cameras of a log."""
        return phrase(
            "survey_other_cameras",
            "{source}: has none of the log's cameras {cameras} (there: {there}); name the survey of this hill, or call "
            "its cameras as in the log",
            source=self.source,
            cameras=", ".join(cameras),
            there=", ".join(camera.name for camera in self.network.cameras),
        )

    def cameras_of(self, sizes: Mapping[str, tuple[int, int]]) -> tuple[dict[str, Camera], dict[str, Phrase]]:
        """The cameras of a log, and for those that it has not why there is none.

        Args:
            sizes: width and height of the images by camera.

        Raises:
            BadInputError: a camera is calibrated for images of another size.
        """
        cameras: dict[str, Camera] = {}
        for name, here in sizes.items():
            if not self.has(name):
                continue
            camera = cameras[name] = self.camera(name)
            if camera.size != here:
                size = "?" if camera.size is None else f"{camera.size[0]} x {camera.size[1]}"
                raise BadInputError(
                    phrase(
                        "survey_size",
                        "{source}: camera {camera} is calibrated for images of {size} px, those of the log have "
                        "{here} px; give the interior orientation of this image size",
                        source=self.source,
                        camera=name,
                        size=size,
                        here=f"{here[0]} x {here[1]}",
                    )
                )
        return cameras, {name: self.lacks(name) for name in sizes if name not in cameras}

    def image(self, camera: str) -> Image | None:
        """The image of a camera that carries its approximate pose; None if there is none."""
        names = [c.name for c in self.network.cameras]
        return next((image for image in self.network.images if names[image.camera] == camera), None)

    def surveyed(self) -> KnownPoints:
        """The balls with coordinates that the object system rests on (control and fixed ones)."""
        points = [p for p in self.network.points if p.role in _SURVEYED]
        sigmas = [np.zeros(3) if p.sigma is None else p.sigma for p in points]
        return KnownPoints(
            tuple(p.name for p in points),
            np.array([p.xyz for p in points], float).reshape(-1, 3),
            np.array([np.diag(sigma**2) for sigma in sigmas], float).reshape(-1, 3, 3),
        )


def read_survey(path: Path) -> Survey:
    """Read a survey; interior parameters with a sigma are uncertain, and their uncertainty counts.

    Raises:
        BadInputError: no network file but a table, observations in it, metric image frame, no camera, several images of
            one, or fewer than four surveyed balls, or lengths that are not in metres, or c not in px.
    """
    try:
        data = read_object(path, "survey")
    except BadInputError as error:
        if path.suffix.lower() not in _TABLES or not isinstance(error.__context__, json.JSONDecodeError):
            raise
        raise BadInputError(
            phrase(
                "survey_table",
                "{path}: is a table of points, and a survey holds the cameras too; make one of both: svev network "
                "import calibration.json {path} -o survey.json",
                path=str(path),
            )
        ) from None
    require_format(data, NETWORK, path)
    if data.get("observations"):
        raise BadInputError(
            phrase(
                "survey_observations",
                '{path}: has "observations", so it is a measured network and no survey; remove them, or use svev '
                "orient",
                path=str(path),
            )
        )
    data = data | {"cameras": _with_uncertain_estimated(data.get("cameras"))}
    network = network_from_json({"images": {}, "observations": [], **data}, str(path))
    if network.image_frame is not ImageFrame.PIXEL:
        raise BadInputError(
            phrase(
                "survey_metric",
                '{path}: "image_frame" is "metric"; a survey for a log needs c, x0, y0 in px: "pixel"',
                path=str(path),
            )
        )
    require_metres(network.length_unit, str(path))
    cameras = [image.camera for image in network.images]
    for camera in cameras:
        if cameras.count(camera) > 1:
            raise BadInputError(
                phrase(
                    "survey_images",
                    "{path}: camera {camera} has several images; give one approximate pose at most",
                    path=str(path),
                    camera=network.cameras[camera].name,
                )
            )
    if not network.cameras:
        raise BadInputError(
            phrase(
                "survey_no_cameras",
                "{path}: holds no camera; make a survey of calibration and balls: svev network import calibration.json "
                "balls.csv -o survey.json",
                path=str(path),
            )
        )
    count = sum(p.role in _SURVEYED for p in network.points)
    if count < _BALLS_LEAST:
        raise BadInputError(
            phrase(
                "survey_few_balls",
                "{path}: has {count} surveyed balls (control or fixed); a camera needs at least {fewest} in sight",
                path=str(path),
                count=count,
                fewest=_BALLS_LEAST,
            )
        )
    check_principal_distances(network.cameras, str(path))
    check_sigmas(network.points, str(path))
    survey = Survey(network, str(path))
    _check_apart(survey.surveyed(), survey.source)
    return survey


def _check_apart(known: KnownPoints, source: str) -> None:
    """Refuse two balls at one place: one of them has the coordinates of the other."""
    for i, j in combinations(range(len(known.names)), 2):
        if not (known.xyz[i] - known.xyz[j]).any():
            raise BadInputError(
                phrase(
                    "survey_same_place",
                    "{source}: balls {one} and {other} have the same coordinates; correct one of them",
                    source=source,
                    one=known.names[i],
                    other=known.names[j],
                )
            )


def _with_uncertain_estimated(cameras: Any) -> Any:
    """Cameras of a file in which each parameter with a sigma is an unknown, whether or not "estimate" names it."""
    if not isinstance(cameras, dict):
        return cameras
    return {
        name: body | {"estimate": [*given, *(key for key in body.get("sigma", {}) if key not in given)]}
        if isinstance(body, dict)
        and isinstance(given := body.get("estimate", []), list)
        and isinstance(body.get("sigma", {}), dict)
        else body
        for name, body in cameras.items()
    }
