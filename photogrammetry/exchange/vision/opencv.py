"""Reads calibrations as OpenCV's FileStorage, ROS and scripts write them: a camera, and its images of a board.

The keys are those of OpenCV's own calibration programs (samples/cpp/calibration.cpp and the tutorial's) and of ROS, in
YAML, JSON or XML. A key that is not known here may change what the others mean (another lens model, say): it is
refused.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from photogrammetry.exchange.part import Part
from photogrammetry.exchange.vision.pinhole import Pinhole, camera_entry, pose_entry
from photogrammetry.exchange.vision.values import read_values
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.entries import LARGEST
from photogrammetry.network.model import ImageFrame
from rig.arrays import Floats
from rig.errors import BadInputError

#: Keys, all small and without underscores.
_MATRIX: Final = ("cameramatrix", "k", "mtx", "intrinsicmatrix")
_DISTORTION: Final = ("distortioncoefficients", "distcoeffs", "distcoeff", "distortion", "d", "dist")
_WIDTH: Final = ("imagewidth", "width")
_HEIGHT: Final = ("imageheight", "height")
_SIZE: Final = ("imagesize", "size", "resolution")
_POSE: Final = ("rvec", "tvec")  # of the only image of the camera
_BOARD: Final = ("imagepoints", "gridpoints", "extrinsicparameters")
#: Keys that name the lens model, and the models that are OpenCV's radial and decentring distortion.
_MODEL: Final = ("distortionmodel", "cameramodel", "lensmodel", "model", "fisheyemodel", "fisheye")
_MODELS: Final = ("plumbbob", "rationalpolynomial", "radtan", "brownconrady", "opencv", "pinhole", "perspective")
#: Keys of parts of the picture: only 0 and 1 (the whole of it) are understood.
_PARTS: Final = ("binningx", "binningy", "roi")
#: Keys that say nothing of how the camera projects.
# fmt: off
_HARMLESS: Final = frozenset((
    "calibrationtime", "nframes", "nrofframes", "framescount", "boardwidth", "boardheight", "squaresize",
    "aspectratio", "flags", "flagvalue", "avgreprojectionerror", "perviewreprojectionerrors", "reprojectionerror",
    "rms", "error", "rectificationmatrix", "projectionmatrix", "r", "p", "cameraname", "name", "cameraid", "id",
    "serial", "serialnumber", "header", "date", "time", "comment", "comments", "note", "notes", "version",
))
# fmt: on
_ORDER: Final = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")  # of OpenCV's coefficients
_SHAPE: Final = frozenset({"rows", "cols", "dt", "typeid", "sizes", "data"})


def read_opencv(path: Path, sigma: float) -> Part:
    """Read a calibration; the camera is called as the file.

    Args:
        path: of the file.
        sigma: of image points (px), which OpenCV does not write.

    Raises:
        BadInputError: no camera matrix or image size in it, a key that is not understood, or a lens model that cannot
            be carried over.
    """
    values = _Values(path, read_values(path, "OpenCV calibration"))
    name = path.stem
    pinhole = _pinhole(values)
    _require_understood(values)
    entry, said = camera_entry(pinhole, str(path), "OpenCV")
    notes = [f"camera {name}: {note}" for note in said]
    if values.first(_DISTORTION) is None:
        notes.append(f"camera {name}: no distortion in {path.name}")
    images, points, observations = _board(values, name, sigma)
    images |= _single(values, name)
    if observations:
        notes.append(f"camera {name}: OpenCV writes no accuracy of image points: {sigma:g} px assumed (--sigma)")
        notes.append(f"camera {name}: the board's points are unknown (tie), not plane by definition; add a distance")
    return Part(str(path), ImageFrame.PIXEL, {name: entry}, images, points, observations, tuple(notes))


def _small(key: str) -> str:
    return key.lower().replace("_", "").replace("-", "")


class _Values:
    """What a file holds, by small keys.

    Raises:
        BadInputError: two keys are the same.
    """

    def __init__(self, path: Path, table: Mapping[str, Any]) -> None:
        self.path = path
        self.written: dict[str, str] = {}  # the keys as they stand in the file, by small ones
        self._values: dict[str, Any] = {}
        for key, value in table.items():
            small = _small(key)
            if small in self._values:
                raise BadInputError(f'{path}: key "{key}" stands twice, written differently; remove one')
            self._values[small], self.written[small] = value, key

    def get(self, key: str, otherwise: Any) -> Any:
        """What stands there, whatever it is."""
        return self._values.get(key, otherwise)

    def numbers(self, key: str) -> Floats | None:
        """Numbers as an array, None if the key is not there.

        Raises:
            BadInputError: something else stands there.
        """
        return _numbers(self._values[key], self.written[key], self.path) if key in self._values else None

    def first(self, keys: tuple[str, ...]) -> Floats | None:
        """The numbers of the only one of some keys that is there.

        Raises:
            BadInputError: several of them are there.
        """
        there = [key for key in keys if key in self._values]
        if len(there) > 1:
            one, other = (self.written[key] for key in there[:2])
            raise BadInputError(f'{self.path}: keys "{one}" and "{other}" say the same; remove one')
        return self.numbers(there[0]) if there else None


def _require_understood(values: _Values) -> None:
    """Refuse lens models and keys that are not OpenCV's.

    Raises:
        BadInputError: names the key.
    """
    for key in _MODEL:
        value = values.get(key, False)
        if value and not (isinstance(value, str) and _small(value).replace(" ", "") in _MODELS):
            raise BadInputError(
                f'{values.path}: key "{values.written[key]}" = {value!r}: a fisheye or other lens model cannot be '
                "carried over; calibrate again (svev calibrate)"
            )
    for key in _PARTS:
        parts = values.get(key, 0)
        if any(each not in (0, 1) for each in (parts.values() if isinstance(parts, dict) else [parts])):
            raise BadInputError(
                f'{values.path}: key "{values.written[key]}": a part of the picture cannot be carried over; remove it'
            )
    known = {*_MATRIX, *_DISTORTION, *_WIDTH, *_HEIGHT, *_SIZE, *_POSE, *_BOARD, *_MODEL, *_PARTS, *_HARMLESS}
    for small, key in values.written.items():
        if small not in known:
            raise BadInputError(
                f'{values.path}: key "{key}" is not understood; remove it if it does not change how the camera projects'
            )


def _numbers(value: Any, key: str, path: Path) -> Floats:
    """Numbers as an array; (rows, cols) or (rows, cols, channels) where the file says it.

    Raises:
        BadInputError: something else than numbers, or as many as do not fit.
    """
    shape = {_small(name): each for name, each in value.items()} if isinstance(value, dict) else {"data": value}
    if set(shape) <= set(_ORDER):
        shape = {"data": [shape.get(name, 0.0) for name in _ORDER]}
    refused = BadInputError(f'{path}: key "{key}" is not understood; write its numbers in one list, as OpenCV does')
    flat = _flat(shape.get("data"))
    if not set(shape) <= _SHAPE or flat is None:
        raise refused
    try:
        values = np.array(shape["data"], dtype=float)
    except ValueError:  # rows of different lengths
        raise refused from None
    if not np.isfinite(values).all() or np.abs(values).max(initial=0.0) > LARGEST:
        raise BadInputError(f'{path}: key "{key}" holds a number that no camera has, or none; correct it there')
    rows, cols = shape.get("rows"), shape.get("cols")
    if rows is None or cols is None:
        return values
    if rows not in range(1, values.size + 1) or cols not in range(1, values.size + 1) or values.size % (rows * cols):
        raise refused
    shaped = values.reshape((int(rows), int(cols), -1))
    return shaped[:, :, 0] if shaped.shape[2] == 1 else shaped


def _flat(data: Any) -> list[Any] | None:
    """All numbers of nested lists; None where something else is among them."""
    found: list[Any] = []
    left = [data]
    while left:
        each = left.pop()
        if isinstance(each, list):
            left += each
        elif isinstance(each, int | float) and not isinstance(each, bool):
            found.append(each)
        else:
            return None
    return found


def _pinhole(values: _Values) -> Pinhole:
    path, matrix, coefficients = values.path, values.first(_MATRIX), values.first(_DISTORTION)
    if matrix is None or matrix.size != 9:
        raise BadInputError(f'{path}: no 3 x 3 matrix "camera_matrix" in it; name a calibration of OpenCV')
    k = matrix.reshape(3, 3)
    if k[1, 0] != 0.0 or k[2].tolist() != [0.0, 0.0, 1.0]:
        raise BadInputError(
            f"{path}: the camera matrix is none, or transposed: write it row by row, fx skew cx, 0 fy cy, 0 0 1"
        )
    flat = np.zeros(0) if coefficients is None else coefficients.ravel()
    if flat.size > len(_ORDER) and np.any(flat[len(_ORDER) :] != 0.0):
        raise BadInputError(f"{path}: thin prism and tilted sensor cannot be carried over; calibrate without them")
    given = dict(zip(_ORDER, flat.tolist(), strict=False))
    k1, k2, p1, p2, k3, k4, k5, k6 = (given.get(name, 0.0) for name in _ORDER)
    return Pinhole(
        _size(values),
        (float(k[0, 0]), float(k[1, 1])),
        (float(k[0, 2]), float(k[1, 2])),
        (k1, k2, k3, k4, k5, k6),
        (p1, p2),
        float(k[0, 1]),
    )


def _size(values: _Values) -> tuple[int, int]:
    path = values.path
    width, height, both = (values.first(keys) for keys in (_WIDTH, _HEIGHT, _SIZE))
    if width is not None and height is not None and width.size == height.size == 1:
        size = np.array([width.item(), height.item()])
        if both is not None and both.ravel().tolist() != size.tolist():
            raise BadInputError(f"{path}: says two image sizes; remove one")
    elif both is not None and both.size == 2:
        size = both.ravel()
    else:
        raise BadInputError(f'{path}: the image size is missing; add "image_width" and "image_height" to the file')
    if np.any(size != np.round(size)):
        raise BadInputError(f"{path}: an image size of {size[0]:g} x {size[1]:g} px is none; correct it")
    return int(size[0]), int(size[1])


def _single(values: _Values, camera: str) -> dict[str, dict[str, Any]]:
    """The image whose pose stands beside the camera, called as the camera; none without a pose."""
    turn, shift = (values.numbers(key) for key in _POSE)
    if turn is None and shift is None:
        return {}
    if turn is None or shift is None or turn.size != 3 or shift.size != 3:
        raise BadInputError(f'{values.path}: a pose is "rvec" and "tvec", three numbers each; correct them there')
    pose = pose_entry(rotation_from_vector(turn.ravel()), shift.ravel())
    return {camera: {"camera": camera, **pose}}


def _board(
    values: _Values, camera: str, sigma: float
) -> tuple[dict[str, dict[str, Any]], dict[str, dict[str, Any]], list[list[Any]]]:
    """Images, points and observations of the board, if the file has its image points."""
    path = values.path
    seen, board, poses = (values.numbers(key) for key in _BOARD)
    if seen is None:
        return {}, {}, []
    if seen.ndim != 3 or seen.shape[2] != 2:
        raise BadInputError(f'{path}: key "image_points" is not understood; it holds u, v of each point in each image')
    views, count = seen.shape[:2]
    images: dict[str, dict[str, Any]] = {f"{camera}-{i + 1}": {"camera": camera} for i in range(views)}
    if poses is not None:
        if poses.shape != (views, 6):
            raise BadInputError(
                f"{path}: extrinsic_parameters are not 6 for each of {views} images; correct them there"
            )
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
