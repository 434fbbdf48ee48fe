"""A pair of skis as bars in space: where they lie, how they are shaped, and how they are expected to lie.

The axis of a ski is bent,

    X(s) = P + s d + bend ((s / 1.1 m)^2 - 1/3) n,

with the place P of its binding, the unit direction d from tail to tip, and the normal n of d in the vertical plane
through it. Over the 2.2 m around the binding the bend is zero in the mean, so that P and d are the line that fits the
ski best. It visibly ends at s = tail and s = tip.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from rig.arrays import Floats

#: Unknowns of the place of a ski: shifts of the binding along X, Y, Z, turns of the direction to both axes across it.
OF_POSE: Final = 5
#: Unknowns of the shape of a ski: bend, tail, tip, m.
OF_SHAPE: Final = 3
SKIS: Final = 2
_HALF_M: Final = 1.1


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """Where both skis lie.

    Attributes:
        point: (2, 3) places of the bindings on the axes, m.
        direction: (2, 3) unit vectors from tail to tip.
    """

    point: Floats
    direction: Floats

    def axes(self) -> tuple[Floats, Floats]:
        """Unit vectors (2, 3) across both skis: to the side, and in the vertical plane."""
        upright = np.abs(self.direction[:, 2:]) > np.sqrt(0.5)
        reference = np.where(upright, np.array((1.0, 0.0, 0.0)), np.array((0.0, 0.0, 1.0)))
        aside = _unit(np.cross(self.direction, reference))
        return aside, np.cross(aside, self.direction)

    def moved(self, step: Floats, axes: tuple[Floats, Floats] | None = None) -> "Poses":
        """With both skis shifted and turned by `step` (2, 5); `axes` are those of these poses, if they are known."""
        aside, normal = axes or self.axes()
        turned = self.direction + step[:, 3:4] * aside + step[:, 4:5] * normal
        return Poses(self.point + step[:, :3], _unit(turned))

    def step_to(self, other: "Poses") -> Floats:
        """The step (2, 5) that leads to other poses."""
        aside, normal = self.axes()
        along = (other.direction * self.direction).sum(axis=1)
        turns = [(other.direction * axis).sum(axis=1) / along for axis in (aside, normal)]
        return np.column_stack((other.point - self.point, *turns))


@dataclass(frozen=True, slots=True, eq=False)
class ExpectedBars:
    """What is known of a pair of skis before they are fitted.

    Attributes:
        poses: where they should be.
        covariance: (10, 10) of the step from there, of the right ski, then of the left one; m, rad.
        shape: (2, 3) bend, tail and tip, m.
        shape_sigma: (2, 3) their standard deviations, m.
    """

    poses: Poses
    covariance: Floats
    shape: Floats
    shape_sigma: Floats


#: What is known of every ski: bend, tail and tip, m, and their standard deviations.
USUAL_SHAPE: Final = (0.0, -1.15, 1.35)
USUAL_SHAPE_SIGMA: Final = (0.01, 0.15, 0.15)


def axis_points(poses: Poses, bend: Floats, s: Floats, axes: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
    """Places on the axes of both skis, and what moves them.

    Args:
        poses: of the skis.
        bend: (2,) m.
        s: (k,) m from the binding.
        axes: across the skis, as `Poses.axes` gives them.

    Returns:
        Places (2, k, 3), and their derivatives (2, k, 3, 6) by the five unknowns of the pose and the bend.
    """
    aside, normal = axes
    bent = (s / _HALF_M) ** 2 - 1 / 3
    places = (
        poses.point[:, None]
        + s[:, None] * poses.direction[:, None]
        + (bend[:, None] * bent)[..., None] * normal[:, None]
    )
    by = np.zeros((SKIS, len(s), 3, OF_POSE + 1))
    by[..., :3] = np.eye(3)
    by[..., 3] = s[:, None] * aside[:, None]
    by[..., 4] = s[:, None] * normal[:, None] - (bend[:, None] * bent)[..., None] * poses.direction[:, None]
    by[..., 5] = bent[:, None] * normal[:, None]
    return places, by


def _unit(vector: Floats) -> Floats:
    return np.asarray(vector / np.linalg.norm(vector, axis=-1, keepdims=True))
