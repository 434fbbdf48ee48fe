"""Files as other programs write them, made of networks and calibrations that are known."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from photogrammetry.exchange.part import rotation_of
from photogrammetry.network.file_writer import metric_to_pixel
from photogrammetry.network.model import Network, Role
from rig.arrays import Floats

#: Pixels of the pictures.
SIZE = np.array([640, 480])


def write_opencv(path: Path, matrix: Floats, coefficients: Floats, **more: Any) -> Path:
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", coefficients)
    for key, value in more.items():
        storage.write(key, value)
    storage.release()
    return path


def _quaternion(rotation: Floats) -> Floats:
    """w, x, y, z of a rotation by less than a half turn."""
    vector = cv2.Rodrigues(rotation)[0].ravel()
    angle = np.linalg.norm(vector)
    return np.append(np.cos(angle / 2.0), np.sin(angle / 2.0) * vector / angle)


def write_colmap(
    folder: Path, network: Network, model: str = "OPENCV 640 480 {c} {c} {cx} {cy} -0.01 0.02 1e-4 2e-4"
) -> Path:
    """COLMAP's text files of a network: the reverse of the import, written down from COLMAP's own page."""
    folder.mkdir()
    cameras = [
        f"{i} {model}".format(c=camera.interior[0], cx=320.0 + camera.interior[1], cy=240.0 - camera.interior[2])
        for i, camera in enumerate(network.cameras, start=1)
    ]
    (folder / "cameras.txt").write_text("# Camera list\n" + "\n".join(cameras) + "\n")
    lines, o = ["# Image list"], network.observations
    for i, image in enumerate(network.images):
        assert image.rotation is not None
        down = image.rotation.T * np.array([[1.0], [-1.0], [-1.0]])
        pose = [*_quaternion(down), *(-down @ image.position)]
        pixels = metric_to_pixel(o.xy[o.image == i], SIZE) + 0.5
        points = zip(pixels, o.point[o.image == i], strict=True)
        seen = " ".join(f"{xy[0]!r} {xy[1]!r} {point + 7}" for xy, point in points)
        lines += [
            f"{i + 1} {' '.join(map(repr, map(float, pose)))} {image.camera + 1} {image.name}.jpg",
            f"1.5 2.5 -1 {seen}",
        ]
    (folder / "images.txt").write_text("\n".join(lines).replace("np.float64(", "").replace(")", "") + "\n")
    xyz = [f"{i + 7} {x!r} {y!r} {z!r} 255 0 0 0.5 1 2" for i, (x, y, z) in enumerate(coordinates(network).tolist())]
    (folder / "points3D.txt").write_text("\n".join(xyz) + "\n")
    return folder


def coordinates(network: Network) -> Floats:
    return np.array([np.zeros(3) if point.xyz is None else point.xyz for point in network.points])


def photomodeler_text(network: Network) -> str:
    """A text export, from the layout in the docstring of the reader."""
    size = (7.2, 5.4)  # mm; a pixel is 0.01125 mm
    scale = size[0] / 640.0
    text = [
        "Bundle Soln test",
        " 0.0005 20 640 480",
        " 1 1 1 1 1 1 1 1 1",
        " 7 3.6 2.7 7.2 5.4 0 0 0 0 0",
        " 0 0 0 0 0 0 0 0 0 0",
    ]
    for i, image in enumerate(network.images):
        r = np.asarray(image.rotation)
        angles = (np.arctan2(-r[0, 1], r[0, 0]), np.arcsin(r[0, 2]), np.arctan2(-r[1, 2], r[2, 2]))
        interior = network.cameras[image.camera].interior
        inner = [interior[0] * scale, 3.6 + 0.05, 2.7 - 0.02, *size, 2e-4, 0.0, 0.0, 1e-5, -2e-5]
        text += [f"  {i} C:\\photos\\{image.name}.JPG", _row(i, *np.asarray(image.position), *np.degrees(angles))]
        text += [_row(i, *[0.001] * 6), "", _row(i, *inner), _row(i, *[0.0] * 10)]
    surveyed = [p for p in network.points if p.role is Role.CONTROL]
    text += ["", *(_row(p.name, *np.asarray(p.xyz), *np.asarray(p.sigma)) for p in surveyed)]
    text += ["", *(_row(p.name, *np.asarray(p.xyz), 0.1, 0.1, 0.1) for p in network.points), ""]
    o = network.observations
    for i, p, xy in zip(o.image, o.point, o.xy, strict=True):
        text.append(_row(i, network.points[p].name, xy[0] + 320.0, 240.0 - xy[1], 0.33, 0.0))
    return "\n".join(text).replace("B", "10").replace("T", "20").replace("10undle", "Bundle") + "\n"


def _row(*values: Any) -> str:
    return " ".join(value if isinstance(value, str) else repr(float(value)) for value in values).replace(".0 ", " ", 1)


AICON_ROTATION = rotation_of(0.3, -0.2, 1.1)


AICON = {
    "cams.ior": "# camera c x0 y0 a1 a2 r0 a3 b1 b2 c1 c2\n"
    "7 -28.5 0.05 -0.03 -1.0e-4 1.5e-7 9.5 0 1e-6 2e-6 1e-4 -2e-4\n",
    "poses.eor": "# image camera X0 Y0 Z0 omega_gon phi_gon kappa_gon\n"
    f"1 7 1.0 2.0 3.0 {0.3 * 200 / np.pi} {-0.2 * 200 / np.pi} {1.1 * 200 / np.pi}\n2 7 4 5 6 0 0 0\n",
    "points.phc": "1 T1 1.25 -2.5 0.001 0.002\n2 T1 1.5 2.5 0.001 0.002\n1 T2 0 0 0.001 0.001\n",
    "points.obc": "T1 1.0 2.0 -8.0 0.01 0.01 0.02\nT2 0.5 0.5 -9\n",
}


def write_aicon(folder: Path, **other: str) -> list[Path]:
    for name, text in (AICON | other).items():
        (folder / name).write_text(text)
    return [folder / name for name in AICON]
