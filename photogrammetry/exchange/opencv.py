"""Reads calibrations that OpenCV's FileStorage wrote, YAML or JSON: a camera, and its images of a board where they are.

The keys are those of OpenCV's own calibration programs (samples/cpp/calibration.cpp and the tutorial's) and of ROS.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from photogrammetry.exchange.part import Part, numbers
from photogrammetry.exchange.pinhole import Pinhole, camera_entry, pose_entry
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.model import ImageFrame
from photogrammetry.network.strict_text import read_json
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.strict_toml import read_text

_MATRIX: Final = ("camera_matrix", "cameraMatrix", "CameraMatrix", "K", "mtx", "intrinsic_matrix")
_DISTORTION: Final = (
    "distortion_coefficients",
    "distCoeffs",
    "DistortionCoefficients",
    "dist_coeffs",
    "dist_coeff",
    "D",
    "dist",
)
_WIDTH: Final = ("image_width", "image_Width", "ImageWidth", "width")
_HEIGHT: Final = ("image_height", "image_Height", "ImageHeight", "height")
_SIZE: Final = ("image_size", "imageSize", "ImageSize")
_ORDER: Final = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # of OpenCV's coefficients

_MATRIX_TEXT: Final = re.compile(
    r"^(?P<key>\w+):[ \t]*(?:!!opencv-(?:nd-)?matrix)?[ \t]*\n(?P<shape>(?:[ \t]+\w+:[^\n]*\n)*?)"
    r"[ \t]+data:[ \t]*\[(?P<data>[^\]]*)\]",
    re.MULTILINE,
)
_EXTENT_TEXT: Final = re.compile(r"(rows|cols):[ \t]*(\d+)")
_PLAIN_TEXT: Final = re.compile(r"^(?P<key>\w+):[ \t]*\[?(?P<data>[-+\d.eE, \t]+)\]?[ \t]*$", re.MULTILINE)


def read_opencv(path: Path, sigma: float) -> Part:
    """Read a calibration; the camera is called as the file.

    Args:
        path: of the file.
        sigma: of image points (px), which OpenCV does not write.

    Raises:
        BadInputError: no camera matrix or image size in it, or a lens model that cannot be carried over.
    """
    values = _from_json(path) if path.suffix.lower() == ".json" else _from_yaml(path)
    name = path.stem
    entry, rest = camera_entry(_pinhole(values, path), str(path))
    notes = [f"camera {name}: image points differ from OpenCV's by up to {rest:.2g} px"] if rest else []
    if _first(values, _DISTORTION) is None:
        notes.append(f"camera {name}: no distortion in {path.name}")
    images, points, observations = _board(values, name, path, sigma)
    if observations:
        notes.append(f"camera {name}: OpenCV writes no accuracy of image points: {sigma:g} px assumed (--sigma)")
        notes.append(f"camera {name}: the board's points are unknown (tie), not plane by definition; add a distance")
    return Part(str(path), ImageFrame.PIXEL, {name: entry}, images, points, observations, tuple(notes))


def _from_json(path: Path) -> dict[str, Floats]:
    values = {}
    for key, value in read_json(path, "OpenCV calibration").items():
        data = value.get("data") if isinstance(value, dict) else value
        flat = data if isinstance(data, list) else [data]
        if flat and all(isinstance(each, int | float) and not isinstance(each, bool) for each in flat):
            values[key] = _shaped(flat, value if isinstance(value, dict) else {})
    return values


def _from_yaml(path: Path) -> dict[str, Floats]:
    text = read_text(path, "YAML", "an existing OpenCV calibration")
    values = {}
    for match in _PLAIN_TEXT.finditer(text):
        values[match["key"]] = np.array(numbers(match["data"].replace(",", " ").split(), f"{path}: {match['key']}"))
    for match in _MATRIX_TEXT.finditer(text):
        data = numbers(match["data"].replace(",", " ").split(), f"{path}: {match['key']}")
        values[match["key"]] = _shaped(data, {key: int(n) for key, n in _EXTENT_TEXT.findall(match["shape"])})
    return values


def _shaped(data: list[Any], shape: Mapping[str, Any]) -> Floats:
    """Numbers as a matrix (rows, cols) or (rows, cols, channels), where the file says it and they are so many."""
    values = np.array(data, dtype=float)
    rows, cols = shape.get("rows"), shape.get("cols")
    if not (isinstance(rows, int) and isinstance(cols, int) and rows * cols > 0 and values.size % (rows * cols) == 0):
        return values
    channels = values.size // (rows * cols)
    return values.reshape((rows, cols) if channels == 1 else (rows, cols, channels))


def _first(values: Mapping[str, Floats], keys: tuple[str, ...]) -> Floats | None:
    return next((values[key] for key in keys if key in values), None)


def _pinhole(values: Mapping[str, Floats], path: Path) -> Pinhole:
    matrix, coefficients = _first(values, _MATRIX), _first(values, _DISTORTION)
    if matrix is None or matrix.size != 9:
        raise BadInputError(f'{path}: no 3 x 3 matrix "camera_matrix" in it; name a calibration of OpenCV')
    k = matrix.reshape(3, 3)
    flat = np.zeros(0) if coefficients is None else coefficients.ravel()
    if np.any(values.get("fisheye_model", np.zeros(1)) != 0.0):
        raise BadInputError(f"{path}: a fisheye model cannot be carried over; calibrate again (svev calibrate)")
    if flat.size > len(_ORDER) and np.any(flat[len(_ORDER) :] != 0.0):
        raise BadInputError(f"{path}: thin prism and tilted sensor cannot be carried over; calibrate without them")
    given = dict(zip(_ORDER, flat.tolist(), strict=False))
    k1, k2, p1, p2, k3, k4, k5, k6 = (given.get(name, 0.0) for name in _ORDER)
    return Pinhole(
        _size(values, path),
        (float(k[0, 0]), float(k[1, 1])),
        (float(k[0, 2]), float(k[1, 2])),
        (k1, k2, k3, k4, k5, k6),
        (p1, p2),
        float(k[0, 1]),
    )


def _size(values: Mapping[str, Floats], path: Path) -> tuple[int, int]:
    width, height, both = (_first(values, keys) for keys in (_WIDTH, _HEIGHT, _SIZE))
    if width is not None and height is not None and width.size == height.size == 1:
        return int(width.ravel()[0]), int(height.ravel()[0])
    if both is not None and both.size == 2:
        return int(both.ravel()[0]), int(both.ravel()[1])
    raise BadInputError(f'{path}: the image size is missing; add "image_width" and "image_height" to the file')


def _board(
    values: Mapping[str, Floats], camera: str, path: Path, sigma: float
) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]], list[list[Any]]]:
    """Images, points and observations of the board, if the file has its image points."""
    seen = values.get("image_points")
    if seen is None or seen.ndim != 3 or seen.shape[2] != 2:
        return {}, {}, []
    views, count = seen.shape[:2]
    poses, board = values.get("extrinsic_parameters"), values.get("grid_points")
    images: dict[str, dict[str, Any]] = {f"{camera}-{i + 1}": {"camera": camera} for i in range(views)}
    if poses is not None and poses.shape == (views, 6):
        for name, pose in zip(images, poses, strict=True):
            images[name] |= pose_entry(rotation_from_vector(pose[:3]), pose[3:])
    points: dict[str, dict[str, Any]] = {f"G{i + 1}": {"role": "tie"} for i in range(count)}
    if board is not None:
        if board.size != 3 * count:
            raise BadInputError(f"{path}: {board.size // 3} grid_points, but {count} image_points in each image")
        for name, xyz in zip(points, board.reshape(count, 3).tolist(), strict=True):
            points[name]["X"] = xyz
    rows = [
        [image, point, *xy, sigma]
        for image, view in zip(images, seen.tolist(), strict=True)
        for point, xy in zip(points, view, strict=True)
    ]
    return images, points, rows
