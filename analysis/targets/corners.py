"""Measures corners where two black and two white fields meet, to hundredths of a pixel, with their covariance.

Around such a corner q the grey values are fitted by two straight edges, blurred by a Gaussian of width s,

    g(p) = (1 + l (p - p0)) (b + a erf(n1 (p - q) / (sqrt(2) s)) erf(n2 (p - q) / (sqrt(2) s))),

with unknown q, directions of the normals n1 and n2, contrast a, background b, slope of the light l, and s. The pattern
is symmetric about q, so that blur and perspective do not shift it. White and black are as bright as the light at their
place, which a lens lets fall off towards the edges of a picture. Least squares give q and, by the residuals, its sigma.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from analysis.targets.fitting import FIRST_BLUR, Measured, fitted
from rig.arrays import Floats

#: Radii of the window (px): below, a window holds too few pixels for nine unknowns; above, edges need not be straight.
SMALLEST: Final = 3
LARGEST: Final = 9


def measure_corners(grey: NDArray[np.float32], start: Floats, edges: Floats, radius: int) -> Measured:
    """Measure corners whose windows are of one size.

    Args:
        grey: (rows, columns).
        start: (n, 2) px, at most a third of the radius off.
        edges: (n, 2, 2) unit vectors along the two edges, into a white field between them.
        radius: of the window, px.
    """
    side = np.arange(-radius, radius + 1)
    dx, dy = (part.ravel().astype(float) for part in np.meshgrid(side, side))
    inside = dx * dx + dy * dy <= radius * radius + 0.5
    dx, dy = dx[inside], dy[inside]
    middle = np.rint(start).astype(np.intp)
    height, width = grey.shape
    fits = np.all((middle >= radius) & (middle < np.array([width, height]) - radius), axis=1)
    safe = np.where(fits[:, None], middle, np.array([width // 2, height // 2]))
    values = grey[safe[:, 1, None] + dy.astype(np.intp), safe[:, 0, None] + dx.astype(np.intp)].astype(float)

    low, high = np.percentile(values, (10, 90), axis=1)
    angle = np.arctan2(edges[..., 1], edges[..., 0]) + np.array([0.5, -0.5]) * np.pi  # of the normals, into the field
    angle = _inwards(angle, edges)
    unknowns = np.column_stack(
        (start - middle, angle, (high - low) / 2, (high + low) / 2, np.zeros((len(start), 2)),
         np.full(len(start), np.log(FIRST_BLUR)))
    )  # fmt: skip
    fit = fitted(unknowns, lambda tried, these: _linearised(tried, values[these], dx, dy))
    moved = np.linalg.norm(fit.unknowns[:, :2] - (start - middle), axis=1)
    return Measured(
        middle + fit.unknowns[:, :2],
        fit.cofactor,
        np.sqrt(fit.cost / (len(dx) - unknowns.shape[1])),
        fit.unknowns[:, 4],
        np.exp(fit.unknowns[:, -1]),
        radius * np.swapaxes(edges, 1, 2),
        fits & fit.settled & (moved < radius / 2.0),
    )


def _inwards(angle: Floats, edges: Floats) -> Floats:
    """The normals' angles (n, 2), turned so that each points to the side of the other edge: a > 0 is white between."""
    normal = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    towards = np.einsum("nij,nij->ni", normal, edges[:, ::-1])
    return np.where(towards < 0.0, angle + np.pi, angle)


def _linearised(unknowns: Floats, values: Floats, dx: Floats, dy: Floats) -> tuple[Floats, Floats]:
    """Residuals (n, p) of the grey values, computed - observed, and derivatives (n, 9, p)."""
    x, y = dx - unknowns[:, 0, None], dy - unknowns[:, 1, None]
    blur = np.exp(unknowns[:, 8, None])
    a = unknowns[:, 4, None]
    parts = []
    for column in (2, 3):
        cos, sin = np.cos(unknowns[:, column, None]), np.sin(unknowns[:, column, None])
        far = (x * cos + y * sin) / blur
        parts.append((erf(far / np.sqrt(2.0)), np.sqrt(2.0 / np.pi) * np.exp(-0.5 * far * far), far, cos, sin))
    (e1, s1, f1, c1, n1), (e2, s2, f2, c2, n2) = parts
    pattern, light = e1 * e2, 1.0 + unknowns[:, 6, None] * dx + unknowns[:, 7, None] * dy
    shade = a * pattern + unknowns[:, 5, None]
    by_first, by_second = light * a * s1 * e2, light * a * e1 * s2
    slopes = np.stack(
        (
            -(by_first * c1 + by_second * c2) / blur,
            -(by_first * n1 + by_second * n2) / blur,
            by_first * (-x * n1 + y * c1) / blur,
            by_second * (-x * n2 + y * c2) / blur,
            light * pattern, light, shade * dx, shade * dy,
            -(by_first * f1 + by_second * f2),
        ),
        axis=1,
    )  # fmt: skip
    return light * shade - values, slopes
