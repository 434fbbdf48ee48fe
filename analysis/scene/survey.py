"""Reads the survey of the balls: a `svev-network/1` file, JSON or TOML, without observations."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from photogrammetry.network.file import network_from_json
from photogrammetry.network.model import Camera, Image, ImageFrame, Network, Role
from photogrammetry.network.strict_text import read_object
from rig.arrays import Floats
from rig.errors import BadInputError

_SURVEYED = (Role.CONTROL, Role.FIXED)
_FEWEST = 4  # surveyed balls


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
        there = ", ".join(camera.name for camera in self.network.cameras) or "none"
        raise BadInputError(
            f"{self.source}: camera {name} of the log is missing (there: {there}); name the cameras as in the log"
        )

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
        BadInputError: no network file, observations in it, metric image frame, several images of a camera, or fewer
            than four surveyed balls.
    """
    data = read_object(path, "survey")
    if data.get("observations"):
        raise BadInputError(
            f'{path}: has "observations", so it is a measured network and no survey; remove them, or use svev orient'
        )
    data = data | {"cameras": _with_uncertain_estimated(data.get("cameras"))}
    network = network_from_json({"images": {}, "observations": [], **data}, str(path))
    if network.image_frame is not ImageFrame.PIXEL:
        raise BadInputError(f'{path}: "image_frame" is "metric"; a survey for a log needs c, x0, y0 in px: "pixel"')
    cameras = [image.camera for image in network.images]
    for camera in cameras:
        if cameras.count(camera) > 1:
            raise BadInputError(
                f"{path}: camera {network.cameras[camera].name} has several images; give one approximate pose at most"
            )
    count = sum(p.role in _SURVEYED for p in network.points)
    if count < _FEWEST:
        raise BadInputError(
            f"{path}: has {count} surveyed balls (control or fixed); a camera needs at least {_FEWEST} in sight"
        )
    return Survey(network, str(path))


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
