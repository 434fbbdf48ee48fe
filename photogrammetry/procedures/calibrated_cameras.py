"""Reads interior orientations from the result file of a calibration; step 2 takes them as constants."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field

from photogrammetry.geometry.camera_model import INTERIOR, Distortion
from photogrammetry.network.entries import Finite, Pixels, Positive
from photogrammetry.network.model import Camera, Network, Role
from photogrammetry.network.selection import only_points, rays, sub_network
from photogrammetry.network.strict_text import read_json
from rig.errors import BadInputError
from rig.settings.strict_toml import validate


class CalibratedCamera(BaseModel):
    """One of `cameras` of a result; its sigmas and correlations are ignored."""

    c: Positive
    x0: Finite
    y0: Finite
    a1: Finite
    a2: Finite
    a3: Finite
    b1: Finite
    b2: Finite
    c1: Finite
    c2: Finite
    r0: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0)]
    distortion: Literal["projected", "measured"]
    size: Annotated[list[Pixels], Field(min_length=2, max_length=2)] | None = None


class _GlobalTest(BaseModel):
    """What the global test says; results of other programs have none."""

    usable: bool = True
    words: str = ""


class _Result(BaseModel):
    """The keys of a result that a calibration must have; all others are ignored."""

    format: Literal["svev-adjustment/1"]
    converged: bool
    cameras: dict[str, Any] = {}
    global_test: _GlobalTest = _GlobalTest()


def read_calibration(path: Path) -> dict[str, CalibratedCamera]:
    """Read the cameras of a result file (`svev-adjustment/1`).

    Raises:
        BadInputError: missing, unreadable, no result file, or one of a calibration that did not converge or whose
            observations contradict each other.
    """
    result = validate(_Result, read_json(path), path)
    if not result.converged:
        raise BadInputError(f"{path}: this calibration has no result; calibrate again or name another file")
    if not result.global_test.usable:
        raise BadInputError(f"{path}: sigma0 of this result is {result.global_test.words}")
    return {name: _camera(body, f"{path}: cameras.{name}") for name, body in result.cameras.items()}


def _camera(body: Any, source: str) -> CalibratedCamera:
    if not isinstance(body, dict):
        raise BadInputError(f"{source}: is no object; name the result file of a calibration")
    return validate(CalibratedCamera, body, source)


def with_calibration(network: Network, cameras: Mapping[str, CalibratedCamera]) -> tuple[Network, list[str]]:
    """The network with calibrated cameras, which are constant.

    Returns:
        The network without the images of cameras that the calibration lacks, and a line for each of these cameras.

    Raises:
        BadInputError: no camera was calibrated, or one with images of another size.
    """
    lacking = [camera.name for camera in network.cameras if camera.name not in cameras]
    there = ", ".join(cameras) or "none"
    if len(lacking) == len(network.cameras):
        raise BadInputError(
            f"cameras.{lacking[0]}: the calibration lacks it (it has {there}); calibrate it too or correct the name"
        )
    notes = [
        f"camera {name} is left out: the calibration lacks it (it has {there}); calibrate it too or correct the name"
        for name in lacking
    ]
    network = _without_cameras(network, lacking) if lacking else network
    return replace(
        network, cameras=tuple(_calibrated(camera, cameras[camera.name]) for camera in network.cameras)
    ), notes


def _without_cameras(network: Network, names: Collection[str]) -> Network:
    """The network without some cameras, their images, and the tie points that only these show."""
    keep = np.array([network.cameras[image.camera].name not in names for image in network.images], dtype=bool)
    less = sub_network(network, keep, np.ones(len(network.points), dtype=bool))
    cameras = tuple(camera for camera in network.cameras if camera.name not in names)
    place = {camera.name: i for i, camera in enumerate(cameras)}
    images = tuple(replace(image, camera=place[network.cameras[image.camera].name]) for image in less.images)
    less = replace(less, cameras=cameras, images=images)
    known = np.array([point.role is not Role.TIE for point in less.points], dtype=bool)
    return only_points(less, known | (rays(less) > 0))


def _calibrated(camera: Camera, known: CalibratedCamera) -> Camera:
    """The camera with its calibration.

    Raises:
        BadInputError: it was calibrated with images of another size.
    """
    if known.size is not None and camera.size is not None and tuple(known.size) != camera.size:
        raise BadInputError(
            f"cameras.{camera.name}: was calibrated with images of {known.size[0]} x {known.size[1]} px, those of the "
            f"network have {camera.size[0]} x {camera.size[1]} px; calibrate it with images of this size"
        )
    return replace(
        camera,
        interior=np.array([getattr(known, parameter) for parameter in INTERIOR], dtype=float),
        balance=known.r0,
        distortion=Distortion(known.distortion),
        estimate=(),
        sigma={},
    )
