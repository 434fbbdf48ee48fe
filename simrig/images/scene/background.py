"""Renders what never moves (sky, forest, snow, take-off table, poles of the balls), once per camera."""

import math
from collections.abc import Iterable
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from rig.arrays import Floats
from simrig.images.scene.balls import put_poles
from simrig.images.scene.drawing import Canvas, Image
from simrig.world.projection import Projection
from simrig.world.scenario import BRIGHTEST, REFERENCE_WIDTH, Scenario

_NEAREST_M = 2.0
_QUAD_M = 3.0  #: length and width of a quad of snow
_TABLE_END_M = -45.0


def paint(scenario: Scenario, projection: Projection) -> Image:
    """Radiance of the empty hill as this camera sees it, without balls and noise; shape (h, w)."""
    rng = np.random.default_rng((scenario.seed, 77))  # the same forest for all cameras
    painter = _Painter(scenario, projection, rng)
    painter.paint_land_and_forest()
    painter.paint_table()
    image = painter.canvas.image()
    image += _texture(image.shape, projection.width / REFERENCE_WIDTH, rng)
    image = cv2.GaussianBlur(image, (0, 0), scenario.image.blur_sigma_px).astype(np.float32)
    effects = scenario.image
    if (effects.background_scale, effects.background_offset) != (1.0, 0.0):
        image = np.clip(image * effects.background_scale + effects.background_offset, 0, BRIGHTEST).astype(np.float32)
    put_poles(image, scenario, projection)
    return image


class _Painter:
    """Paints polygons of the hill from far to near."""

    def __init__(self, scenario: Scenario, projection: Projection, rng: np.random.Generator) -> None:
        self._hill = scenario.hill
        self._projection = projection
        self._rng = rng
        self._left = projection.X0[1] > 0  #: the camera stands left of the hill and looks to the other side
        self.canvas = Canvas(_sky(projection))

    def paint_land_and_forest(self) -> None:
        (land, snow), (trees, needles) = self._land(), self._trees()
        far = np.concatenate([self._projection.distance(land).mean(axis=1), self._projection.distance(trees[:, 0])])
        polygons = [*zip((*self._places(land), *self._places(trees)), (*snow.tolist(), *needles.tolist()), strict=True)]
        self._fill(polygons[index] for index in np.argsort(-far, kind="stable"))

    def paint_table(self) -> None:
        """The take-off table: a wedge of boards with two tracks and a dark line at the edge."""
        half, foot = self._hill.table_width_m / 2, float(self._hill.ground(0.0))
        xs = np.linspace(_TABLE_END_M, 0.0, 16)
        spans = [(a, b, float(self._hill.table(a)), float(self._hill.table(b))) for a, b in pairwise(xs)]
        near = -half if self._projection.X0[1] < 0 else half
        boards: list[tuple[list[tuple[float, float, float]], float]] = []
        for a, b, za, zb in spans:
            boards.append(([(a, near, za), (b, near, zb), (b, near, foot), (a, near, foot)], 98.0))
            boards.append(([(a, near, za), (b, near, zb), (b, near, zb - 0.3), (a, near, za - 0.3)], 60.0))
        if self._projection.X0[0] > 0:
            boards.append(([(0, -half, 0), (0, half, 0), (0, half, foot), (0, -half, foot)], 78.0))
            boards.append(([(0, -half, 0), (0, half, 0), (0, half, -0.12), (0, -half, -0.12)], 45.0))
        if self._projection.X0[2] > float(self._hill.table(self._projection.X0[0])):
            for a, b, za, zb in spans:
                boards.append(([(a, -half, za), (b, -half, zb), (b, half, zb), (a, half, za)], 168.0))
                for y in (-0.17, 0.17):
                    track = [(a, y - 0.06, za), (b, y - 0.06, zb), (b, y + 0.06, zb), (a, y + 0.06, za)]
                    boards.append((track, 128.0))
        places = self._places(np.array([corners for corners, _ in boards]))
        self._fill(zip(places, (grey for _, grey in boards), strict=True))

    def _land(self) -> tuple[Floats, Floats]:
        """Quads of snow: groomed knoll, softer snow beside it that rises towards the forest.

        Returns:
            Corners, m, shape (n, 4, 3), and grey values, shape (n,).
        """
        xs, ys = np.arange(-60.0, 150.0, _QUAD_M), np.arange(-27.0, 75.0, _QUAD_M)
        if self._left:
            ys = -_QUAD_M - ys
        x, y = (axis.ravel() for axis in np.meshgrid(xs, ys, indexing="ij"))
        u = np.stack((x, x + _QUAD_M, x + _QUAD_M, x), axis=1)
        v = np.stack((y, y, y + _QUAD_M, y + _QUAD_M), axis=1)
        corners = np.stack((u, v, self._hill.snow(u, v)), axis=-1)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0])
        light = normals @ (-0.45, -0.2, 0.87) / np.linalg.norm(normals, axis=1)
        knoll = (np.abs(y + _QUAD_M / 2) < self._hill.knoll_width_m / 2) & (x >= 0)
        own = np.full(len(x), 9.0)
        own[~knoll] = self._rng.normal(0, 2.0, np.count_nonzero(~knoll))
        return corners, 106 + 62 * light + own

    def _trees(self) -> tuple[Floats, Floats]:
        """Spruces in rows; the farther a row, the more mist lies over it.

        Returns:
            Corners of their triangles, m, shape (n, 3, 3), and grey values, shape (n,).
        """
        trees = []
        for y, gap, mist in ((70.0, 2.0, 128.0), (52.0, 2.2, 116.0), (38.0, 2.6, 106.0), (26.0, 4.0, 98.0)):
            for x in np.arange(-60.0, 150.0, gap):
                where = (x + self._rng.uniform(-1, 1), (y + self._rng.uniform(-3, 3)) * (-1 if self._left else 1))
                trees.append((*where, self._rng.uniform(7, 15), mist + self._rng.normal(0, 4)))
        return self._spruces(*np.array(trees).T)

    def _spruces(self, x: Floats, y: Floats, tall: Floats, grey: Floats) -> tuple[Floats, Floats]:
        """Trees as four tiers of triangles that face the camera, each with snow on one flank; arguments (n,)."""
        feet, right = np.stack((x, y, self._hill.snow(x, y)), axis=1), self._projection.R[:, 0]
        up, across = tall[:, None] * (0.0, 0.0, 1.0), tall[:, None] * right
        triangles, greys = [], []
        for k in range(4):
            low, high, wide = 0.08 + 0.22 * k, min(1.0, 0.45 + 0.2 * k), 0.19 * (1 - 0.2 * k)
            left, tip = feet + low * up - wide * across, feet + high * up
            triangles.append(np.stack((left, feet + low * up + wide * across, tip), axis=1))
            triangles.append(np.stack((left, feet + (low + 0.05) * up - 0.5 * wide * across, tip), axis=1))
            greys += [grey, grey + 34]
        return np.stack(triangles, axis=1).reshape(-1, 3, 3), np.stack(greys, axis=1).ravel()

    def _places(self, polygons: Floats) -> list[NDArray[np.int32] | None]:
        """Where polygons, corners in m, shape (n, k, 3), are on the canvas; None: not in the image or too near."""
        near = self._projection.distance(polygons).min(axis=1) > _NEAREST_M
        pixels = self._projection.pixels(polygons[near])
        size = self._projection.width, self._projection.height
        inside = (pixels.max(axis=1) >= -1).all(axis=1) & (pixels.min(axis=1) <= size).all(axis=1)
        places: list[NDArray[np.int32] | None] = [None] * len(polygons)
        for index, corners in zip(np.flatnonzero(near)[inside], self.canvas.on_grid(pixels[inside]), strict=True):
            places[index] = corners
        return places

    def _fill(self, polygons: Iterable[tuple[NDArray[np.int32] | None, float]]) -> None:
        """Fill polygons with their grey values, one over the other; corners as `_places` gives them."""
        for corners, grey in polygons:
            if corners is not None:
                self.canvas.fill(corners, grey)


def _sky(projection: Projection) -> NDArray[np.uint8]:
    """Overcast sky, brighter towards the horizon; shape (h, w)."""
    rows = np.linspace(158, 186, projection.height)
    return np.repeat(np.rint(rows).astype(np.uint8)[:, None], projection.width, axis=1)


def _texture(shape: tuple[int, ...], scale: float, rng: np.random.Generator) -> Image:
    """Fine and coarse irregularities of snow and trees, grey values; shape (h, w)."""
    height, width = shape
    texture = np.zeros(shape, np.float32)
    for sigma, strength in ((1.2, 2.2), (9.0, 3.0)):
        field = rng.standard_normal((math.ceil(height / scale), math.ceil(width / scale))).astype(np.float32)
        field = cv2.GaussianBlur(field, (0, 0), sigma).astype(np.float32)
        texture += strength / field.std() * cv2.resize(field, (width, height), interpolation=cv2.INTER_LINEAR)
    return texture
