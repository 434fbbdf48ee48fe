"""The image of lit spheres: grey values and their derivatives, many balls at once.

A ball of known radius hides what is behind it and is lit by one light that all balls of a recording share:

    I = b (1 - D) + g G * (M L(n)),   D = G * M,   L = A + H n_Z + max(0, n . S),

with the background b, the ball's outline M, the blur G (a Gaussian, pixel included), the camera's gain g, the normal n
in object space, even light A, light from above H, and the light of the sun S, whose length is its strength. It is
integrated over points of the disc (Gauss and Legendre in the cosine between normal and view, evenly around), each
of which gives a Gaussian, the product of one along x and one along y.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from rig.arrays import Floats

LIGHT: Final = 5  #: unknowns of the light: A, H, S
UNKNOWNS: Final = 10  #: of a ball: x, y; light; log of gain, blur and radius
_SPACING = 1.3  # blurs between points of the disc: the outline is true to 1e-3
_TOGETHER = 8  # balls that are computed at a time


@dataclass(frozen=True, slots=True, eq=False)
class Spheres:
    """n balls in images, all with windows of w x w px.

    Attributes:
        corner: (n, 2) column and row of the windows' first pixels.
        size: w.
        background: (n, w, w) grey values behind the balls.
        to_image: (n, 2, 2) px per metre, from the plane across the line of sight.
        points: (k, 2) points of the unit disc.
        area: (k,) of it that each stands for.
        normals: (n, k, 3) of the ball at these points, in object space.
    """

    corner: Floats
    size: int
    background: Floats
    to_image: Floats
    points: Floats
    area: Floats
    normals: Floats

    def part(self, place: slice) -> "Spheres":
        """Some of the balls."""
        return replace(
            self, corner=self.corner[place], background=self.background[place], to_image=self.to_image[place],
            normals=self.normals[place],
        )  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Unknowns: centres xy (n, 2), light (5,), gain (n,), blur (n,) in px, radius in metres."""

    xy: Floats
    light: Floats
    gain: Floats
    blur: Floats
    radius: float

    def part(self, place: slice) -> "Light":
        """That of some of the balls."""
        return replace(self, xy=self.xy[place], gain=self.gain[place], blur=self.blur[place])


def disc_points(radius_px: float, blur: float) -> tuple[Floats, Floats, Floats]:
    """Points (k, 2) of the unit disc, their areas (k,), and cosines between normal and view (k,).

    Args:
        radius_px: largest radius that is drawn with them.
        blur: smallest blur, px.
    """
    rings = max(4, int(np.ceil(1.1 * np.pi / 2 * radius_px / (_SPACING * blur))))
    around = max(12, int(np.ceil(2 * np.pi * radius_px / (_SPACING * blur))))
    node, weight = np.polynomial.legendre.leggauss(rings)
    cosine, weight = (node + 1) / 2, weight / 2
    turn = 2 * np.pi * (np.arange(around) + 0.5 * (np.arange(rings) % 2)[:, None]) / around
    away = np.sqrt(1 - cosine**2)[:, None]
    points = np.stack((away * np.cos(turn), away * np.sin(turn)), axis=-1).reshape(-1, 2)
    return points, np.repeat(cosine * weight * 2 * np.pi / around, around), np.repeat(cosine, around)


def sphere_images(spheres: Spheres, at: Light, *, clipped: bool = True) -> tuple[Floats, Floats, Floats]:
    """Grey values of the balls' windows.

    Args:
        spheres: the balls.
        at: the unknowns.
        clipped: the side that is turned away from the sun is dark; otherwise darker than with no sun, by as much as the
            other one is brighter: a start that has one optimum.

    Returns:
        Grey values (n, w, w), derivatives (n, 10, w, w), and the share of each pixel that the ball covers (n, w, w).
    """
    places = [slice(first, first + _TOGETHER) for first in range(0, len(spheres.corner) or 1, _TOGETHER)]
    few = [_few_images(spheres.part(place), at.part(place), clipped=clipped) for place in places]
    value, design, cover = (np.concatenate(each) for each in zip(*few, strict=True))
    return value, design, cover


def _few_images(spheres: Spheres, at: Light, *, clipped: bool) -> tuple[Floats, Floats, Floats]:
    """As `sphere_images`, of so few balls that what is computed of them stays in the processor's cache."""
    n, w = len(spheres.corner), spheres.size
    gain, blur = at.gain[:, None, None], at.blur[:, None, None]
    off = at.radius * np.einsum("nij,kj->nik", spheres.to_image, spheres.points)
    away = (spheres.corner - at.xy)[:, :, None] + np.arange(w)  # of the pixels from the centre, columns and rows
    u, v = (away[:, i, :, None] / blur - (off[:, i] / at.blur[:, None])[:, None] for i in (0, 1))
    across, down = np.exp(-0.5 * u * u), np.exp(-0.5 * v * v)
    normals = spheres.normals
    along = normals @ at.light[2:]
    lit = (along > 0 if clipped else np.ones_like(along, bool)) * 1.0
    shade = at.light[0] + at.light[1] * normals[:, :, 2] + lit * along
    size = at.radius**2 * np.abs(np.linalg.det(spheres.to_image)) / (2 * np.pi * at.blur**2)
    area = size[:, None] * spheres.area
    both = np.stack((area, area * shade), axis=1)  # what the outline and what the light weighs
    lights = np.concatenate((normals[:, :, 2:], normals * lit[..., None]), axis=2).transpose(0, 2, 1) * area[:, None]

    def weighed(rows: Floats, weights: Floats) -> Floats:
        """Rows (n, w, k) with weights (n, c, k): (n, c, w, k)."""
        return np.asarray(weights[:, :, None] * rows[:, None])

    def summed(rows: Floats, columns: Floats) -> Floats:
        """Sums over the points: rows (n, c, w, k), columns (n, w, k) to (n, c, w, w)."""
        stacked = rows.reshape(n, -1, rows.shape[-1])
        return np.asarray((stacked @ columns.swapaxes(1, 2)).reshape(n, -1, w, w))

    upright, steep = weighed(down, both), down * v
    outline_and_light = summed(upright, across)
    parts = np.concatenate((outline_and_light[:, :1], summed(weighed(down, lights), across)), axis=1)
    flat = across * u
    by_x = summed(upright, flat) / blur[..., None]  # by the place of the point
    by_y = summed(weighed(steep, both), across) / blur[..., None]
    by_blur = summed(upright, flat * u) + summed(weighed(steep * v, both), across) - 2 * outline_and_light
    # A larger ball is what is seen nearer and less blurred: the same sums, since off = away - blur * (u, v).
    by_radius = away[:, 0, None, None] * by_x + away[:, 1, None, :, None] * by_y - by_blur
    cover, light = outline_and_light[:, 0], outline_and_light[:, 1]
    value = spheres.background * (1 - cover) + gain * light
    design = np.empty((n, UNKNOWNS, w, w))
    for column, change in ((0, by_x), (1, by_y), (8, by_blur), (9, by_radius)):
        design[:, column] = gain * change[:, 1] - spheres.background * change[:, 0]
    design[:, 2 : 2 + LIGHT] = gain[:, None] * parts
    design[:, 7] = gain * light
    return value, design, cover
