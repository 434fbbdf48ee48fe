"""Which reference points agree with the free block and with each other, however wrong the others are.

The tests of a least-squares fit compare with a variance that several gross errors inflate together: they hide each
other, and their neighbours look worse than they. So the transformation is taken from three points at a time. The one
is chosen that most of the points follow best (least median of squares, Rousseeuw 1984), and improved with them
(concentration steps, Rousseeuw and Van Driessen 1999). The other points are taken in as long as they do not differ
significantly from what those within predict (forward search, Atkinson and Riani 2000).
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np
from scipy import special

from photogrammetry.procedures.reference.reference_estimate import ReferenceEstimate, ReferencePoint
from rig.arrays import Floats, Integers
from rig.errors import BadInputError

#: Points that must agree: one more than the three that any transformation fits.
FEWEST_AGREEING: Final = 4
_TRIPLES: Final = 2000  # that are tried; a quarter of the points wrong leaves hundreds of sound ones among them
_STARTS: Final = 5  # best triples that are improved
_CONCENTRATIONS: Final = 6
_THIN: Final = 0.02  # second to first extent of a triple; from a thinner one the others are extrapolated


def agreeing_points(points: Sequence[ReferencePoint], covariance: Floats, risk: float) -> list[int]:
    """Indices of the points that agree with the majority; all of them if there is no majority to agree with.

    Args:
        points: n reference points.
        covariance: (3 n, 3 n) of their coordinates in the block.
        risk: probability that a sound point is left out beside sound ones.
    """
    count = len(points)
    most = max(count // 2 + 1, FEWEST_AGREEING)
    if count <= most:
        return list(range(count))
    best = _concentrated(points, covariance, most)
    if best is None:
        return list(range(count))
    used = list(best.used)
    while outside := [i for i in range(count) if i not in used]:
        left = forecast_errors(best, points, covariance, outside)
        chance = special.fdtrc(3, best.redundancy, left / 3.0 / _variance(best, count))
        sound = sorted((float(value), i) for value, i, p in zip(left, outside, chance, strict=True) if p >= risk)
        if not sound:
            break
        # the smaller half first: they sharpen the judgement of the others
        used += [i for _, i in sound[: (len(sound) + 1) // 2]]
        best = ReferenceEstimate.of(points, covariance, sorted(used))
    return sorted(used)


def forecast_errors(
    estimate: ReferenceEstimate, points: Sequence[ReferencePoint], covariance: Floats, others: Sequence[int]
) -> Floats:
    """Squared sizes of the errors of other points against what an estimate predicts for them, over their covariance.

    The misclosures of the others are predicted from those of the estimate with all covariances (D3b, best linear
    unbiased prediction).

    Args:
        estimate: from some of the points.
        points: all n reference points.
        covariance: (3 n, 3 n) of their coordinates in the block.
        others: m indices of points that the estimate does not use.

    Returns:
        (m,); chi-squared with 3 degrees of freedom for sound points.
    """
    order = [*estimate.used, *others]
    known = 3 * len(estimate.used)
    v, k, slopes = estimate.misclosures(points, covariance, order)
    gain = np.linalg.solve(k[:known, :known], np.hstack([k[:known, known:], slopes[:known]]))
    onto, weighted = gain[:, : 3 * len(others)], gain[:, 3 * len(others) :]
    normals = slopes[:known].T @ weighted
    # the estimate's v is free of the parameters' part already, up to rounding and what is not linear
    step = np.linalg.solve(normals, weighted.T @ v[:known])
    error = v[known:] - slopes[known:] @ step - onto.T @ (v[:known] - slopes[:known] @ step)
    lever = slopes[known:] - onto.T @ slopes[:known]
    spread = k[known:, known:] - k[known:, :known] @ onto + lever @ np.linalg.solve(normals, lever.T)
    blocks = spread.reshape(len(others), 3, len(others), 3)[np.arange(len(others)), :, np.arange(len(others))]
    single = error.reshape(-1, 3)
    return np.asarray(np.einsum("ni,ni->n", single, np.linalg.solve(blocks, single[..., None])[..., 0]))


def _variance(estimate: ReferenceEstimate, count: int) -> float:
    """The variance factor of all `count` points from the best of them, at least the a-priori one.

    The best part of normally distributed vectors has a smaller variance than all of them (Croux and Haesbroeck 1999).
    """
    part = len(estimate.used) / count
    shrunk = 1.0 if part == 1.0 else float(special.chdtr(5, special.chdtri(3, 1.0 - part)) / part)
    return max(1.0, estimate.ratio**2 / shrunk)


def _concentrated(points: Sequence[ReferencePoint], covariance: Floats, most: int) -> ReferenceEstimate | None:
    """The estimate from the `most` points that agree best; None if all points lie on a line."""
    best: ReferenceEstimate | None = None
    for start in _best_triples(points, covariance, most):
        used = tuple(sorted(start))
        try:
            estimate = ReferenceEstimate.of(points, covariance, used)
            for _ in range(_CONCENTRATIONS):
                sizes = _sizes(estimate, points, covariance)
                closer = tuple(sorted(np.argsort(sizes, kind="stable")[:most].tolist()))
                if closer == used:
                    break
                used = closer
                estimate = ReferenceEstimate.of(points, covariance, used)
        except (BadInputError, np.linalg.LinAlgError):
            continue  # these points lie on a line
        if best is None or estimate.square_sum < best.square_sum:
            best = estimate
    return best


def _sizes(estimate: ReferenceEstimate, points: Sequence[ReferencePoint], covariance: Floats) -> Floats:
    """Squared misclosures (n,) of all points over their own covariance."""
    v, k, _ = estimate.misclosures(points, covariance, range(len(points)))
    n = len(points)
    blocks, single = k.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)], v.reshape(-1, 3)
    return np.asarray(np.einsum("ni,ni->n", single, np.linalg.solve(blocks, single[..., None])[..., 0]))


def _best_triples(points: Sequence[ReferencePoint], covariance: Floats, most: int) -> list[list[int]]:
    """For the best triples the `most` points that follow each of them best."""
    n = len(points)
    block, surveyed = (np.array([getattr(p, name) for p in points]) for name in ("block", "surveyed"))
    own = covariance.reshape(n, 3, n, 3)[np.arange(n), :, np.arange(n)]
    survey = np.array([np.diag(point.sigma**2) for point in points])
    turn, scale, shift = _fits(block, surveyed, _triples(n))
    v = np.einsum("t,tij,nj->tni", scale, turn, block) + shift[:, None] - surveyed
    spread = survey + (scale**2)[:, None, None, None] * (turn[:, None] @ own @ np.swapaxes(turn, 1, 2)[:, None])
    with np.errstate(all="ignore"):
        sizes = np.einsum("tni,tni->tn", v, np.linalg.solve(spread, v[..., None])[..., 0])
    sizes = np.where(np.isfinite(sizes), sizes, np.inf)
    score = np.partition(sizes, most - 1, axis=1)[:, most - 1]
    best = np.argsort(score, kind="stable")[:_STARTS]
    return [np.argsort(sizes[t], kind="stable")[:most].tolist() for t in best]


def _triples(n: int) -> Integers:
    """All triples of n points, or evenly spread ones of them."""
    every = np.array(list(combinations(range(n), 3)), dtype=np.intp) if n <= 60 else _drawn_triples(n)
    return every if len(every) <= _TRIPLES else every[np.linspace(0, len(every) - 1, _TRIPLES).astype(np.intp)]


def _drawn_triples(n: int) -> Integers:
    """Triples of many points, the same in every run."""
    return np.array([np.random.default_rng(i).choice(n, 3, replace=False) for i in range(_TRIPLES)], dtype=np.intp)


def _fits(block: Floats, surveyed: Floats, triples: Integers) -> tuple[Floats, Floats, Floats]:
    """Rotations (t, 3, 3), scales (t,) and translations (t, 3) from triples that are no lines."""
    a, b = block[triples], surveyed[triples]
    from_centre, to_centre = a.mean(axis=1), b.mean(axis=1)
    a, b = a - from_centre[:, None], b - to_centre[:, None]
    extent = np.linalg.svd(a, compute_uv=False)
    u, _, vt = np.linalg.svd(np.swapaxes(b, 1, 2) @ a)
    u[:, :, 2] *= np.linalg.det(u @ vt)[:, None]
    turn = u @ vt
    scale = (b * (a @ np.swapaxes(turn, 1, 2))).sum(axis=(1, 2)) / (a * a).sum(axis=(1, 2))
    good = (extent[:, 1] > _THIN * extent[:, 0]) & (scale > 0.0)
    turn, scale = turn[good], scale[good]
    shift = to_centre[good] - scale[:, None] * np.einsum("tij,tj->ti", turn, from_centre[good])
    return turn, scale, shift
