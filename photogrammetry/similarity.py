"""Spatial similarity transformation (7 parameters), closed form.

Least squares of the residuals in the target system with one weight per point: the rotation from the singular value
decomposition of the moment matrix, then scale and translation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from photogrammetry.ideal_camera import Array
from photogrammetry.rotation import nearest_rotation
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
    rotation: Array
    translation: Array

    def apply(self, points: ArrayLike) -> Array:
        """Points (..., 3) in the target system."""
        return np.asarray(self.scale * (np.asarray(points, float) @ self.rotation.T) + self.translation)

    def turn(self, rotations: ArrayLike) -> Array:
        """Camera rotations (..., 3, 3), columns r1, r2, r3, in the target system."""
        return np.asarray(self.rotation @ np.asarray(rotations, float))


@dataclass(frozen=True, slots=True)
class SimilarityFit:
    """Result of a fit.

    Attributes:
        transform: source to target.
        residuals: (n, 3) transformed - target.
        sigma0: root of the weighted square sum over the redundancy; NaN without redundancy.
        redundancy: 3 n - 7, or 3 n - 6 with a fixed scale.
    """

    transform: Similarity
    residuals: Array
    sigma0: float
    redundancy: int


def fit_similarity(
    source: ArrayLike, target: ArrayLike, *, weights: ArrayLike | None = None, scale: float | None = None
) -> SimilarityFit:
    """Fit the transformation that carries `source` to `target`.

    Args:
        source: (n, 3) points, n >= 3, not on one line.
        target: (n, 3) the same points in the other system.
        weights: (n,) weights of the points; equal if left out.
        scale: fixed scale; estimated if left out.

    Returns:
        Transformation and residuals.

    Raises:
        BadInputError: fewer than three points, or all on a line: the rotation about it is free.
    """
    source, target = np.asarray(source, float), np.asarray(target, float)
    n = len(source)
    if n < 3:
        raise BadInputError(f"a similarity transformation has {n} common points: give at least three")
    w = np.ones(n) if weights is None else np.asarray(weights, float)
    from_centre = np.average(source, axis=0, weights=w)
    to_centre = np.average(target, axis=0, weights=w)
    a, b = source - from_centre, target - to_centre
    for cloud in (a, b):
        extents = np.linalg.svd(cloud * np.sqrt(w)[:, None], compute_uv=False)
        if not extents[1] > _COLLINEAR * extents[0]:
            raise BadInputError("the common points of a similarity transformation lie on a line: add one beside it")
    rotation = nearest_rotation(b.T @ (a * w[:, None]))
    redundancy = 3 * n - (7 if scale is None else 6)
    if scale is None:
        scale = float((w[:, None] * b * (a @ rotation.T)).sum() / (w[:, None] * a * a).sum())
    transform = Similarity(scale, rotation, to_centre - scale * rotation @ from_centre)
    residuals = transform.apply(source) - target
    square = float((w[:, None] * residuals**2).sum())
    return SimilarityFit(transform, residuals, float(np.sqrt(square / redundancy)), redundancy)
