"""Draws what stands and moves around the hill: swaying trees and flags, people, judges' towers."""

from collections.abc import Iterable

import numpy as np

from rig.arrays import Floats
from simrig.images.scene.drawing import Image, cut, fill, stroke
from simrig.world.conditions import surroundings
from simrig.world.conditions.effects import Tower
from simrig.world.conditions.surroundings import Swaying
from simrig.world.figure.body import Part, outlines
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

_NEAREST_M = 2.0
_TIERS = 4
_TIER = np.arange(_TIERS)
_LOW, _HIGH = 0.08 + 0.22 * _TIER, np.minimum(1.0, 0.45 + 0.2 * _TIER)  #: of each tier, share of the tree's height
_TREE_SWAY = 0.035  #: of a tree's height
_CLOTH = 5  #: pieces of a flag
_CLOTH_M = (1.5, 0.9)
_POLE = 80.0
#: Faces of a tower by its corners, and how bright they are: right, left, towards the edge, away from it, top.
_FACES = (((0, 4, 5, 1), 0.85), ((2, 6, 7, 3), 0.8), ((0, 2, 3, 1), 1.0), ((4, 6, 7, 5), 0.7), ((1, 5, 7, 3), 1.25))
_WINDOW = 45.0


class Around:
    """Draws the surroundings as one camera sees them.

    Args:
        scenario: says what there is.
        projection: the camera as it was set up.
    """

    def __init__(self, scenario: Scenario, projection: Projection) -> None:
        beyond = -1 if projection.X0[1] > 0 else 1  # forest, trees and flags are across the hill for every camera
        self._trees = surroundings.trees(scenario, beyond)
        self._flags = surroundings.flags(scenario, beyond)
        self._walkers = surroundings.walkers(scenario)
        self._towers = scenario.surroundings.towers

    def draw_behind(self, image: Image, projection: Projection, scene_s: float, distance: float | None) -> None:
        """Draw what is behind the balls: towers beyond the hill, trees, flags, people farther away than `distance`.

        Args:
            image: image of radiance, shape (h, w), drawn into in place.
            projection: the camera.
            scene_s: scene time.
            distance: of the jumper from the camera, m; None: nobody jumps.
        """
        for tower in self._towers:
            if not surroundings.in_front(tower, projection):
                _tower(image, tower, projection)
        _draw_trees(image, _far_first(self._trees, projection), projection, scene_s)
        for flag in _far_first(self._flags, projection):
            _flag(image, flag, projection, scene_s)
        self._people(image, projection, scene_s, distance, near=False)

    def draw_in_front(self, image: Image, projection: Projection, scene_s: float, distance: float | None) -> None:
        """Draw what is in front of the jumper; arguments as in `draw_behind`."""
        self._people(image, projection, scene_s, distance, near=True)
        for tower in self._towers:
            if surroundings.in_front(tower, projection):
                _tower(image, tower, projection)

    def _people(
        self, image: Image, projection: Projection, scene_s: float, distance: float | None, *, near: bool
    ) -> None:
        parts: list[Part] = []
        for walker in self._walkers:
            if not surroundings.seen(walker, projection, scene_s):
                continue
            nearer = distance is not None and float(projection.distance(walker.feet(scene_s))) < distance
            if nearer == near:
                parts += walker.parts(scene_s)
        for part, (a, b), radii in zip(parts, *outlines(parts, projection), strict=True):
            stroke(image, a, b, float(radii[0]), float(radii[1]), part.radiance)


def _far_first(things: Iterable[Swaying], projection: Projection) -> list[Swaying]:
    seen = [(float(projection.distance(thing.foot)), k, thing) for k, thing in enumerate(things)]
    return [thing for distance, _, thing in sorted(seen, reverse=True) if distance > _NEAREST_M]


def _draw_trees(image: Image, trees: list[Swaying], projection: Projection, scene_s: float) -> None:
    """All trees, far ones first; all at once, since there are many."""
    if not trees:
        return
    right = projection.R[:, 0]
    pixels = projection.pixels(np.concatenate([_spruce(tree, right, scene_s) for tree in trees]))
    for k, corners in enumerate(pixels):
        cut(image, corners, trees[k // (2 * _TIERS)].radiance + (34.0 if k % 2 else 0.0))


def _spruce(tree: Swaying, right: Floats, scene_s: float) -> Floats:
    """Tiers of triangles that face the camera, each with snow on one flank; shape (2 * tiers, 3, 3).

    The tree bends more towards its top.
    """
    bend = _TREE_SWAY * tree.tall * tree.sway(scene_s)
    wide = 0.19 * tree.tall * (1 - 0.2 * _TIER)
    aside = np.stack(
        (bend * _LOW**2 - wide, bend * _LOW**2 + wide, bend * _HIGH**2,
         bend * _LOW**2 - wide, bend * _LOW**2 - 0.35 * wide, bend * _HIGH**2), axis=1,
    )  # fmt: skip
    height = tree.tall * np.stack((_LOW, _LOW, _HIGH, _LOW, _LOW, _HIGH), axis=1)
    corners = tree.foot + aside[..., None] * right + height[..., None] * np.array((0.0, 0.0, 1.0))
    return np.asarray(corners.reshape(-1, 3, 3))


def _flag(image: Image, flag: Swaying, projection: Projection, scene_s: float) -> None:
    """A pole, and a cloth of upright pieces that a wave runs along."""
    long, high = _CLOTH_M
    top = flag.foot + np.array((0, 0, flag.tall))
    u = np.linspace(0, 1, _CLOTH + 1)
    wave = 0.12 * u * np.sin(flag.rate * scene_s + flag.phase - 5 * u)
    upper = top + np.stack((long * u, wave, -0.15 * u + 0.5 * wave), axis=1)
    pixels = projection.pixels(np.concatenate((upper, upper - np.array((0, 0, high)), [top, flag.foot])))
    pole, cloth = pixels[-2:], pixels[:-2].reshape(2, -1, 2)
    width = 0.04 * projection.c / float(projection.distance(flag.foot))
    stroke(image, pole[0], pole[1], width, width, _POLE)
    for k in range(_CLOTH):
        fold = 1 + 2.0 * float(wave[k + 1] - wave[k])
        quad = (cloth[0, k], cloth[0, k + 1], cloth[1, k + 1], cloth[1, k])
        fill(image, quad, min(225.0, max(0.0, flag.radiance * fold)))


def _tower(image: Image, tower: Tower, projection: Projection) -> None:
    """The faces that look towards the camera, with a row of windows in the upper part of the upright ones."""
    corners = surroundings.corners(tower)
    if float(projection.distance(corners).min()) < _NEAREST_M:
        return
    middle = corners.mean(axis=0)
    for indices, light in _FACES:
        face = corners[list(indices)]
        if (face.mean(axis=0) - middle) @ (projection.X0 - face.mean(axis=0)) <= 0:
            continue
        fill(image, projection.pixels(face), min(225.0, tower.radiance * light))
        if light <= 1:
            fill(image, projection.pixels(_window(face)), _WINDOW)


def _window(face: Floats) -> Floats:
    """The window of a face whose corners are foot, foot, top, top."""
    a, b, c, d = face
    return np.stack([p + s * (q - p) + h * ((t + s * (u - t)) - (p + s * (q - p))) for p, q, t, u, s, h in (
        (a, b, d, c, 0.12, 0.7), (a, b, d, c, 0.88, 0.7), (a, b, d, c, 0.88, 0.88), (a, b, d, c, 0.12, 0.88),
    )])  # fmt: skip
