"""The image of lit spheres: grey values and their derivatives, many balls at once.

A ball of known radius hides what is behind it and is lit by one light that all balls of a recording share:

    I = b (1 - D) + g G * (M L(n)),   D = G * M,   L = A + H n_Z + max(0, n . S),

with the background b, the ball's outline M, the blur G (a Gaussian, pixel included), the camera's gain g, the normal n
in object space, even light A, light from above H, and the light of the sun S, whose length is its strength. It is
integrated over points of the disc (Gauss and Legendre in the cosine between normal and view, evenly around), each
of which gives a Gaussian, the product of one along x and one along y.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from rig.arrays import Floats

LIGHT: Final = 5  #: unknowns of the light: A, H, S
UNKNOWNS: Final = 10  #: of a ball: x, y; light; log of gain, blur and radius
_SPACING = 1.3  # blurs between points of the disc: the outline is true to 1e-3
_ROOT = float(np.sqrt(2 * np.pi))


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


@dataclass(frozen=True, slots=True, eq=False)
class Light:
    """Unknowns: centres xy (n, 2), light (5,), gain (n,), blur (n,) in px, radius in metres."""

    xy: Floats
    light: Floats
    gain: Floats
    blur: Floats
    radius: float


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
    n, w = len(spheres.corner), spheres.size
    gain, blur = at.gain[:, None, None], at.blur[:, None, None]
    off = at.radius * np.einsum("nij,kj->nik", spheres.to_image, spheres.points)
    determinant = np.abs(np.linalg.det(spheres.to_image))
    pixel = np.arange(w)
    first = spheres.corner - at.xy
    u, v = ((pixel + first[:, i, None])[:, :, None] - off[:, i, None] for i in (0, 1))
    u /= blur
    v /= blur
    across, down = np.exp(-0.5 * u * u) / (_ROOT * blur), np.exp(-0.5 * v * v) / (_ROOT * blur)
    normals = spheres.normals
    along = normals @ at.light[2:]
    lit = (along > 0 if clipped else np.ones_like(along, bool)) * 1.0
    shade = at.light[0] + at.light[1] * normals[:, :, 2] + lit * along
    area = (at.radius**2 * determinant[:, None]) * spheres.area
    both = np.stack((area, area * shade), axis=1)  # what the outline and what the light weighs
    channels = area[:, None] * np.concatenate(
        (np.ones((n, 1, len(spheres.points))), normals[:, None, :, 2], (normals * lit[..., None]).transpose(0, 2, 1)),
        axis=1,
    )

    def summed(rows: Floats, weights: Floats, columns: Floats) -> Floats:
        """Sums over the points: rows (n, w, k), weights (n, c, k), columns (n, w, k) to (n, c, w, w)."""
        stacked = (weights[:, :, None] * rows[:, None]).reshape(n, -1, rows.shape[-1])
        return np.asarray((stacked @ columns.swapaxes(1, 2)).reshape(n, -1, w, w))

    slope_u, slope_v = across * u / blur, down * v / blur  # by the place of the point
    parts = summed(down, channels, across)
    by_x, by_y = summed(down, both, slope_u), summed(slope_v, both, across)
    by_blur = summed(down, both, across * (u * u - 1)) + summed(down * (v * v - 1), both, across)
    moved = [both * off[:, i, None] for i in (0, 1)]
    by_radius = summed(down, moved[0], slope_u) + summed(slope_v, moved[1], across)
    cover = parts[:, 0]
    light = np.einsum("c,ncij->nij", at.light, parts)
    by_radius += 2 * np.stack((cover, light), axis=1)
    value = spheres.background * (1 - cover) + gain * light
    design = np.empty((n, UNKNOWNS, w, w))
    for column, change in ((0, by_x), (1, by_y), (8, by_blur), (9, by_radius)):
        design[:, column] = gain * change[:, 1] - spheres.background * change[:, 0]
    design[:, 2 : 2 + LIGHT] = gain[:, None] * parts
    design[:, 7] = gain * light
    return value, design, cover
