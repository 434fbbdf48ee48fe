"""The pixels of all cameras that say something about a pair of skis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.candidates.foreground.background import Background, Region
from analysis.scene.camera_system import PlacedCamera
from analysis.ski_bars.bars import SKIS, Poses
from rig.arrays import Flags, Floats, Integers
from rig.images.picture import Grey

#: Px beside and beyond a ski that are looked at.
REACH_PX: Final = 4.0


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """n pixels.

    Attributes:
        camera: (n,) index of the camera.
        xy: (n, 2) px.
        grey: (n,) grey value.
        behind: (n,) what the static scene shows there.
        noise: (n,) variance of the grey value against the static scene.
    """

    camera: Integers
    xy: Floats
    grey: Floats
    behind: Floats
    noise: Floats

    def some(self, chosen: Flags) -> "Pixels":
        """Those that are chosen."""
        return Pixels(*(getattr(self, name)[chosen] for name in ("camera", "xy", "grey", "behind", "noise")))


@dataclass(frozen=True, slots=True, eq=False)
class SkiView:
    """A camera and what it shows of a pulse.

    Attributes:
        camera: oriented.
        image: (rows, columns).
        background: the static scene.
        shift: (3,) how much farther the skis were when it saw them than at the instant of the result, m.
    """

    camera: PlacedCamera
    image: Grey
    background: Background
    shift: Floats


def pixels_around(views: Sequence[SkiView], poses: Poses, ends: Floats, reach_m: float) -> Pixels:
    """The pixels around both skis.

    Args:
        views: images of one pulse.
        poses: about where the skis are.
        ends: (2, 2) from where to where they reach, m from the binding.
        reach_m: how far beside that they may be, m.
    """
    parts: dict[str, list[Floats]] = {name: [] for name in ("camera", "xy", "grey", "behind", "noise")}
    for c, view in enumerate(views):
        places = poses.point[:, None] + ends[..., None] * poses.direction[:, None] + view.shift
        px = view.camera.project(places)
        if not np.isfinite(px).all():
            continue
        scale = float(view.camera.camera.interior[0] / np.linalg.norm(poses.point.mean(axis=0) - view.camera.position))
        reach = REACH_PX + reach_m * scale
        low = np.maximum(np.floor(px.min(axis=(0, 1)) - reach), 0).astype(int)
        high = np.minimum(np.ceil(px.max(axis=(0, 1)) + reach) + 1, view.camera.size).astype(int)
        if (high - low <= 1).any():
            continue
        region = view.background.part(view.image, (int(low[0]), int(low[1]), int(high[0]), int(high[1])))
        xy = _places(region)
        near = np.zeros(len(xy), bool)
        for k in range(SKIS):
            near |= _distance(xy, px[k]) < reach
        parts["camera"].append(np.full(int(near.sum()), c))
        parts["xy"].append(xy[near])
        for name, layer in (("grey", region.grey), ("behind", region.behind), ("noise", region.sigma**2)):
            parts[name].append(layer.ravel()[near].astype(float))
    joined: Mapping[str, Floats] = {
        name: np.concatenate(part) if part else np.zeros((0, 2) if name == "xy" else 0) for name, part in parts.items()
    }
    return Pixels(joined["camera"].astype(np.intp), *(joined[name] for name in ("xy", "grey", "behind", "noise")))


def _places(region: Region) -> Floats:
    y, x = np.mgrid[: region.grey.shape[0], : region.grey.shape[1]]
    return np.column_stack((x.ravel() + region.x, y.ravel() + region.y)).astype(float)


def _distance(xy: Floats, ends: Floats) -> Floats:
    """From places (n, 2) to the straight piece between two ends (2, 2), px."""
    step = ends[1] - ends[0]
    t = np.clip((xy - ends[0]) @ step / max(float(step @ step), 1e-9), 0, 1)
    return np.asarray(np.linalg.norm(xy - ends[0] - t[:, None] * step, axis=1))
