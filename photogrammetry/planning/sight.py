"""What a planned camera sees: what is in its picture, and what no obstacle hides."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from photogrammetry.geometry.camera_model import Lens, camera_coordinates, image_point
from photogrammetry.network.model import Camera, Image
from rig.arrays import Flags, Floats


@dataclass(frozen=True, slots=True, eq=False)
class Obstacle:
    """A box with faces along the axes; corners low and high (3,)."""

    name: str
    low: Floats
    high: Floats

    def hides(self, eye: Floats, xyz: Floats) -> Flags:
        """Whether points (..., 3) are behind or inside the box, as seen from `eye` (3,)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            crossings = np.stack([self.low - eye, self.high - eye]).reshape(2, *[1] * (xyz.ndim - 1), 3) / (xyz - eye)
        enters = np.nanmax(crossings.min(axis=0), axis=-1)  # as part of the way from the eye to the point
        leaves = np.nanmin(crossings.max(axis=0), axis=-1)
        return np.asarray((enters < leaves) & (leaves > 0.0) & (enters < 1.0))


def in_picture(camera: Camera, image: Image, xyz: Floats) -> tuple[Floats, Flags]:
    """Image coordinates (..., 2) of points (..., 3), and whether they lie in front and within the picture (...)."""
    if image.position is None or image.rotation is None or camera.size is None:
        raise ValueError("a planned image has a pose and a size")
    lens = Lens(camera.interior, np.asarray(camera.balance), np.asarray(False))
    with np.errstate(all="ignore"):
        xy = image_point(lens, image.rotation, image.position, xyz)
        front = camera_coordinates(image.rotation, image.position, xyz)[..., 2] < 0.0
    return xy, front & (np.abs(xy) <= np.array(camera.size) / 2.0).all(axis=-1)


def in_sight(obstacles: Sequence[Obstacle], camera: Camera, image: Image, xyz: Floats) -> tuple[Floats, Flags]:
    """As `in_picture`, less what an obstacle hides."""
    xy, seen = in_picture(camera, image, xyz)
    if image.position is not None:
        for obstacle in obstacles:
            seen &= ~obstacle.hides(image.position, xyz)
    return xy, seen
