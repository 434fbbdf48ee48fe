"""The pixels of all cameras that say something about a pair of skis."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import cv2
import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.scene.camera_system import PlacedCamera
from analysis.ski_bars.bars import SKIS, Poses
from rig.arrays import Flags, Floats, Integers, Reals

#: Px beside and beyond a ski that are looked at.
REACH_PX: Final = 4.0
#: Px along a ski that are taken together: the errors of the model are alike over more.
CELL_PX: Final = 2
#: Half the width of a leg at the foot, and at the hip with what the marker there lies beside its axis, m.
_LEG_M: Final = (0.07, 0.15)


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """n pixels.

    Attributes:
        camera: (n,) index of the camera, ascending.
        xy: (n, 2) px.
        grey: (n,) grey value.
        behind: (n,) what the static scene shows there.
        noise: (n,) variance of the grey value against the static scene.
    """

    camera: Integers
    xy: Floats
    grey: Reals
    behind: Reals
    noise: Reals

    def of_cameras(self, count: int) -> list[slice]:
        """Those of each of so many cameras."""
        ends = np.searchsorted(self.camera, np.arange(count + 1)).tolist()
        return [slice(first, last) for first, last in pairwise(ends)]


@dataclass(frozen=True, slots=True, eq=False)
class Legs:
    """n legs, each about straight. In one image a leg looks like a ski.

    Attributes:
        ends: (n, 2, 3) foot and hip, m.
        sigma: (n, 2) standard deviations of these, m.
    """

    ends: Floats = field(default_factory=lambda: np.zeros((0, 2, 3)))
    sigma: Floats = field(default_factory=lambda: np.zeros((0, 2)))


@dataclass(frozen=True, slots=True, eq=False)
class SkiView:
    """A camera and what it shows of a pulse.

    Attributes:
        camera: oriented.
        part: of the image, before the static scene, from its first column and row to behind its last ones; None where
            the image does not reach.
        shift: (3,) how much farther the skis were when it saw them than at the instant of the result, m.
        legs: as far as feet and hip are known.
    """

    camera: PlacedCamera
    part: Callable[[Integers, Integers], Region | None]
    shift: Floats
    legs: Legs = field(default_factory=Legs)

    def on_legs(self, x: Reals, y: Reals) -> Flags:
        """Which places (...) in the image may show a leg."""
        there = np.zeros(x.shape, bool)
        for leg, half_m in zip(self.legs.ends + self.shift, np.hypot(_LEG_M, self.legs.sigma), strict=True):
            px = self.camera.project(leg)
            if np.isfinite(px).all():
                scale = self.camera.camera.interior[0] / np.linalg.norm(leg - self.camera.position, axis=1)
                along, away = _on_piece(x, y, px)
                foot, hip = (half_m * scale).tolist()
                along *= hip - foot
                along += foot
                there |= away < along
        return there


def pixels_around(views: Sequence[SkiView], poses: Poses, ends: Floats, reach_m: float) -> Pixels:
    """The pixels around both skis, `CELL_PX` of them along a ski as one; each counts with the ski that is nearer.

    Args:
        views: images of one pulse.
        poses: about where the skis are.
        ends: (2, 2) from where to where they reach, m from the binding.
        reach_m: how far beside that they may be, m.
    """
    parts = []
    for c, view in enumerate(views):
        places = poses.point[:, None] + ends[..., None] * poses.direction[:, None] + view.shift
        px = view.camera.project(places)
        if not np.isfinite(px).all():
            continue
        scale = float(view.camera.camera.interior[0] / np.linalg.norm(poses.point.mean(axis=0) - view.camera.position))
        reach = REACH_PX + reach_m * scale
        low = np.floor(px.min(axis=(0, 1)) - reach).astype(int)
        region = view.part(low, np.ceil(px.max(axis=(0, 1)) + reach).astype(int) + 1)
        if region is not None:
            parts += [cells for k in range(SKIS) if len((cells := _cells(view, region, px, k, reach, c))[0])]
    if not parts:
        return Pixels(np.zeros(0, np.intp), np.zeros((0, 2)), *np.zeros((3, 0), np.float32))
    camera, xy, grey, behind, noise = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Pixels(camera.astype(np.intp), xy, grey, behind, noise)


def _cells(view: SkiView, region: Region, px: Floats, k: int, reach: float, camera: int) -> tuple[Floats, ...]:
    """Camera, places, grey values, scene and noise of the cells of ski k, whose ends are at px (2, 2, 2)."""
    way = px[k, 1] - px[k, 0]
    length = float(np.hypot(*way))
    along = way / max(length, 1e-9)
    t = np.arange(-reach, length + reach, CELL_PX) + (CELL_PX - 1) / 2
    u = np.arange(-np.floor(reach), np.floor(reach) + 1)
    xy = (px[k, 0] + t[:, None, None] * along + u[:, None] * np.array((-along[1], along[0]))).reshape(-1, 2)
    last = np.array(region.grey.shape[::-1]) - 1
    within = xy - (region.x, region.y)
    xy = xy[((within >= 1) & (within <= last - 1)).all(axis=1)]
    xy = xy[to_piece(xy[:, 0], xy[:, 1], px[k]) <= to_piece(xy[:, 0], xy[:, 1], px[1 - k])]
    xy = xy[~view.on_legs(xy[:, 0], xy[:, 1])]
    if not len(xy):
        return np.zeros(0), xy, *np.zeros((3, 0))
    steps = np.arange(CELL_PX) - (CELL_PX - 1) / 2
    each = (xy[:, None] + steps[:, None] * along - (region.x, region.y)).astype(np.float32)
    grey, behind, sigma = (
        cv2.remap(layer, each[..., 0], each[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE).mean(axis=1)
        for layer in (region.grey, region.behind, region.sigma)
    )
    return np.full(len(xy), camera), xy, grey, behind, sigma**2 / CELL_PX


def to_piece(x: Reals, y: Reals, ends: Floats) -> Reals:
    """From places (...) to the straight piece between two ends (2, 2), px."""
    return _on_piece(x, y, ends)[1]


def _on_piece(x: Reals, y: Reals, ends: Floats) -> tuple[Reals, Reals]:
    """How far along a straight piece its nearest point to places (...) is, 0 to 1, and how far that is, px."""
    (first_x, first_y), (step_x, step_y) = ends[0].tolist(), (ends[1] - ends[0]).tolist()
    square = max(step_x**2 + step_y**2, 1e-9)
    off_x, off_y = x - first_x, y - first_y
    t = off_x * (step_x / square)
    t += off_y * (step_y / square)
    np.clip(t, 0, 1, out=t)
    off_x -= t * step_x
    off_y -= t * step_y
    off_x *= off_x
    off_x += off_y * off_y
    return t, np.sqrt(off_x, out=off_x)
