"""Estimates the seven parameters that carry a free block onto its reference points, and tests the points.

X = t + s R x with the full covariance of the free block and the sigmas of the survey: misclosures with covariance
K = K_survey + s^2 R K_block R^T. A reference point is tested as a whole by the alternative that its three coordinates
are wrong.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy import special

from photogrammetry.adjustment.gross_errors.suspicion import SINGLE_RISK, significant
from photogrammetry.adjustment.solution.statistics import UNCONTROLLED
from photogrammetry.geometry.rotation import rotation_from_vector, skew
from photogrammetry.geometry.similarity import Similarity, fit_similarity
from rig.arrays import Floats

_ITERATIONS: Final = 20
_SETTLED: Final = 1e-10
_DIVERGED: Final = 1e-4
_PARAMETERS: Final = 7
_RANK: Final = 1e-9
_ROUNDING: Final = 1e-9
#: Part of the square sum of a large error that may remain with the culprit eliminated: its effect is not linear.
_LINEAR: Final = 0.005
#: A rival explains the misclosures if the suspect's test value with the rival eliminated is below this (3 coordinates).
_EXPLAINED: Final = float(special.chdtri(3, SINGLE_RISK))


@dataclass(frozen=True, slots=True, eq=False)
class ImagePoint:
    """An image point of a reference point; it may be wrong instead of the survey.

    Attributes:
        index: the caller's number of it.
        shift: (3 n, 2) change of the n reference points in the block by an error of it.
        normal: (2, 2) normal matrix of that error in the free adjustment.
        right: (2,) right-hand side of the same.
    """

    index: int
    shift: Floats
    normal: Floats
    right: Floats


@dataclass(frozen=True, slots=True, eq=False)
class ReferencePoint:
    """A reference point in both systems.

    Attributes:
        block: (3,) in the free block.
        surveyed: (3,).
        sigma: (3,) of the survey; zero: error-free.
        images: its images.
    """

    block: Floats
    surveyed: Floats
    sigma: Floats
    images: tuple[ImagePoint, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Suspect:
    """A reference point whose survey does not agree with the images.

    Attributes:
        index: of the point.
        estimate: (3,) surveyed - true.
        w: root of the decrease of the square sum, over sigma0.
        single: (3,) test values of its coordinates.
        controlled: (3,) redundancy numbers of its coordinates.
        candidates: indices of the reference points any of which may be wrong, itself first; empty without rivals.
        images: indices of its image points that may be wrong instead of the survey.
    """

    index: int
    estimate: Floats
    w: float
    single: Floats
    controlled: Floats
    candidates: tuple[int, ...]
    images: tuple[int, ...] = ()

    @property
    def certain(self) -> bool:
        """Whether no other observation explains the residuals."""
        return not (self.candidates or self.images)


def _rows(points: Sequence[int]) -> list[int]:
    return [3 * i + axis for i in points for axis in range(3)]


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceEstimate:
    """One estimation, from some of the reference points.

    Attributes:
        transform: block to object system.
        points: the n reference points used.
        used: their indices among all.
        v: (3 n,) residuals, transformed - surveyed.
        projected: (3 n, 3 n) W = K^-1 - K^-1 A (A^T K^-1 A)^-1 A^T K^-1; the square sum is v^T W v.
        controlled: (n, 3) redundancy numbers of the misclosures, the diagonal of K W.
    """

    transform: Similarity
    points: tuple[ReferencePoint, ...]
    used: tuple[int, ...]
    v: Floats
    projected: Floats
    controlled: Floats

    @classmethod
    def of(
        cls,
        everything: Sequence[ReferencePoint],
        covariance: Floats,
        used: Sequence[int],
        at: Similarity | None = None,
    ) -> "ReferenceEstimate":
        """Estimate from some of the points.

        Args:
            everything: all reference points.
            covariance: of their coordinates in the block.
            used: indices of those that are used.
            at: where to linearise for the tests, without any estimation; a point that is wrong by far would spoil it.

        Raises:
            BadInputError: they lie on a line.
            LinAlgError: there is no optimum, or their numbers lie too many orders of magnitude apart.
        """
        points, rows = [everything[i] for i in used], _rows(used)
        block = np.array([p.block for p in points])
        surveyed = np.array([p.surveyed for p in points])
        survey, free = np.diag(np.concatenate([p.sigma for p in points]) ** 2), covariance[np.ix_(rows, rows)]
        transform = fit_similarity(block, surveyed) if at is None else at
        moved = 0.0
        for _ in range(_ITERATIONS):
            placed = transform.apply(block)
            slopes = _slopes(placed)
            turned = _turned(transform, len(points))
            misclosures = turned @ free @ turned.T + survey
            weights = np.linalg.inv(_regular(misclosures, slopes))
            half = weights @ slopes
            normals = slopes.T @ half
            if at is not None:
                break
            step = -np.linalg.solve(normals, half.T @ (placed - surveyed).ravel())
            transform = _moved(transform, step, placed.mean(axis=0))
            moved = float(np.abs(slopes @ step).max() / np.ptp(surveyed, axis=0).max())
            if moved <= _SETTLED:
                break
        # the block's covariance grows with the scale, so that gross errors can drive the scale to infinity
        if at is None and not moved <= _DIVERGED:
            raise np.linalg.LinAlgError("no optimum")
        projected = np.asarray(weights - half @ np.linalg.solve(normals, half.T), dtype=float)
        v = (transform.apply(block) - surveyed).ravel()
        controlled = np.einsum("ij,ji->i", misclosures, projected).reshape(-1, 3)
        # W is positive semidefinite; rounding of absurd numbers can make the square sum negative or no number at all.
        if not v @ projected @ v >= -_ROUNDING * (np.abs(v) @ np.abs(projected) @ np.abs(v)):
            raise np.linalg.LinAlgError("no square sum")
        return cls(transform, tuple(points), tuple(used), v, projected, controlled)

    @property
    def redundancy(self) -> int:
        """Misclosures - parameters."""
        return len(self.v) - _PARAMETERS

    @property
    def square_sum(self) -> float:
        """The minimised square sum, in a-priori variances."""
        return max(0.0, float(self.v @ self.projected @ self.v))

    @property
    def ratio(self) -> float:
        """Estimated / a-priori sigma0."""
        return float(np.sqrt(self.square_sum / self.redundancy))

    @property
    def chance(self) -> float:
        """Probability that the misclosures of sound points have a square sum so large."""
        return float(special.chdtrc(self.redundancy, self.square_sum)) if self.redundancy > 0 else 1.0

    @property
    def w(self) -> Floats:
        """Test values of single coordinates, whose misclosures are correlated: W v / (sigma0 root of W's diagonal)."""
        size = np.sqrt(np.maximum(np.diagonal(self.projected), 0.0)) * self.ratio
        known = (size > 0.0) & (self.controlled.ravel() > UNCONTROLLED)
        w = np.where(known, self.projected @ self.v / np.where(known, size, 1.0), np.nan)
        return np.asarray(w.reshape(-1, 3))

    def misclosures(
        self, everything: Sequence[ReferencePoint], covariance: Floats, order: Sequence[int]
    ) -> tuple[Floats, Floats, Floats]:
        """Misclosures of any points, used or not, under this transformation.

        Args:
            everything: all reference points.
            covariance: of their coordinates in the block.
            order: indices of m of them.

        Returns:
            Misclosures transformed - surveyed (3 m,), their covariance (3 m, 3 m), which is regular but indeterminate
            along the parameters, and their derivatives by the parameters (3 m, 7).
        """
        points, rows = [everything[i] for i in order], _rows(order)
        placed = self.transform.apply(np.array([p.block for p in points]))
        slopes, turned = _slopes(placed), _turned(self.transform, len(points))
        spread = turned @ covariance[np.ix_(rows, rows)] @ turned.T
        spread += np.diag(np.concatenate([p.sigma for p in points]) ** 2)
        v = (placed - np.array([p.surveyed for p in points])).ravel()
        return v, _regular(spread, slopes), slopes

    def suspect(self, family_risk: float) -> Suspect | None:
        """The worst point, with its rivals; None if no point is significant."""
        count = len(self.used)
        drops = np.array([self._drop(self._wrong(i)) for i in range(count)])
        risk = min(SINGLE_RISK, family_risk / count)
        if not significant(drops, 3, self.square_sum, self.redundancy, risk).any():
            return None
        worst = int(np.argmax(drops))
        wrong = self._wrong(worst)
        needed = max(_EXPLAINED * self._clean(float(drops[worst])), _LINEAR * float(drops[worst]))
        others = [i for i in range(count) if i != worst]
        rivals = [i for i in others if self._drop(np.hstack([wrong, self._wrong(i)])) - drops[i] < needed]
        rivals.sort(key=lambda i: -drops[i])
        images = [image for image in self.points[worst].images if self._left(wrong, image) < needed]
        estimate = _pseudo_inverse(wrong.T @ self.projected @ wrong) @ wrong.T @ self.projected @ self.v
        return Suspect(
            self.used[worst],
            estimate,
            float(np.sqrt(drops[worst])) / self.ratio,
            self.w[worst],
            self.controlled[worst],
            tuple(self.used[i] for i in (worst, *rivals)) if rivals else (),
            tuple(image.index for image in images),
        )

    def _wrong(self, point: int) -> Floats:
        """Change of the residuals by an error of a point's surveyed coordinates: (3 n, 3)."""
        effect = np.zeros((len(self.v), 3))
        effect[3 * point : 3 * point + 3] = -np.eye(3)
        return effect

    def _drop(self, effects: Floats, normal: Floats | float = 0.0, right: Floats | float = 0.0) -> float:
        """Decrease of the square sum by errors with effects (3 n, k); normal and right add their parts elsewhere."""
        pulled = effects.T @ self.projected @ self.v + right
        return float(pulled @ _pseudo_inverse(effects.T @ self.projected @ effects + normal) @ pulled)

    def _left(self, wrong: Floats, image: ImagePoint) -> float:
        """Decrease by an error of the survey beside an error of an image point, which the free adjustment sees too."""
        shift = _turned(self.transform, len(self.used)) @ image.shift[_rows(self.used)]
        normal, right = np.zeros((5, 5)), np.zeros(5)
        normal[3:, 3:], right[3:] = image.normal, image.right
        both = self._drop(np.hstack([wrong, shift]), normal, right)
        return both - self._drop(shift, image.normal, image.right)

    def _clean(self, drop: float) -> float:
        """The variance factor without the suspect."""
        freedom = self.redundancy - 3
        return (self.square_sum - drop) / freedom if freedom > 0 else 1.0


def _turned(transform: Similarity, count: int) -> Floats:
    """The transformation's effect on small shifts of all points: (3 n, 3 n)."""
    return np.asarray(transform.scale * np.kron(np.eye(count), transform.rotation))


def _slopes(placed: Floats) -> Floats:
    """Derivatives of the points by translation, rotation (rad, object axes) and logarithm of the scale: (3 n, 7)."""
    arms = placed - placed.mean(axis=0)
    out = np.zeros((len(placed), 3, _PARAMETERS))
    out[:, :, :3] = np.eye(3)
    out[:, :, 3:6] = -skew(arms)
    out[:, :, 6] = arms
    return out.reshape(-1, _PARAMETERS)


def _regular(covariance: Floats, slopes: Floats) -> Floats:
    """The covariance, made regular along the parameters, which changes neither estimate nor residuals (Rao)."""
    free = slopes / np.linalg.norm(slopes, axis=0)
    return np.asarray(covariance + np.diagonal(covariance).max() * free @ free.T)


def _pseudo_inverse(matrix: Floats) -> Floats:
    """Of a symmetric matrix, whose rank may be short where residuals control only part of an error."""
    return np.asarray(np.linalg.pinv(matrix, rcond=_RANK, hermitian=True))


def _moved(transform: Similarity, step: Floats, centre: Floats) -> Similarity:
    turn, growth = rotation_from_vector(step[3:6]), float(np.exp(step[6]))
    shift = growth * turn @ (transform.translation - centre) + centre + step[:3]
    return Similarity(transform.scale * growth, turn @ transform.rotation, shift)
