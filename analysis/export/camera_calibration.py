"""Interior orientations for logs: a result file of `svev calibrate` or `svev orient` as `foxglove.CameraCalibration`.

Foxglove, ROS and OpenCV share one camera model, "plumb_bob": with u = X / Z, v = Y / Z (X right, Y down, Z forward) and
s = u^2 + v^2,

    column = cx + fx (u (1 + k1 s + k2 s^2 + k3 s^3) + 2 p1 u v + p2 (s + 2 u^2)),
    row    = cy + fy (v (1 + k1 s + k2 s^2 + k3 s^3) + 2 p2 u v + p1 (s + 2 v^2)).

Ours (contract `svev-network/1`, `photogrammetry.geometry.camera_model`) has y up: xs = c u, ys = -c v. If its
distortion acts on the projected side and has neither affinity nor shear, both are the same function. With the constant
part m = 1 - a1 r0^2 - a2 r0^4 - a3 r0^6 of the balanced radial distortion:

    fx = fy = c m,   cx = (width - 1) / 2 + x0,   cy = (height - 1) / 2 - y0,
    k1 = a1 c^2 / m,   k2 = a2 c^4 / m,   k3 = a3 c^6 / m,   p1 = -b2 c / m,   p2 = b1 c / m.

Otherwise the nine parameters are fitted to our model over a grid of the image (least squares, px). Shear has no
counterpart in "plumb_bob": c2 times half the image's height remains at the upper and lower edge.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from numpy.typing import NDArray
from scipy.optimize import least_squares

from photogrammetry.geometry.camera_model import INTERIOR, Lens, undistort
from photogrammetry.network.calibration_file import CalibratedCamera, read_calibration
from rig.errors import BadInputError
from rig.host.files import TEXT_MAX, read_whole
from rig.settings.camera import CameraSettings
from rig.transport.recorder_commands import Calibration

Floats = NDArray[np.float64]

#: In mm, c is some hundredths of the image width in px; in px, 0.25 of it is an angle of view of 127 degrees.
_LEAST_C_BY_WIDTH: Final = 0.25
_GRID: Final = 25


def calibration_for_log(path: Path, cameras: Sequence[CameraSettings]) -> Calibration:
    """Read what logs say of the interior orientations of a rig's cameras.

    Args:
        path: a result file (`svev-adjustment/1`) of a network in pixels.
        cameras: the rig's cameras; the file may have others beside them. Those that were calibrated with another
            region than they have now are left out.

    Raises:
        BadInputError: the file is missing, unreadable or without a result, lacks one of the cameras, or does not fit
            the camera's images.
    """
    if not path.exists():
        raise BadInputError(f'{path}: no such file; correct "calibration" in the rig file, or remove it there')
    calibrated = read_calibration(path)
    encoded = {}
    for camera in cameras:
        if camera.calibrated_region is not None:
            continue  # calibrated with another region, of which this is not true any more
        if camera.name not in calibrated:
            raise BadInputError(
                f"{path}: lacks camera {camera.name} of the rig (it has {', '.join(calibrated) or 'none'}); calibrate "
                'it too, give it the same name in both files, or remove "calibration" from the rig file'
            )
        size = camera.region.width, camera.region.height
        try:
            parameters = plumb_bob(calibrated[camera.name], size)
        except ValueError as error:
            raise BadInputError(f"{path}: cameras.{camera.name}: {error}") from None
        encoded[camera.name] = _encoded(camera.name, parameters, size, path.stat().st_mtime_ns)
    return Calibration(json=read_whole(path, TEXT_MAX, links=True), cameras=encoded)


def plumb_bob(camera: CalibratedCamera, size: tuple[int, int]) -> Floats:
    """The camera in the model of OpenCV.

    Args:
        camera: our interior orientation, px.
        size: width and height of the image, px.

    Returns:
        (9,): fx, fy, cx, cy (px), k1, k2, p1, p2, k3.

    Raises:
        ValueError: these are no numbers of a camera with such images; the message says why and what to do.
    """
    width, height = size
    if camera.c < _LEAST_C_BY_WIDTH * width:
        raise ValueError(
            f"c = {camera.c:g} cannot be in pixels where images are {width} px wide; name the result of a network in "
            'pixels ("image_frame": "pixel")'
        )
    corner = np.array([width - 1, height - 1]) / 2.0
    columns, rows = (axis.ravel() for axis in np.meshgrid(*(np.linspace(0.0, n - 1.0, _GRID) for n in size)))
    ideal = undistort(_lens(camera), np.stack([columns - corner[0], corner[1] - rows], axis=-1))
    if not np.all(np.isfinite(ideal)):
        raise ValueError(
            f"the distortion cannot be undone everywhere in images of {width} x {height} px; name a calibration of "
            "this camera in pixels, with fewer unknowns if need be"
        )
    exact = _converted(camera, corner)
    if camera.distortion == "projected" and camera.c1 == camera.c2 == 0.0:
        return exact
    directions = np.column_stack([ideal[:, 0], -ideal[:, 1], np.full(len(ideal), camera.c)])
    seen = np.stack([columns, rows], axis=-1)
    fit = least_squares(lambda p: (project(p, directions) - seen).ravel(), exact, method="lm", x_scale="jac")
    return np.asarray(fit.x)


def project(parameters: Floats, points: Floats) -> Floats:
    """Where OpenCV's model sees points.

    Args:
        parameters: (9,), as of `plumb_bob`.
        points: (n, 3) in the camera's system, X right, Y down, Z forward.

    Returns:
        (n, 2), columns and rows, px; (0, 0) is the centre of the top-left pixel.
    """
    still, (fx, fy, cx, cy) = np.zeros(3), parameters[:4]
    matrix = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    pixels, _ = cv2.projectPoints(points, still, still, matrix, parameters[4:])
    return np.asarray(pixels, dtype=np.float64).reshape(-1, 2)


def _converted(camera: CalibratedCamera, centre: Floats) -> Floats:
    """The nine parameters of a camera with projected distortion, affinity and shear left out."""
    c = camera.c
    constant = 1.0 - sum(a * camera.r0**power for a, power in ((camera.a1, 2), (camera.a2, 4), (camera.a3, 6)))
    shape = np.array([camera.a1 * c**2, camera.a2 * c**4, -camera.b2 * c, camera.b1 * c, camera.a3 * c**6])
    interior = [c * constant, c * constant, centre[0] + camera.x0, centre[1] - camera.y0]
    return np.concatenate([interior, shape / constant])


def _lens(camera: CalibratedCamera) -> Lens:
    interior = np.array([getattr(camera, parameter) for parameter in INTERIOR])
    return Lens(interior, np.asarray(camera.r0), np.asarray(camera.distortion == "measured"))


def _encoded(name: str, parameters: Floats, size: tuple[int, int], time_ns: int) -> bytes:
    """The message, serialized; `time_ns`: when the calibration was written, UTC."""
    fx, fy, cx, cy, *distortion = parameters.tolist()
    message = CameraCalibration(
        frame_id=name,
        width=size[0],
        height=size[1],
        distortion_model="plumb_bob",
        D=distortion,
        K=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        R=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
        P=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )
    message.timestamp.FromNanoseconds(time_ns)
    encoded: bytes = message.SerializeToString()
    return encoded
