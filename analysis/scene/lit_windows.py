"""Cuts the windows around balls out of static images: grey values, noise, background, and which pixels count."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from analysis.scene.camera_system import PlacedCamera
from analysis.scene.disc import MARGIN
from analysis.scene.ground import CLEAR, REACH, ground_behind
from analysis.scene.lit_sphere import Spheres, disc_points
from analysis.scene.static_image import StaticImage
from rig.arrays import Flags, Floats, Integers

_AROUND = 2  # px beyond the window that tell the background too
_SIMILAR = 1.3  # ratio of the sizes of windows that are computed together
FULL = 255.0  #: grey value of a pixel that is full
_STEP_M = 0.02


@dataclass(frozen=True, slots=True, eq=False)
class SightedBalls:
    """n balls as cameras see them.

    Attributes:
        camera: (n,) index of the camera.
        xy: (n, 2) approximate centres, px.
        to_image: (n, 2, 2) px per metre, from the plane across the line of sight.
        axes: (n, 3, 3) columns: two axes of this plane, and the direction to the camera.
    """

    camera: Integers
    xy: Floats
    to_image: Floats
    axes: Floats

    def __len__(self) -> int:
        return len(self.camera)

    def only(self, chosen: Integers) -> "SightedBalls":
        """Some of them."""
        return SightedBalls(self.camera[chosen], self.xy[chosen], self.to_image[chosen], self.axes[chosen])

    def radius_px(self, radius: float) -> Floats:
        """(n,) radii in the image of balls of this radius in metres."""
        return np.asarray(radius * np.linalg.norm(self.to_image, 2, axis=(1, 2)))


def sighted(placed: Sequence[PlacedCamera], camera: Integers, xyz: Floats, xy: Floats) -> SightedBalls:
    """Balls in oriented images.

    Args:
        placed: the cameras.
        camera: (n,) index of the camera that sees each.
        xyz: (n, 3) their centres.
        xy: (n, 2) approximate places in the images, px.
    """
    n = len(camera)
    axes, to_image = np.empty((n, 3, 3)), np.empty((n, 2, 2))
    for index, one in enumerate(placed):
        of = camera == index
        if not of.any():
            continue
        view = one.position - xyz[of]
        view /= np.linalg.norm(view, axis=1)[:, None]
        aside = np.cross(view, one.rotation[:, 1])
        aside /= np.linalg.norm(aside, axis=1)[:, None]
        plane = np.stack((aside, np.cross(view, aside)), axis=1) * _STEP_M
        change = one.project(xyz[of][:, None] + plane) - one.project(xyz[of][:, None] - plane)
        to_image[of] = change.swapaxes(1, 2) / (2 * _STEP_M)
        axes[of] = np.concatenate((plane / _STEP_M, view[:, None]), axis=1).swapaxes(1, 2)
    return SightedBalls(camera, np.asarray(xy, float), to_image, axes)


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """The windows of m balls that are computed together.

    Attributes:
        index: (m,) of the balls.
        spheres: the balls.
        grey: (m, w, w).
        variance: (m, w, w) of the noise.
        used: (m, w, w) pixels that are fitted.
    """

    index: Integers
    spheres: Spheres
    grey: Floats
    variance: Floats
    used: Flags

    @property
    def saturated(self) -> Flags:
        """(m, w, w) pixels at full scale."""
        return np.asarray(self.grey >= FULL - 1)


def windows(
    static: Sequence[StaticImage], balls: SightedBalls, xy: Floats, radius: float, blur: float
) -> Iterator[Windows]:
    """The windows around centres xy (n, 2), grouped by size.

    Args:
        static: image of each camera.
        balls: the balls.
        xy: (n, 2) px, where the windows are.
        radius: of the balls, metres.
        blur: the smallest that is expected, px.
    """
    size = balls.radius_px(radius)
    half = np.ceil(size + REACH + 0.5)
    order = np.argsort(half, kind="stable")
    while len(order):
        together = half[order] <= max(_SIMILAR * half[order[0]], half[order[0]] + 1)
        index, order = order[together], order[~together]
        reach = int(half[index].max())
        yield _cut(static, balls, index, xy[index], size[index], reach, blur)


def _cut(
    static: Sequence[StaticImage],
    balls: SightedBalls,
    index: Integers,
    xy: Floats,
    size: Floats,
    half: int,
    blur: float,
) -> Windows:
    wide = half + _AROUND
    corner = np.rint(xy).astype(int) - wide
    span = np.arange(2 * wide + 1)
    m, w = len(index), len(span)
    grey, variance, inside = np.zeros((m, w, w)), np.ones((m, w, w)), np.zeros((m, w, w), bool)
    for i, (camera, (x, y)) in enumerate(zip(balls.camera[index], corner, strict=True)):
        image = static[int(camera)]
        columns, rows = image.size
        row, column = np.clip(span + y, 0, rows - 1)[:, None], np.clip(span + x, 0, columns - 1)
        grey[i], variance[i] = image.grey[row, column], image.noise[row, column] ** 2 / image.frames
        inside[i] = (row == (span + y)[:, None]) & (column == span + x)
    off = corner[:, :, None] + span - xy[:, :, None]
    away = np.hypot(off[:, 0, None, :], off[:, 1, :, None])
    beyond = away - size[:, None, None]
    background = ground_behind(grey, inside & (beyond > CLEAR) & (beyond < MARGIN))
    cut = np.s_[:, _AROUND:-_AROUND, _AROUND:-_AROUND]
    points, area, cosine = disc_points(float(size.max()), blur)
    axes = balls.axes[index]
    normals = np.einsum("nij,kj->nki", axes[:, :, :2], points) + cosine[:, None] * axes[:, None, :, 2]
    spheres = Spheres(
        (corner + _AROUND).astype(float), w - 2 * _AROUND, background[cut], balls.to_image[index], points, area, normals
    )
    used = (inside & (beyond < REACH))[cut]
    return Windows(index, spheres, grey[cut], variance[cut], used)
