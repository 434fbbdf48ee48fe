"""Measures centres of black discs on white, to hundredths of a pixel, with their covariance.

A disc's picture is an ellipse, |M (p - q)| = 1 with a symmetric M. Around it the grey values are fitted by its edge,
blurred by a Gaussian of width s,

    g(p) = (1 + l (p - p0)) (b + a erf(d(p) / (sqrt(2) s))),   d = (rho - 1) rho / |M M (p - q)|,   rho = |M (p - q)|,

with unknown q, M, contrast a, background b, slope of the light l, and s; d is the distance from the ellipse to first
order.

The ellipse's middle q is not the picture of the disc's centre when the disc is seen aslant: it is off by about
c (r / Z)^2 sin(t) cos(t) for a disc of radius r at the distance Z that is turned by t. The four discs of a target give
the homography of its plane, and by this the offset is computed and taken off (`projected_centres`).
"""

from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from analysis.targets.fitting import FIRST_BLUR, Measured, fitted
from analysis.targets.pattern import CORNERS, DISC
from rig.arrays import Flags, Floats

#: Of the white around a disc so much is looked at, in radii of the disc.
_WINDOW: Final = 1.7
_SMALLEST: Final = 2.0  # px, half the ellipse's short axis: below, a window holds too few pixels
_MOVED: Final = 0.5  # radii, at most, from where it was expected
_STEP: Final = 4  # px: windows of about one size are fitted together
_TWICE: Final = 2  # the offset is a hundredth of a pixel or two: computed again with the better homography it is exact


def measurable(square: Floats, size: tuple[int, int]) -> bool:
    """Whether a picture shows a target's discs, and so that they can be measured: whole, and no mere streaks.

    Args:
        square: (4, 2) px where the centres are about, clockwise from the top left.
        size: width, height of the picture (px).
    """
    if not np.all((square >= 0.0) & (square <= np.array(size) - 1.0)) or not cv2.isContourConvex(
        square.astype(np.float32)
    ):
        return False
    axes = np.linalg.svd(_slopes(_homography(square)), compute_uv=False)
    return bool(axes.min() > _SMALLEST and _WINDOW * axes.max() < min(size) / 2.0)


def measure_circles(grey: NDArray[np.float32], squares: Floats) -> Measured:
    """Measure the centres of the discs of targets.

    Args:
        grey: (rows, columns).
        squares: (n, 4, 2) px where the centres are about, at most half a radius off; all of them `measurable`.

    Returns:
        4 n centres, target by target.
    """
    start = squares.reshape(-1, 2)
    slope = np.concatenate([_slopes(_homography(square)) for square in squares])
    need = np.ceil(_WINDOW * np.linalg.norm(slope, 2, axis=(1, 2)) / _STEP).astype(np.intp) * _STEP
    groups = [np.flatnonzero(need == radius) for radius in np.unique(need)]
    parts = [_fitted_discs(grey, start[some], slope[some], int(need[some[0]])) for some in groups]
    back = np.argsort(np.concatenate(groups))
    xy, cofactor, noise, contrast, blur, reach, good = (
        np.concatenate([getattr(part, name) for part in parts])[back] for name in Measured.__slots__
    )
    whole = good.reshape(-1, 4).all(axis=1)  # the offset of fewer than four is not known
    for k in np.flatnonzero(whole).tolist():
        xy[4 * k : 4 * k + 4] = projected_centres(xy[4 * k : 4 * k + 4])
    return Measured(xy, cofactor, noise, contrast, blur, reach, np.repeat(whole, 4))


def projected_centres(ellipses: Floats) -> Floats:
    """The pictures (4, 2) of the centres of a target's discs, by the middles (4, 2) of their ellipses, px.

    The dual conic of a disc about C, Q = [r^2 I - C C^T, -C; -C^T, -1], becomes H Q H^T, and its middle is the polar of
    the line at infinity (Hartley and Zisserman, Multiple View Geometry, 2.2.3).
    """
    centres = ellipses
    for _ in range(_TWICE):
        h = _homography(centres)
        offsets = []
        for centre in CORNERS:
            c = np.append(centre, 1.0)
            dual = h @ (DISC**2 * np.diag([1.0, 1.0, 0.0]) - np.outer(c, c)) @ h.T
            point = h @ c
            offsets.append(dual[:2, 2] / dual[2, 2] - point[:2] / point[2])
        centres = ellipses - np.array(offsets)
    return np.asarray(centres, float)


def _homography(square: Floats) -> Floats:
    """(3, 3) from a target's plane, in units of its side, into the picture."""
    middle = square.mean(axis=0)  # single precision is enough for what is within a target
    h = cv2.getPerspectiveTransform(CORNERS.astype(np.float32), (square - middle).astype(np.float32))
    return np.asarray(np.array([[1.0, 0.0, middle[0]], [0.0, 1.0, middle[1]], [0.0, 0.0, 1.0]]) @ h, float)


def _slopes(h: Floats) -> Floats:
    """(4, 2, 2) columns that span the ellipses of a target's discs, px: radii to its right and downwards."""
    slopes = []
    for centre in CORNERS:
        x, y, w = h @ np.append(centre, 1.0)
        slopes.append(DISC * (h[:2, :2] - np.outer((x / w, y / w), h[2, :2])) / w)
    return np.array(slopes)


def _fitted_discs(grey: NDArray[np.float32], start: Floats, slope: Floats, radius: int) -> Measured:
    """Fit discs whose windows are of one size."""
    side = np.arange(-radius, radius + 1)
    dx, dy = (part.ravel().astype(float) for part in np.meshgrid(side, side))
    edge = np.array(grey.shape[::-1]) - 1 - radius
    middle = np.rint(start).astype(np.intp)
    fits = np.all((middle >= radius) & (middle <= edge), axis=1)
    wide = np.pad(grey, radius, mode="edge")
    row, column = (np.clip(middle[:, k], 0, grey.shape[1 - k] - 1) + radius for k in (1, 0))
    values = wide[row[:, None] + dy.astype(np.intp), column[:, None] + dx.astype(np.intp)].astype(float)

    squares, axes = np.linalg.eigh(slope @ np.swapaxes(slope, 1, 2))
    inverse = (axes / np.sqrt(squares)[:, None]) @ np.swapaxes(axes, 1, 2)  # symmetric, as M is
    apart = np.stack((dx, dy), axis=-1) - (start - middle)[:, None]
    inside = np.linalg.norm(apart @ inverse, axis=2) < _WINDOW
    low, high = np.nanpercentile(np.where(inside, values, np.nan), (10, 90), axis=1)
    unknowns = np.column_stack(
        (start - middle, inverse[:, 0, 0], inverse[:, 0, 1], inverse[:, 1, 1], (high - low) / 2, (high + low) / 2,
         np.zeros((len(start), 2)), np.full(len(start), np.log(FIRST_BLUR)))
    )  # fmt: skip
    fit = fitted(unknowns, lambda tried, these: _linearised(tried, values[these], dx, dy, inside[these]))
    moved = np.linalg.norm(np.einsum("nij,nj->ni", inverse, fit.unknowns[:, :2] - (start - middle)), axis=1)
    return Measured(
        middle + fit.unknowns[:, :2],
        fit.cofactor,
        np.sqrt(fit.cost / np.maximum(inside.sum(axis=1) - unknowns.shape[1], 1)),
        fit.unknowns[:, 5],
        np.exp(fit.unknowns[:, -1]),
        slope,
        fits & fit.settled & (moved < _MOVED),
    )


def _linearised(unknowns: Floats, values: Floats, dx: Floats, dy: Floats, inside: Flags) -> tuple[Floats, Floats]:
    """Residuals (n, p) of the grey values, computed - observed, and derivatives (n, 10, p), zero outside windows.

    The derivatives are those on the edge, where alone they are not small.
    """
    x, y = dx - unknowns[:, 0, None], dy - unknowns[:, 1, None]
    m11, m12, m22, a = (unknowns[:, column, None] for column in (2, 3, 4, 5))
    u, v = m11 * x + m12 * y, m12 * x + m22 * y
    rho = np.maximum(np.hypot(u, v), 1e-9)
    across, down = m11 * u + m12 * v, m12 * u + m22 * v  # M M (p - q)
    steep = np.maximum(np.hypot(across, down), 1e-9)
    blur = np.exp(unknowns[:, 9, None])
    far = (rho - 1.0) * rho / steep / blur
    edge = erf(far / np.sqrt(2.0))
    light = 1.0 + unknowns[:, 7, None] * dx + unknowns[:, 8, None] * dy
    shade = a * edge + unknowns[:, 6, None]
    by_far = light * a * np.sqrt(2.0 / np.pi) * np.exp(-0.5 * far * far)
    by_shape = by_far / (steep * blur)
    slopes = np.stack(
        (
            -by_far * across / (steep * blur),
            -by_far * down / (steep * blur),
            by_shape * u * x,
            by_shape * (u * y + v * x),
            by_shape * v * y,
            light * edge, light, shade * dx, shade * dy,
            -by_far * far,
        ),
        axis=1,
    )  # fmt: skip
    slopes *= inside[:, None]
    return np.where(inside, light * shade - values, 0.0), slopes
