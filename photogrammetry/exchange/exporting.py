"""Cameras, poses and points of a network as the files of other programs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

import numpy as np

from photogrammetry.exchange.vision.camera_toml import camera_toml
from photogrammetry.exchange.vision.pinhole import Pinhole
from photogrammetry.exchange.vision.pinhole_of import pinhole_of, pose_of
from photogrammetry.network.file_writer import metric_to_pixel
from photogrammetry.network.model import Image, ImageFrame, Network
from rig.arrays import Floats
from rig.errors import BadInputError

_CORNER: Final = 0.5  # px, from COLMAP's origin to the centre of the first pixel
_TOLD_PX: Final = 1e-9  # a larger difference is said


class Form(StrEnum):
    """Whose files are written."""

    OPENCV = "opencv"
    COLMAP = "colmap"
    TOML = "toml"


@dataclass(frozen=True, slots=True)
class Exported:
    """Files by their names, and what could not be carried over."""

    files: Mapping[str, str]
    notes: tuple[str, ...]


def exported(network: Network, form: Form) -> Exported:
    """What the files of another program hold.

    Raises:
        BadInputError: image coordinates in mm, a camera that no parameters of OpenCV come near, no pose, or, in TOML,
            several poses of one camera.
    """
    if network.image_frame is not ImageFrame.PIXEL:
        raise BadInputError("other programs count in pixels, and this network in another unit: give its size in pixels")
    cameras, notes = {}, []
    for camera in network.cameras:
        cameras[camera.name], apart = pinhole_of(camera)
        if apart > _TOLD_PX:
            notes.append(f"camera {camera.name}: image points differ from svev's by up to {apart:.2g} px")
    files, said = _WRITERS[form](network, cameras)
    return Exported(files, (*notes, *said))


def _opencv(network: Network, cameras: Mapping[str, Pinhole]) -> tuple[dict[str, str], list[str]]:
    """A file of OpenCV's FileStorage for each camera, with its pose if it has one."""
    files, notes = {}, []
    for name, pinhole in cameras.items():
        (fx, fy), (cx, cy) = pinhole.focal, pinhole.principal
        (width, height), (k1, k2, k3) = pinhole.size, pinhole.radial[:3]
        text = f"%YAML:1.0\n---\nimage_width: {width}\nimage_height: {height}\n"
        text += _matrix("camera_matrix", 3, 3, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
        text += _matrix("distortion_coefficients", 5, 1, [k1, k2, *pinhole.tangential, k3])
        images = _oriented(network, name)
        if len(images) == 1:
            turn, shift = pose_of(images[0])
            text += _matrix("rvec", 3, 1, turn.tolist()) + _matrix("tvec", 3, 1, shift.tolist())
        elif images:
            notes.append(f"camera {name}: has {len(images)} poses, which are left out; --to colmap takes them")
        files[f"{name}.yml"] = text
    return files, notes


def _matrix(key: str, rows: int, columns: int, values: list[float]) -> str:
    data = ", ".join(f"{value:.17e}" for value in values)
    return f"{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n"


def _toml(network: Network, cameras: Mapping[str, Pinhole]) -> tuple[dict[str, str], list[str]]:
    poses: dict[str, tuple[Pinhole, Floats, Floats]] = {}
    for name, pinhole in cameras.items():
        images = _oriented(network, name)
        if len(images) != 1:
            raise BadInputError(
                f"camera {name}: has {len(images)} poses, and this file holds one of each camera; "
                "export the result of svev orient, or --to colmap"
            )
        poses[name] = (pinhole, *pose_of(images[0]))
    return camera_toml(poses), []


def _colmap(network: Network, cameras: Mapping[str, Pinhole]) -> tuple[dict[str, str], list[str]]:
    """COLMAP's text model; cameras and points are numbered in their order, images keep their names."""
    posed = [i for i, image in enumerate(network.images) if image.position is not None]
    number = {name: i for i, name in enumerate(cameras, start=1)}
    placed = {i: point.xyz.tolist() for i, point in enumerate(network.points) if point.xyz is not None}
    tracks: dict[int, list[str]] = {i: [] for i in placed}
    lines, seen = [], network.observations
    for i in posed:
        image = network.images[i]
        turn, shift = pose_of(image)
        name = network.cameras[image.camera].name
        rows = np.flatnonzero((seen.image == i) & np.isin(seen.point, list(placed)))
        pixels = metric_to_pixel(seen.xy[rows], np.array(cameras[name].size)) + _CORNER
        pose = " ".join(map(repr, (*_quaternion(turn), *shift.tolist())))
        lines.append(f"{i + 1} {pose} {number[name]} {image.name}")
        points = seen.point[rows].tolist()
        lines.append(" ".join(f"{x!r} {y!r} {p + 1}" for (x, y), p in zip(pixels.tolist(), points, strict=True)))
        for place, point in enumerate(points):
            tracks[point].append(f"{i + 1} {place}")
    files = {
        "cameras.txt": "".join(f"{number[name]} {_model(each)}\n" for name, each in cameras.items()),
        "images.txt": "".join(f"{line}\n" for line in lines),
        "points3D.txt": "".join(
            " ".join((str(i + 1), *map(repr, xyz), "128 128 128 0", *tracks[i])) + "\n" for i, xyz in placed.items()
        ),
    }
    notes = ["cameras and points are numbered in their order: COLMAP has no names for them"]
    if left := len(network.images) - len(posed):
        notes.append(f"{left} images without a pose are left out")
    return files, notes


def _model(pinhole: Pinhole) -> str:
    (width, height), (k1, k2, k3) = pinhole.size, pinhole.radial[:3]
    values = [*pinhole.focal, *(each + _CORNER for each in pinhole.principal), k1, k2, *pinhole.tangential]
    if k3:
        values += [k3, 0.0, 0.0, 0.0]
    return " ".join(("FULL_OPENCV" if k3 else "OPENCV", str(width), str(height), *map(repr, values)))


def _quaternion(turn: Floats) -> list[float]:
    """w, x, y, z of a rotation vector (3,)."""
    half = float(np.linalg.norm(turn)) / 2.0
    return [float(np.cos(half)), *(np.sinc(half / np.pi) / 2.0 * turn).tolist()]


def _oriented(network: Network, camera: str) -> list[Image]:
    return [
        image for image in network.images if network.cameras[image.camera].name == camera and image.position is not None
    ]


_WRITERS: Final[Mapping[Form, Callable[..., tuple[dict[str, str], list[str]]]]] = {
    Form.OPENCV: _opencv,
    Form.COLMAP: _colmap,
    Form.TOML: _toml,
}
