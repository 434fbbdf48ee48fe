"""Takes interior orientations from the result of a calibration; step 2 takes them as constants."""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR, Distortion
from photogrammetry.network.calibration_file import CalibratedCamera
from photogrammetry.network.model import Camera, Network, Role
from photogrammetry.network.selection import only_points, rays, sub_network
from rig.errors import BadInputError


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
