"""Renders what never moves (sky, forest, snow, take-off table, poles of the balls), once per camera."""

import math
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.arrays import Floats
from simrig.images.scene.balls import put_poles
from simrig.images.scene.drawing import Canvas, Image
from simrig.world.projection import Projection
from simrig.world.scenario import BRIGHTEST, REFERENCE_WIDTH, Scenario

_NEAREST_M = 2.0
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
        things = [(self._far(quad), quad, grey) for quad, grey in self._land()]
        things += [(self._far(tree[:1]), tree, grey) for trees in self._trees() for tree, grey in trees]
        for _, corners, grey in sorted(things, key=lambda thing: -thing[0]):
            self._fill(corners, grey)

    def paint_table(self) -> None:
        """The take-off table: a wedge of boards with two tracks and a dark line at the edge."""
        half, foot = self._hill.table_width_m / 2, float(self._hill.ground(0.0))
        xs = np.linspace(_TABLE_END_M, 0.0, 16)
        spans = [(a, b, float(self._hill.table(a)), float(self._hill.table(b))) for a, b in pairwise(xs)]
        near = -half if self._projection.X0[1] < 0 else half
        for a, b, za, zb in spans:
            self._fill([(a, near, za), (b, near, zb), (b, near, foot), (a, near, foot)], 98.0)
            self._fill([(a, near, za), (b, near, zb), (b, near, zb - 0.3), (a, near, za - 0.3)], 60.0)
        if self._projection.X0[0] > 0:
            self._fill([(0, -half, 0), (0, half, 0), (0, half, foot), (0, -half, foot)], 78.0)
            self._fill([(0, -half, 0), (0, half, 0), (0, half, -0.12), (0, -half, -0.12)], 45.0)
        if self._projection.X0[2] > float(self._hill.table(self._projection.X0[0])):
            for a, b, za, zb in spans:
                self._fill([(a, -half, za), (b, -half, zb), (b, half, zb), (a, half, za)], 168.0)
                for y in (-0.17, 0.17):
                    self._fill([(a, y - 0.06, za), (b, y - 0.06, zb), (b, y + 0.06, zb), (a, y + 0.06, za)], 128.0)

    def _land(self) -> list[tuple[Floats, float]]:
        """Quads of snow: groomed knoll, softer snow beside it that rises towards the forest."""
        xs, ys = np.arange(-60.0, 150.0, 3.0), np.arange(-27.0, 75.0, 3.0)
        if self._left:
            ys = -3.0 - ys
        quads = []
        for x in xs:
            for y in ys:
                corners = np.array(
                    [(u, v, self._hill.snow(u, v)) for u, v in ((x, y), (x + 3, y), (x + 3, y + 3), (x, y + 3))]
                )
                normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
                light = float(normal @ (-0.45, -0.2, 0.87)) / float(np.linalg.norm(normal))
                knoll = abs(y + 1.5) < self._hill.knoll_width_m / 2 and x >= 0
                quads.append((corners, 106 + 62 * light + (9 if knoll else self._rng.normal(0, 2.0))))
        return quads

    def _trees(self) -> list[list[tuple[Floats, float]]]:
        """Spruces in rows; the farther a row, the more mist lies over it."""
        trees = []
        for y, gap, mist in ((70.0, 2.0, 128.0), (52.0, 2.2, 116.0), (38.0, 2.6, 106.0), (26.0, 4.0, 98.0)):
            for x in np.arange(-60.0, 150.0, gap):
                where = (x + self._rng.uniform(-1, 1), (y + self._rng.uniform(-3, 3)) * (-1 if self._left else 1))
                trees.append(self._spruce(*where, self._rng.uniform(7, 15), mist + self._rng.normal(0, 4)))
        return trees

    def _spruce(self, x: float, y: float, tall: float, grey: float) -> list[tuple[Floats, float]]:
        """A tree as four tiers of triangles that face the camera, each with snow on one flank."""
        foot, right = np.array((x, y, self._hill.snow(x, y))), self._projection.R[:, 0]
        up, tiers = np.array((0.0, 0.0, tall)), []
        for k in range(4):
            low, high, wide = 0.08 + 0.22 * k, min(1.0, 0.45 + 0.2 * k), 0.19 * tall * (1 - 0.2 * k)
            left, tip = foot + low * up - wide * right, foot + high * up
            tiers.append((np.stack((left, foot + low * up + wide * right, tip)), grey))
            tiers.append((np.stack((left, foot + (low + 0.05) * up - 0.5 * wide * right, tip)), grey + 34))
        return tiers

    def _far(self, corners: ArrayLike) -> float:
        return float(np.mean(self._projection.distance(corners)))

    def _fill(self, corners: ArrayLike, grey: float) -> None:
        if np.min(self._projection.distance(corners)) > _NEAREST_M:
            self.canvas.polygon(self._projection.pixels(corners), grey)


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
