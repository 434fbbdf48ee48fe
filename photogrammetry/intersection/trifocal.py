"""Checks whether left and right ski were interchanged in one of three images (Hartley, Zisserman 2003, ch. 15).

The trifocal tensor transfers a space line seen in two images into the third: g_i = g'^T T_i g''. For each hypothesis
(the naming as given, or interchanged in one image) both lines are transferred and compared with the measured ones. If
the hypothesis is true, the misclosures, weighted by the covariances of all six image lines, are chi-square distributed
with four degrees of freedom.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.image_line import ImageLines
from rig.arrays import Flags, Floats
from rig.errors import BadInputError

#: Image with interchanged skis in each hypothesis; -1: none. Interchanged in two images is the same as in the third.
HYPOTHESES = (-1, 0, 1, 2)
_FITS = 18.47  # chi-square, 4 degrees of freedom, 0.1 %


@dataclass(frozen=True, slots=True)
class SideCheck:
    """Result for n instants.

    Attributes:
        tests: (n, 4) test value of each hypothesis, chi-square with 4 degrees of freedom; NaN where a line is missing.
        proposal: (n,) image in which left and right should be interchanged, -1: none.
        confidence: (n,) probability of the proposal among the four hypotheses; 0.25 where a line is missing.
        fits: (n,) whether the proposal is compatible with the accuracy of the lines (0.1 % level).
    """

    tests: Floats
    proposal: NDArray[np.int_]
    confidence: Floats
    fits: Flags


def trifocal_tensor(cameras: Sequence[IdealCamera]) -> Floats:
    """Tensor (3, 3, 3) of slices T_i for transfer into the first of three cameras, scaled to norm 1."""
    first, second, third = cameras
    # in the system in which the first camera is (I, 0): X = X0 + M^-1 x, scaled by the base so that numbers are near 1
    inverse = np.linalg.inv(first.matrix()[:, :3])
    scale = np.linalg.norm(second.X0 - first.X0) + np.linalg.norm(third.X0 - first.X0)
    frame = np.zeros((4, 4))
    frame[:3, :3], frame[:3, 3], frame[3, 3] = inverse * np.linalg.norm(inverse) ** -1, first.X0 / scale, 1 / scale
    a, b = second.matrix() @ frame, third.matrix() @ frame
    tensor = np.einsum("ji,k->ijk", a[:, :3], b[:, 3]) - np.einsum("j,ki->ijk", a[:, 3], b[:, :3])
    return np.asarray(tensor / np.linalg.norm(tensor))


def transfer_lines(tensor: Floats, second: Floats, third: Floats) -> Floats:
    """Lines (..., 3) in the first image from lines (..., 3) in the second and third."""
    return np.asarray(np.einsum("ijk,...j,...k->...i", tensor, second, third))


def check_sides(cameras: Sequence[IdealCamera], left: ImageLines, right: ImageLines) -> SideCheck:
    """Find the image in which left and right ski are interchanged.

    Args:
        cameras: three cameras.
        left: (n, 3) image lines called left ski.
        right: (n, 3) image lines called right ski.

    Returns:
        Test values, proposal and its probability.

    Raises:
        BadInputError: there are not three cameras and three image lines each.
    """
    if len(cameras) != 3 or any(lines.a.shape[1:] != (3,) for lines in (left, right)):
        raise BadInputError(
            "the check of left and right takes three images: give three cameras and (n, 3) lines of each ski"
        )
    lines = np.stack((left.homogeneous(), right.homogeneous()))
    covariances = np.stack((_covariance(left), _covariance(right)))
    with np.errstate(invalid="ignore", divide="ignore"):
        named = [_interchanged(image, lines, covariances) for image in HYPOTHESES]
        tests = _tests(cameras, np.stack([each for each, _ in named]), np.stack([each for _, each in named])).T
    complete = np.asarray(np.isfinite(tests).all(axis=1))
    tests[~complete] = np.nan
    known = np.where(complete[:, None], tests, 0.0)
    likelihood = np.exp(-0.5 * (known - known.min(axis=1, keepdims=True)))
    best = known.argmin(axis=1)
    confidence = likelihood.max(axis=1) / likelihood.sum(axis=1)
    return SideCheck(tests, np.array(HYPOTHESES)[best], confidence, complete & (known.min(axis=1) < _FITS))


def _covariance(lines: ImageLines) -> Floats:
    """Covariance (..., 3, 3) of the homogeneous lines (a, -1, b) or (1, a, b) divided by the root of 1 + a^2."""
    turned = lines.turned
    one, zero = np.ones_like(lines.a), np.zeros_like(lines.a)
    root = np.sqrt(1 + lines.a**2)
    g = lines.homogeneous()
    by_a = np.stack((np.where(turned, zero, one), np.where(turned, one, zero), zero), axis=-1) / root[..., None]
    by_a = by_a - g * (lines.a / root**2)[..., None]
    by_b = np.stack((zero, zero, one), axis=-1) / root[..., None]
    jacobian = np.stack((by_a, by_b), axis=-1)
    return np.asarray(jacobian @ lines.covariance @ np.swapaxes(jacobian, -1, -2))


def _interchanged(image: int, lines: Floats, covariances: Floats) -> tuple[Floats, Floats]:
    if image < 0:
        return lines, covariances
    lines, covariances = lines.copy(), covariances.copy()
    lines[:, :, image] = lines[::-1, :, image]
    covariances[:, :, image] = covariances[::-1, :, image]
    return lines, covariances


def _tests(cameras: Sequence[IdealCamera], lines: Floats, covariances: Floats) -> Floats:
    """Sums of both skis' test values (4, n), each ski transferred into the image where this is most accurate.

    Args:
        cameras: three cameras.
        lines: (4, 2, n, 3, 3) by hypothesis, ski, instant and image.
        covariances: (4, 2, n, 3, 3, 3) of them.
    """
    values, spreads = zip(*(_transfer_test(cameras, order, lines, covariances) for order in _orders()), strict=True)
    pick = np.argmin(spreads, axis=0)
    return np.asarray(np.take_along_axis(np.array(values), pick[None], axis=0)[0].sum(axis=1))


def _orders() -> list[tuple[int, ...]]:
    return [order for order in permutations(range(3)) if order[1] < order[2]]


def _transfer_test(
    cameras: Sequence[IdealCamera], order: tuple[int, ...], lines: Floats, covariances: Floats
) -> tuple[Floats, Floats]:
    """Test values (4, 2, n) of lines transferred into image order[0], and the variance of the transferred direction."""
    tensor = trifocal_tensor([cameras[i] for i in order])
    measured, second, third = (lines[..., i, :] for i in order)
    k_measured, k_second, k_third = (covariances[..., i, :, :] for i in order)
    transferred = transfer_lines(tensor, second, third)
    by_second = np.einsum("ijk,...k->...ij", tensor, third)
    by_third = np.einsum("ijk,...j->...ik", tensor, second)
    covariance = _sandwich(by_second, k_second) + _sandwich(by_third, k_third)
    length = np.linalg.norm(transferred[..., :2], axis=-1)[..., None]
    sign = np.sign((transferred[..., :2] * measured[..., :2]).sum(-1))[..., None]
    unit = sign * transferred / length
    # derivative of the scaling to a unit normal
    scaling = np.zeros((*unit.shape, 3))
    scaling[...] = np.eye(3)
    scaling[..., :2] -= unit[..., :, None] * unit[..., None, :2]
    covariance = _sandwich(scaling, covariance / length[..., None] ** 2)
    # two independent components of the misclosure: along the measured line's direction, and its third element
    direction = np.stack((-measured[..., 1], measured[..., 0]), axis=-1)
    pick = np.zeros((*measured.shape[:-1], 2, 3))
    pick[..., 0, :2], pick[..., 1, 2] = direction, 1.0
    w = np.einsum("...ij,...j->...i", pick, unit - measured)
    total = _sandwich(pick, covariance + k_measured)
    finite = np.asarray(np.isfinite(total).all(axis=(-1, -2)))[..., None]
    solved = np.linalg.solve(np.where(finite[..., None], total, np.eye(2)), np.where(finite, w, np.nan)[..., None])
    return (w * solved[..., 0]).sum(axis=-1), total[..., 0, 0]


def _sandwich(jacobian: Floats, covariance: Floats) -> Floats:
    return np.asarray(jacobian @ covariance @ np.swapaxes(jacobian, -1, -2))
