"""The TOML of calibrations and poses that anipose, caliscope, FreeMoCap and Pose2Sim read and write.

A table for each camera, at the top or under `cameras`: `name`, `size`, `matrix`, `distortions` (k1, k2, p1, p2, k3),
`rotation` (rotation vector, rad) and `translation` from the object to the camera system (y down, z forward).
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from photogrammetry.exchange.part import Part
from photogrammetry.exchange.vision.pinhole import Pinhole, camera_entry, pose_entry
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.entries import Finite, Triple
from photogrammetry.network.model import ImageFrame
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.strict_toml import read_toml, validate

#: Tables that are no cameras.
_OTHERS: Final = ("metadata", "capture_volume", "charuco", "checkerboard")
#: Keys of a camera that say nothing of how it projects, as caliscope and FreeMoCap write them.
_HARMLESS: Final = frozenset(
    {
        *("cam_id", "port", "rotation_count", "error", "exposure", "grid_count", "ignore", "verified_resolutions"),
        *("world_position", "world_orientation"),
    }
)
_WHAT: Final = "calibration of anipose"


class _Camera(BaseModel):
    """A camera's table. A key that nobody knows may say how it projects, and is refused."""

    model_config = ConfigDict(extra="forbid")

    name: str | None = None
    size: Annotated[list[Finite], Field(min_length=2, max_length=2)]
    matrix: Annotated[list[Triple], Field(min_length=3, max_length=3)]
    distortions: Annotated[list[Finite], Field(max_length=8)]
    rotation: Triple | None = None
    translation: Triple | None = None
    fisheye: bool = False


def read_camera_toml(path: Path) -> Part:
    """Read cameras and their poses; each image is called as its camera.

    Raises:
        BadInputError: unreadable, no camera in it, or one that cannot be carried over.
    """
    data = read_toml(path, kind=_WHAT)
    tables = data.get("cameras", data)
    tables = tables if isinstance(tables, dict) else {}
    found = {key: each for key, each in tables.items() if isinstance(each, dict) and key not in _OTHERS}
    if not found:
        raise BadInputError(f"{path}: no camera in it; name a calibration that anipose, caliscope or Pose2Sim wrote")
    cameras: dict[str, dict[str, Any]] = {}
    images: dict[str, dict[str, Any]] = {}
    notes: list[str] = []
    for key, table in found.items():
        known = {name: value for name, value in table.items() if name not in _HARMLESS}
        given = validate(_Camera, known, f"{path}: {key}")
        name = given.name or key
        if name in cameras:
            raise BadInputError(f"{path}: two cameras are called {name!r}; rename one")
        cameras[name], said = camera_entry(_pinhole(given, f"{path}: {key}"), f"{path}: {key}", "OpenCV")
        notes += [f"camera {name}: {note}" for note in said]
        if (given.rotation is None) is not (given.translation is None):
            raise BadInputError(f"{path}: {key}: a pose is rotation and translation; write both, or none of them")
        if given.rotation is not None and given.translation is not None:
            pose = pose_entry(rotation_from_vector(np.array(given.rotation)), np.array(given.translation))
            images[name] = {"camera": name, **pose}
    return Part(str(path), ImageFrame.PIXEL, cameras, images, notes=tuple(notes))


def camera_toml(cameras: Mapping[str, tuple[Pinhole, Floats, Floats]]) -> dict[str, str]:
    """The files of some cameras by their names: as anipose, FreeMoCap and Pose2Sim read them, and as caliscope does.

    Args:
        cameras: by name: the camera, its rotation vector (3,) and its translation (3,).
    """
    tables = [_table(name, *each) for name, each in cameras.items()]
    flat = [f"[cam_{i}]\n{table}" for i, table in enumerate(tables)]
    nested = [f"[cameras.{i}]\ncam_id = {i}\n{table}rotation_count = 0\n" for i, table in enumerate(tables)]
    return {
        "calibration.toml": "\n".join((*flat, "[metadata]\nadjusted = true\nerror = 0.0\n")),
        "camera_array.toml": "\n".join(nested),
    }


def _table(name: str, pinhole: Pinhole, rotation: Floats, translation: Floats) -> str:
    (fx, fy), (cx, cy) = pinhole.focal, pinhole.principal
    k1, k2, k3 = pinhole.radial[:3]
    return (
        f"name = {json.dumps(name, ensure_ascii=False)}\n"
        f"size = [{pinhole.size[0]}, {pinhole.size[1]}]\n"
        f"matrix = [{_row((fx, 0.0, cx))}, {_row((0.0, fy, cy))}, {_row((0.0, 0.0, 1.0))}]\n"
        f"distortions = {_row((k1, k2, *pinhole.tangential, k3))}\n"
        f"rotation = {_row(rotation)}\n"
        f"translation = {_row(translation)}\n"
        "fisheye = false\n"
    )


def _row(values: Iterable[float]) -> str:
    return "[" + ", ".join(repr(float(value)) for value in values) + "]"


def _pinhole(given: _Camera, place: str) -> Pinhole:
    if given.fisheye:
        raise BadInputError(f"{place}: a fisheye cannot be carried over; calibrate again (svev calibrate)")
    (fx, skew, cx), (zero, fy, cy), last = given.matrix
    if zero != 0.0 or list(last) != [0.0, 0.0, 1.0]:
        raise BadInputError(f"{place}: matrix is none of a camera: fx skew cx, 0 fy cy, 0 0 1")
    k1, k2, p1, p2, k3, k4, k5, k6 = (*given.distortions, *(0.0,) * (8 - len(given.distortions)))
    width, height = given.size
    if width % 1.0 or height % 1.0:
        raise BadInputError(f"{place}: an image size of {width:g} x {height:g} px is none; correct it")
    return Pinhole((int(width), int(height)), (fx, fy), (cx, cy), (k1, k2, k3, k4, k5, k6), (p1, p2), skew)
