"""Draws the jumper: shaded capsules for the limbs, thin ones for the skis, markers on patches.

Without occlusion, patches and markers are drawn last, so that no limb hides one and every marker can be measured in
every camera. With occlusion, everything is drawn from far to near (`simrig.world.figure.body`). The patches are large
enough for a uniform local background.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Floats
from simrig.images.scene.drawing import Blob, Image, stroke
from simrig.world.figure import body
from simrig.world.figure.body import BOOT, FACE, GLOVE, SKI_RADIUS_M, Part
from simrig.world.jumper import Pose
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

Pixels = Floats  #: x, y in px, shape (..., 2)
Worn = tuple[bool, bool, bool, bool]  #: which of P1..P4 the jumper wears

ALL_WORN: Worn = (True, True, True, True)
_PATCH_MARGIN_PX = 2.6  #: width of the patch around the image of a marker; its border fades over half of that
_PATCH_RADIUS_M = 0.16
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
        scenario: gives the sizes and radiances of body, skis and markers, and the blur.
        projection: projection of that camera as it was set up.
        black: grey value of radiance 0.
        gain: grey values per radiance.
    """

    def __init__(self, scenario: Scenario, projection: Projection, black: float, gain: float) -> None:
        self._jumper = scenario.jumper
        self._half_ski_m = scenario.jumper.ski_length_m / 2
        self._black, self._gain = black, gain
        self._middle_m = float(projection.distance((10.0, 0.0, -1.8)))
        px_per_m = projection.c / self._middle_m
        self._marker = Blob(scenario.jumper.marker_radius_m * px_per_m, scenario.image.blur_sigma_px)

    def draw(
        self, poses: Sequence[Pose], projection: Projection, backdrop: NDArray[Any], worn: Worn = ALL_WORN
    ) -> tuple[slice, slice, Image] | None:
        """Draw the average of some poses.

        Args:
            poses: one or more.
            projection: of the camera at that time.
            backdrop: the image without the jumper, in grey values, shape (h, w).
            worn: the markers that are there.

        Returns:
            Rows and columns of the image that change, and their grey values without noise; None if out of sight.
        """
        figures = np.stack([body.joints(pose, self._half_ski_m) for pose in poses])
        if float(projection.distance(figures).min()) < _NEAREST_M:
            return None
        pixels = projection.pixels(figures)
        px_per_m = projection.c / float(projection.distance(poses[0].origin))
        box = self._box(pixels.reshape(-1, 2), _PADDING_M * px_per_m, projection)
        if box is None:
            return None
        rows, columns = box
        pixels -= (columns.start, rows.start)
        behind = backdrop[rows, columns].astype(np.float32)
        if len(poses) == 1:
            self._draw_one(behind, poses[0], figures[0], pixels[0], projection, worn)
            return rows, columns, behind
        total = np.zeros_like(behind)
        for pose, points, places in zip(poses, figures, pixels, strict=True):
            sprite = behind.copy()
            self._draw_one(sprite, pose, points, places, projection, worn)
            total += sprite
        total /= len(poses)
        return rows, columns, total

    def _draw_one(
        self, sprite: Image, pose: Pose, points: Floats, pixels: Pixels, projection: Projection, worn: Worn
    ) -> None:
        px_per_m = projection.c / float(projection.distance(pose.origin))
        if self._jumper.occlusion or projection.lens is not None:
            corner = projection.pixels(points[0]) - pixels[0]
            self._draw_in_order(sprite, pose, points, corner, projection, worn)
        else:
            self._draw_person(sprite, pose, pixels, px_per_m, projection)
        if not self._jumper.occlusion:
            self._draw_markers(sprite, pose, pixels[:4], px_per_m, projection, worn)

    def _draw_in_order(
        self, sprite: Image, pose: Pose, points: Floats, corner: Pixels, projection: Projection, worn: Worn
    ) -> None:
        """Everything from far to near; `corner` is the sprite's place in the image, (x, y)."""
        near = int(np.argmin(projection.distance(pose.markers[2:])))
        spots = projection.pixels(pose.markers) - corner
        scales = self._middle_m / projection.distance(pose.markers)
        px_per_m = projection.c / float(projection.distance(pose.origin))
        order = body.in_order(body.parts(points, self._jumper, near), pose.markers, projection)
        shapes = [thing.part for thing in order if thing.part is not None]
        images = zip(shapes, *body.outlines(shapes, projection), strict=True)
        for thing in order:
            if thing.part is not None:
                part, ends, radii = next(images)
                self._draw_part(sprite, part, ends - corner, radii.tolist())
            elif self._jumper.occlusion and worn[thing.marker]:
                self._draw_marker(sprite, spots, thing.marker, float(scales[thing.marker]), px_per_m)

    def _draw_part(self, sprite: Image, part: Part, ends: Pixels, radii: list[float]) -> None:
        a, b = ends
        ra, rb = radii
        stroke(sprite, a, b, ra, rb, self._grey(part.radiance))
        if part.lit:
            up, light = np.array((0.0, -0.35)), self._grey(body.stripe(part.radiance))
            stroke(sprite, a + up * ra, b + up * rb, 0.45 * ra, 0.45 * rb, light)

    def _draw_marker(self, sprite: Image, spots: Pixels, i: int, scale: float, px_per_m: float) -> None:
        """A marker on its patch, which ends before it reaches another marker."""
        x, y = spots[i]
        reach = self._marker.reach_px * scale
        others = min(math.dist(spots[i], spot) for k, spot in enumerate(spots) if k != i)
        patch = max(_PATCH_RADIUS_M * px_per_m, reach + _PATCH_MARGIN_PX)
        patch = min(patch, max(reach / 2, others - reach))
        self._disc(sprite, spots[i], patch, self._jumper.patch)
        self._marker.draw(sprite, x, y, self._grey(self._jumper.marker), scale)

    def _draw_person(self, sprite: Image, pose: Pose, pixels: Pixels, px_per_m: float, projection: Projection) -> None:
        """Skis and limbs from far to near; the skis hide the body if they are seen from below."""
        far, near = sorted((0, 1), key=lambda i: -float(projection.distance(pose.markers[2 + i])))
        sides = _side(pixels, far), _side(pixels, near)
        from_below = pose.axes[2] @ (projection.X0 - pose.origin) < 0
        if from_below:
            self._draw_body(sprite, pixels, *sides, px_per_m)
        thick = SKI_RADIUS_M * px_per_m
        for side in sides:
            stroke(sprite, side.tail, side.tip, thick, thick, self._grey(self._jumper.skis))
        if not from_below:
            self._draw_body(sprite, pixels, *sides, px_per_m)

    def _draw_body(self, sprite: Image, pixels: Pixels, far: _Side, near: _Side, px_per_m: float) -> None:
        helmet, hip, neck = pixels[0], pixels[1], pixels[4]
        self._draw_limbs(sprite, far, px_per_m, 0.8)
        self._limb(sprite, hip, neck, (0.15, 0.19), px_per_m, 1.0)
        stroke(sprite, neck, helmet, 0.06 * px_per_m, 0.08 * px_per_m, self._grey(FACE))
        self._disc(sprite, helmet, 0.145 * px_per_m, self._jumper.patch)
        self._draw_limbs(sprite, near, px_per_m, 1.0)

    def _draw_limbs(self, sprite: Image, side: _Side, px_per_m: float, light: float) -> None:
        self._limb(sprite, side.ankle, side.knee, (0.07, 0.085), px_per_m, light)
        self._limb(sprite, side.knee, side.hip, (0.085, 0.12), px_per_m, light)
        self._disc(sprite, side.ankle, 0.09 * px_per_m, BOOT)
        self._limb(sprite, side.shoulder, side.hand, (0.075, 0.05), px_per_m, light)
        self._disc(sprite, side.hand, 0.06 * px_per_m, GLOVE)

    def _limb(
        self, sprite: Image, a: Pixels, b: Pixels, radii_m: tuple[float, float], px_per_m: float, light: float
    ) -> None:
        """A capsule with a lighter stripe where the sky lights it."""
        ra, rb = radii_m[0] * px_per_m, radii_m[1] * px_per_m
        stroke(sprite, a, b, ra, rb, self._grey(self._jumper.suit * light))
        up = np.array((0.0, -0.35))
        stroke(
            sprite, a + up * ra, b + up * rb, 0.45 * ra, 0.45 * rb, self._grey(body.stripe(self._jumper.suit * light))
        )

    def _disc(self, sprite: Image, centre: Pixels, radius: float, radiance: float) -> None:
        stroke(sprite, centre, centre, radius, radius, self._grey(radiance))

    def _draw_markers(
        self, sprite: Image, pose: Pose, markers: Pixels, px_per_m: float, projection: Projection, worn: Worn
    ) -> None:
        """Draw all patches first, so that none covers the marker of another."""
        scales = self._middle_m / projection.distance(pose.markers)
        there = [(*place, float(scale)) for place, scale, on in zip(markers, scales, worn, strict=True) if on]
        for x, y, scale in there:
            patch = max(_PATCH_RADIUS_M * px_per_m, self._marker.reach_px * scale + _PATCH_MARGIN_PX)
            self._disc(sprite, np.array((x, y)), patch, self._jumper.patch)
        for x, y, scale in there:
            self._marker.draw(sprite, x, y, self._grey(self._jumper.marker), scale)

    def _box(self, pixels: Pixels, padding: float, projection: Projection) -> tuple[slice, slice] | None:
        """Rows and columns of the image that the figure may touch; None if there are none."""
        padding += self._marker.reach_px + 2 * _PATCH_MARGIN_PX
        left, top = (max(0, math.floor(v)) for v in pixels.min(axis=0) - padding)
        right, bottom = (math.ceil(v) for v in pixels.max(axis=0) + padding)
        right, bottom = min(projection.width, right + 1), min(projection.height, bottom + 1)
        if left >= right or top >= bottom:
            return None
        return slice(top, bottom), slice(left, right)

    def _grey(self, radiance: float) -> float:
        return self._black + self._gain * radiance


def _side(pixels: Pixels, i: int) -> _Side:
    """Half `i` (0 right, 1 left) of the projected joints."""
    return _Side(*pixels[5 + 7 * i : 12 + 7 * i])
