"""Reads interior orientations from the result file of a calibration; step 2 takes them as constants."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, Field

from photogrammetry.geometry.camera_model import INTERIOR, Distortion
from photogrammetry.network.entries import Finite, Pixels, Positive
from photogrammetry.network.model import Network
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


def with_calibration(network: Network, cameras: Mapping[str, CalibratedCamera]) -> Network:
    """The network with calibrated cameras, which are constant.

    Raises:
        BadInputError: a camera was not calibrated, or with images of another size.
    """
    for camera in network.cameras:
        if camera.name not in cameras:
            raise BadInputError(
                f"cameras.{camera.name}: the calibration lacks it (it has {', '.join(cameras) or 'none'}); "
                "calibrate it too or correct the name"
            )
        size = cameras[camera.name].size
        if size is not None and camera.size is not None and tuple(size) != camera.size:
            raise BadInputError(
                f"cameras.{camera.name}: was calibrated with images of {size[0]} x {size[1]} px, those of the network "
                f"have {camera.size[0]} x {camera.size[1]} px; calibrate it with images of this size"
            )
    calibrated = tuple(
        replace(
            camera,
            interior=np.array([getattr(cameras[camera.name], parameter) for parameter in INTERIOR], dtype=float),
            balance=cameras[camera.name].r0,
            distortion=Distortion(cameras[camera.name].distortion),
            estimate=(),
            sigma={},
        )
        for camera in network.cameras
    )
    return replace(network, cameras=calibrated)
