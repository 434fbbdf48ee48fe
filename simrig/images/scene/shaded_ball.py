"""Draws balls that a sun shades: points all over the sphere, each projected on its own, with its own radiance.

The surface is that of Oren and Nayar (SIGGRAPH 1994, qualitative model), as rough paint or cloth is, with a gloss
(Blinn's highlight); sky and snow light it from above and below. Nothing here is the model that the analysis fits.
"""

import math
from functools import cache

import numpy as np

from rig.arrays import Floats
from simrig.images.scene.drawing import PIXEL_VARIANCE, REACH_SIGMA, Image
from simrig.world.conditions.effects import Sun
from simrig.world.projection import Projection

_POINTS = 6000  #: on the whole sphere
_HIGHLIGHT = 40  #: exponent of the gloss
_STEP_M = 1e-3  #: for the scale of the image


class ShadedBall:
    """One ball in the light of a sun.

    Args:
        sun: the light.
        centre: of the ball, m, shape (3,).
        radius_m: of the ball.
        blur_sigma_px: blur of the lens.
        brightest: radiance of white.
    """

    def __init__(self, sun: Sun, centre: Floats, radius_m: float, blur_sigma_px: float, brightest: float) -> None:
        self._sun, self._centre, self._radius_m = sun, centre, radius_m
        self._sigma = math.sqrt(blur_sigma_px**2 + PIXEL_VARIANCE)
        self._brightest = brightest

    def draw(self, image: Image, projection: Projection) -> None:
        """Draw the ball into an image of radiance, shape (h, w), in place."""
        normals = _sphere()
        points = self._centre + self._radius_m * normals
        views = projection.X0 - points
        views /= np.linalg.norm(views, axis=1)[:, None]
        facing = np.einsum("ni,ni->n", normals, views)
        seen = facing > 0
        normals, views, facing = normals[seen], views[seen], facing[seen]
        x, y = projection.pixels(points[seen]).T
        reach = REACH_SIGMA * self._sigma
        rows = slice(max(0, math.ceil(y.min() - reach)), max(0, math.floor(y.max() + reach) + 1))
        columns = slice(max(0, math.ceil(x.min() - reach)), max(0, math.floor(x.max() + reach) + 1))
        window = image[rows, columns]
        if not window.size:
            return
        down = _blurred(np.arange(rows.start, rows.start + window.shape[0]), y, self._sigma)
        across = _blurred(np.arange(columns.start, columns.start + window.shape[1]), x, self._sigma)
        area = facing * (4 * math.pi * self._radius_m**2 / _POINTS) * self._scale(projection)
        down *= area
        radiance = self._brightest * np.minimum(1.0, _radiance(self._sun, normals, views))
        cover = np.minimum(1.0, down @ across.T)
        window *= (1 - cover).astype(np.float32)
        window += ((down * radiance) @ across.T).astype(np.float32)

    def _scale(self, projection: Projection) -> float:
        """Area in the image, px^2, of a square metre that faces the camera at the ball's place."""
        view = projection.X0 - self._centre
        view /= np.linalg.norm(view)
        aside = np.cross(view, (0.0, 0.0, 1.0))
        aside /= np.linalg.norm(aside)
        steps = _STEP_M * np.array((aside, np.cross(view, aside)))
        change = (projection.pixels(self._centre + steps) - projection.pixels(self._centre - steps)) / (2 * _STEP_M)
        return abs(float(np.linalg.det(change)))


def towards(sun: Sun) -> Floats:
    """Unit vector to the sun, shape (3,)."""
    azimuth, elevation = math.radians(sun.azimuth_deg), math.radians(sun.elevation_deg)
    level = math.cos(elevation)
    return np.array((level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)))


def _radiance(sun: Sun, normals: Floats, views: Floats) -> Floats:
    """Radiance of points of a white ball, 1 = white; (n,) for normals and directions to the camera (n, 3)."""
    there = towards(sun)
    incident = normals @ there
    facing = np.einsum("ni,ni->n", normals, views)
    lit = np.maximum(incident, 0.0)
    rough = math.radians(sun.roughness_deg) ** 2
    a, b = 1 - 0.5 * rough / (rough + 0.33), 0.45 * rough / (rough + 0.09)
    s = views @ there - incident * facing
    t = np.where(s > 0, np.maximum(np.maximum(incident, facing), 1e-6), 1.0)
    half = views + there
    half /= np.maximum(np.linalg.norm(half, axis=1), 1e-9)[:, None]
    highlight = np.maximum(np.einsum("ni,ni->n", normals, half), 0.0) ** _HIGHLIGHT
    around = (1 + normals[:, 2]) / 2 * sun.sky + (1 - normals[:, 2]) / 2 * sun.snow
    return np.asarray(sun.direct * lit * (a + b * s / t) + sun.gloss * (incident > 0) * highlight + around)


def _blurred(pixels: Floats, places: Floats, sigma: float) -> Floats:
    """What points at `places` (n,) give to each of `pixels` (k,): shape (k, n)."""
    off = (pixels[:, None] - places) / sigma
    return np.asarray(np.exp(-0.5 * off * off) / (math.sqrt(2 * math.pi) * sigma))


@cache
def _sphere() -> Floats:
    """Points spread evenly over the unit sphere (Fibonacci's lattice), shape (n, 3)."""
    i = np.arange(_POINTS) + 0.5
    z = 1 - 2 * i / _POINTS
    level = np.sqrt(1 - z * z)
    turn = i * math.pi * (3 - math.sqrt(5))
    return np.stack((level * np.cos(turn), level * np.sin(turn), z), axis=1)
