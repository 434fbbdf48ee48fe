"""Draws the jumper: shaded capsules for the limbs, thin ones for the skis, bright markers on dark patches.

Patches and markers are drawn last, so that no limb hides one and every marker can be measured in every camera. The
patches are large enough for a uniform local background.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Floats
from simrig.images.drawing import Blob, Image, stroke
from simrig.world.jumper import Pose
from simrig.world.projection import Projection
from simrig.world.scenario import BRIGHTEST, Scenario, SceneCamera

Pixels = Floats  #: x, y in px, shape (..., 2)

PATCH = 34.0  #: radiance of the dark patches below the markers
_SUIT, _SUIT_LIGHT, _BOOT, _GLOVE, _FACE = 44.0, 66.0, 38.0, 120.0, 150.0
_SKI = 222.0
_SKI_RADIUS_M = 0.04  #: a ski is a thin capsule, whose middle line is the ski line in every view
_PATCH_MARGIN_PX = 2.6  #: width of the patch around the image of a marker; its border fades over half of that
_PATCH_RADIUS_M = 0.16
_THIGH_M = _SHANK_M = 0.45
_HIP_ASIDE_M, _SHOULDER_ASIDE_M, _HAND_ASIDE_M = 0.11, 0.19, 0.3
_ANKLE_UP_M = 0.1
_PADDING_M = 0.3
_NEAREST_M = 1.0  #: nothing nearer than this is drawn


@dataclass(frozen=True, slots=True)
class _Side:
    """Ski and joints of one half of the body, px, shape (2,) each."""

    tip: Pixels
    tail: Pixels
    ankle: Pixels
    knee: Pixels
    hip: Pixels
    shoulder: Pixels
    hand: Pixels


class Figure:
    """Draws poses as one camera sees them.

    Args:
        scenario: gives length of the skis, radius of the markers, blur and black level.
        camera: gives the gain.
        projection: projection of that camera.
        clean: the image without jumper and noise, grey values, shape (h, w).
    """

    def __init__(
        self, scenario: Scenario, camera: SceneCamera, projection: Projection, clean: NDArray[np.uint8]
    ) -> None:
        self._projection = projection
        self._clean = clean
        self._half_ski_m = scenario.jumper.ski_length_m / 2
        self._black, self._gain = scenario.image.black_level, camera.gain
        self._middle_m = float(projection.distance((10.0, 0.0, -1.8)))
        px_per_m = projection.c / self._middle_m
        self._marker = Blob(scenario.jumper.marker_radius_m * px_per_m, scenario.image.blur_sigma_px)

    def draw(self, pose: Pose) -> tuple[slice, slice, Image] | None:
        """Draw a pose.

        Returns:
            Rows and columns of the image that change, and their grey values without noise; None if out of sight.
        """
        joints = _joints(pose, self._half_ski_m)
        if float(self._projection.distance(joints).min()) < _NEAREST_M:
            return None
        pixels = self._projection.pixels(joints)
        px_per_m = self._projection.c / float(self._projection.distance(pose.origin))
        box = self._box(pixels, _PADDING_M * px_per_m)
        if box is None:
            return None
        rows, columns = box
        sprite = self._clean[rows, columns].astype(np.float32)
        pixels -= (columns.start, rows.start)
        self._draw_person(sprite, pose, pixels, px_per_m)
        self._draw_markers(sprite, pose, pixels[:4], px_per_m)
        return rows, columns, sprite

    def _draw_person(self, sprite: Image, pose: Pose, pixels: Pixels, px_per_m: float) -> None:
        """Skis and limbs from far to near; the skis hide the body if they are seen from below."""
        far, near = sorted((0, 1), key=lambda i: -float(self._projection.distance(pose.markers[2 + i])))
        sides = _side(pixels, far), _side(pixels, near)
        from_below = pose.axes[2] @ (self._projection.X0 - pose.origin) < 0
        if from_below:
            self._draw_body(sprite, pixels, *sides, px_per_m)
        thick = _SKI_RADIUS_M * px_per_m
        for side in sides:
            stroke(sprite, side.tail, side.tip, thick, thick, self._grey(_SKI))
        if not from_below:
            self._draw_body(sprite, pixels, *sides, px_per_m)

    def _draw_body(self, sprite: Image, pixels: Pixels, far: _Side, near: _Side, px_per_m: float) -> None:
        helmet, hip, neck = pixels[0], pixels[1], pixels[4]
        self._draw_limbs(sprite, far, px_per_m, 0.8)
        self._limb(sprite, hip, neck, (0.15, 0.19), px_per_m, 1.0)
        stroke(sprite, neck, helmet, 0.06 * px_per_m, 0.08 * px_per_m, self._grey(_FACE))
        self._disc(sprite, helmet, 0.145 * px_per_m, PATCH)
        self._draw_limbs(sprite, near, px_per_m, 1.0)

    def _draw_limbs(self, sprite: Image, side: _Side, px_per_m: float, light: float) -> None:
        self._limb(sprite, side.ankle, side.knee, (0.07, 0.085), px_per_m, light)
        self._limb(sprite, side.knee, side.hip, (0.085, 0.12), px_per_m, light)
        self._disc(sprite, side.ankle, 0.09 * px_per_m, _BOOT)
        self._limb(sprite, side.shoulder, side.hand, (0.075, 0.05), px_per_m, light)
        self._disc(sprite, side.hand, 0.06 * px_per_m, _GLOVE)

    def _limb(
        self, sprite: Image, a: Pixels, b: Pixels, radii_m: tuple[float, float], px_per_m: float, light: float
    ) -> None:
        """A capsule with a lighter stripe where the sky lights it."""
        ra, rb = radii_m[0] * px_per_m, radii_m[1] * px_per_m
        stroke(sprite, a, b, ra, rb, self._grey(_SUIT * light))
        up = np.array((0.0, -0.35))
        stroke(sprite, a + up * ra, b + up * rb, 0.45 * ra, 0.45 * rb, self._grey(_SUIT_LIGHT * light))

    def _disc(self, sprite: Image, centre: Pixels, radius: float, radiance: float) -> None:
        stroke(sprite, centre, centre, radius, radius, self._grey(radiance))

    def _draw_markers(self, sprite: Image, pose: Pose, markers: Pixels, px_per_m: float) -> None:
        """Draw all patches first, so that none covers the marker of another."""
        scales = self._middle_m / self._projection.distance(pose.markers)
        for marker, scale in zip(markers, scales, strict=True):
            patch = max(_PATCH_RADIUS_M * px_per_m, self._marker.reach_px * float(scale) + _PATCH_MARGIN_PX)
            self._disc(sprite, marker, patch, PATCH)
        for (x, y), scale in zip(markers, scales, strict=True):
            self._marker.draw(sprite, x, y, self._grey(BRIGHTEST), float(scale))

    def _box(self, pixels: Pixels, padding: float) -> tuple[slice, slice] | None:
        """Rows and columns of the image that the figure may touch; None if there are none."""
        padding += self._marker.reach_px + 2 * _PATCH_MARGIN_PX
        left, top = (max(0, math.floor(v)) for v in pixels.min(axis=0) - padding)
        right, bottom = (math.ceil(v) for v in pixels.max(axis=0) + padding)
        right, bottom = min(self._projection.width, right + 1), min(self._projection.height, bottom + 1)
        if left >= right or top >= bottom:
            return None
        return slice(top, bottom), slice(left, right)

    def _grey(self, radiance: float) -> float:
        return self._black + self._gain * radiance


def _side(pixels: Pixels, i: int) -> _Side:
    """Half `i` (0 right, 1 left) of the projected joints."""
    return _Side(*pixels[5 + 7 * i : 12 + 7 * i])


def _joints(pose: Pose, half_ski_m: float) -> Floats:
    """All points of the figure, m, shape (19, 3).

    P1..P4, neck, then for the right and for the left half: tip and tail of the ski, ankle, knee, hip, shoulder, hand.
    """
    helmet, hip = pose.markers[0], pose.markers[1]
    forward, side, up = pose.axes
    trunk = helmet - hip
    neck = hip + 0.76 * trunk
    points = [*pose.markers, neck]
    for i, outward in ((0, -side), (1, side)):
        middle, along = pose.markers[2 + i], pose.skis[i]
        ankle = middle + _ANKLE_UP_M * up
        thigh = hip + _HIP_ASIDE_M * outward
        hand = hip + _HAND_ASIDE_M * outward - 0.12 * trunk + 0.02 * up
        points += [middle + half_ski_m * along, middle - half_ski_m * along]
        points += [ankle, _knee(ankle, thigh, forward), thigh, neck + _SHOULDER_ASIDE_M * outward, hand]
    return np.stack(points)


def _knee(ankle: Floats, hip: Floats, forward: Floats) -> Floats:
    """Knee between ankle and hip; it bends forward as far as the lengths of shank and thigh ask."""
    leg = hip - ankle
    length = math.sqrt(leg @ leg)
    aside = forward - (forward @ leg) / length**2 * leg
    bend = math.sqrt(max(0.0, _SHANK_M * _THIGH_M - (length / 2) ** 2))
    return np.asarray(ankle + leg / 2 + bend * aside / math.sqrt(aside @ aside))
