"""Spatial similarity transformation (7 parameters) and its least-squares fit to common points, in closed form.

The fit minimises the residuals in the target system: the rotation comes from the singular value decomposition of the
moment matrix, then follow scale and translation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.geometry.rotation import nearest_rotation
from rig.arrays import Floats
from rig.errors import BadInputError

_COLLINEAR = 1e-6  # second to first extent of the points


@dataclass(frozen=True, slots=True)
class Similarity:
    """target = scale * rotation @ source + translation.

    Attributes:
        scale: positive.
        rotation: (3, 3), proper.
        translation: (3,) target unit.
    """

    scale: float
    rotation: Floats
    translation: Floats

    def apply(self, points: ArrayLike) -> Floats:
        """Points (..., 3) in the target system."""
        return np.asarray(self.scale * (np.asarray(points, float) @ self.rotation.T) + self.translation)

    def turn(self, rotations: ArrayLike) -> Floats:
        """Camera rotations (..., 3, 3), columns r1, r2, r3, in the target system."""
        return np.asarray(self.rotation @ np.asarray(rotations, float))


def fit_similarity(source: ArrayLike, target: ArrayLike, *, scale: float | None = None) -> Similarity:
    """Fit the transformation that carries `source` to `target`.

    Args:
        source: (n, 3) points, n >= 3, not on one line.
        target: (n, 3) the same points in the other system.
        scale: fixed scale; estimated if left out.

    Raises:
        BadInputError: fewer than three points, or all on a line: the rotation about it is free.
    """
    source, target = np.asarray(source, float), np.asarray(target, float)
    if len(source) < 3:
        raise BadInputError(f"a similarity transformation has {len(source)} common points: give at least three")
    from_centre, to_centre = source.mean(axis=0), target.mean(axis=0)
    a, b = source - from_centre, target - to_centre
    for cloud in (a, b):
        extents = np.linalg.svd(cloud, compute_uv=False)
        if not extents[1] > _COLLINEAR * extents[0]:
            raise BadInputError("the common points of a similarity transformation lie on a line: add one beside it")
    rotation = nearest_rotation(b.T @ a)
    if scale is None:
        scale = float((b * (a @ rotation.T)).sum() / (a * a).sum())
    return Similarity(scale, rotation, to_centre - scale * rotation @ from_centre)
