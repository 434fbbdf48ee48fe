"""Fits image lines to measured line points (of a ski): appendix C.2, step A (C7, C11, C12).

C12 with P = (1 + a^2)^-1 is the sum of squared distances of the points from the line. P is the same for all points of
a line, so the printed iteration, which holds P fixed, never leaves its first step: ordinary regression, which biases a
towards zero. The minimum of C12 itself has a closed solution, the principal axis of the points; this module takes it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rig.arrays import Flags, Floats
from rig.errors import BadInputError


@dataclass(frozen=True, slots=True)
class ImageLines:
    """Image lines y = a x + b (C7), any leading shape (...): for example (lines, images).

    A line steeper than 45 degrees is given in coordinates turned by a quarter, x' = y, y' = -x, so that |a| <= 1.

    Attributes:
        a: (...) slope; NaN where no line was measured.
        b: (...) intercept, image unit.
        covariance: (..., 2, 2) of (a, b): K of C14.
        turned: (...) whether a and b refer to the turned coordinates.
        centre: (..., 2) centroid of the points, in coordinates not turned.
        vtpv: (...) sum of squared distances over sigma^2; redundancy points - 2.
    """

    a: Floats
    b: Floats
    covariance: Floats
    turned: Flags
    centre: Floats
    vtpv: Floats

    @property
    def present(self) -> Flags:
        """(...) where there is a line."""
        return np.isfinite(self.a)

    def homogeneous(self) -> Floats:
        """Lines g (..., 3) of appendix C.3, coordinates not turned: g . (x, y, 1) = 0, unit normal (g1, g2)."""
        one = np.ones_like(self.a)
        g = np.where(
            self.turned[..., None],
            np.stack((one, self.a, self.b), axis=-1),
            np.stack((self.a, -one, self.b), axis=-1),
        )
        return np.asarray(g / np.sqrt(1 + self.a**2)[..., None])


def fit_image_lines(xy: ArrayLike, sigma: float, *, seen: Flags | None = None) -> ImageLines:
    """Fit a line to the points of each image line (step A, C12).

    Args:
        xy: (..., k, 2) reduced image coordinates of k line points.
        sigma: standard deviation of x and y alike (C2), image unit.
        seen: (..., k) which points exist; all if left out. Lines with fewer than two points count as not measured.

    Returns:
        The lines, with covariance from sigma.

    Raises:
        BadInputError: sigma is not positive, a measured coordinate is not finite, or all points of a line coincide.
    """
    xy = np.asarray(xy, float)
    there = np.ones(xy.shape[:-1], bool) if seen is None else np.asarray(seen, bool)
    xy = np.where(there[..., None], xy, 0.0)
    if not sigma > 0:
        raise BadInputError("sigma of line points is not positive: give the standard deviation in the image unit")
    if not np.isfinite(xy).all():
        raise BadInputError("a line point is not a number: mark missing points in `seen`")
    count = there.sum(axis=-1)
    with np.errstate(invalid="ignore", divide="ignore"):  # lines without points become NaN
        centre = xy.sum(axis=-2) / count[..., None]
        d = np.where(there[..., None], xy - centre[..., None, :], 0.0)
        angle = 0.5 * np.arctan2(2 * (d[..., 0] * d[..., 1]).sum(-1), (d[..., 0] ** 2 - d[..., 1] ** 2).sum(-1))
        axis = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
        along = (np.einsum("...kc,...c->...k", d, axis) ** 2).sum(-1)
        across = ((d[..., 1] * axis[..., None, 0] - d[..., 0] * axis[..., None, 1]) ** 2).sum(-1)
    if (along[count >= 2] <= 0).any():
        raise BadInputError("all points of an image line coincide: measure points that lie apart")
    return _lines(centre, axis, np.where(count >= 2, along, np.nan), count, across, sigma)


def _lines(
    centre: Floats, axis: Floats, along: Floats, count: NDArray[np.int_], across: Floats, sigma: float
) -> ImageLines:
    """Slope and intercept with covariance: the angle and the offset at the centroid are uncorrelated."""
    turned = np.abs(axis[..., 1]) > np.abs(axis[..., 0])
    first = np.where(turned, axis[..., 1], axis[..., 0])
    second = np.where(turned, -axis[..., 0], axis[..., 1])
    x = np.where(turned, centre[..., 1], centre[..., 0])
    y = np.where(turned, -centre[..., 0], centre[..., 1])
    with np.errstate(invalid="ignore", divide="ignore"):
        a = np.where(np.isfinite(along), second / first, np.nan)
        stretch = 1 + a**2
        slope_variance = stretch**2 * sigma**2 / along
        covariance = np.empty((*a.shape, 2, 2))
        covariance[..., 0, 0] = slope_variance
        covariance[..., 0, 1] = covariance[..., 1, 0] = -x * slope_variance
        covariance[..., 1, 1] = stretch * sigma**2 / count + x**2 * slope_variance
    return ImageLines(a, y - a * x, covariance, turned, centre, across / sigma**2)
