"""Fits discs that a light shades, before a ground that no plane describes: a ball in the sun, half before its plate.

The disc's brightness is a plane. The ground behind it is continued from the pixels around it (`analysis.scene.ground`),
anew in each step from where the disc is.
Unknown are the centre, log R, two of stretch, and the three of the brightness. This is the model of
`analysis.scene.lit_fit` for one who knows neither light nor size yet.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from analysis.scene.disc import MARGIN, Disc, cover
from analysis.scene.ground import BLUR, CLEAR, REACH, ground_behind
from rig.arrays import Flags, Floats, Floats32, Integers

_MODEL = 0.05  # of the contrast: standard deviation of what a ball's surface differs from one grey value
_RADIUS_SPREAD = 0.3  # of log R about that of the blob
_EXPLAINED = 0.95  # of the variance around the ground
_CORRELATED = 4.0  # by how much covariances grow, since neighbouring pixels have the model's error in common
_UNKNOWNS = 8  # centre, log R, two of stretch, and the three of the brightness
_STRETCH_SPREAD = 0.2
_SHADE = 0.7  # of the contrast, per radius: what a light from the side does
_NEXT_TO_NOTHING = 1e-9  # weight of an unknown without prior: where an image is flat, nothing tells of it
_STEPS_MOST = 10
_FARTHEST, _LARGEST = 0.7, 0.25  # of a step: px; log R


@dataclass(slots=True, eq=False)
class _Discs:
    """m discs whose windows are equally large. Unknowns are 64 bits wide, pixels 32: they are noisier than that.

    Attributes:
        index: (m,) of the places.
        middle: (m, 2) of the windows, px of the image.
        x, y: (p,) of the pixels, px from there.
        grey, sigma: (m, p), sigma is infinite outside of the image.
        xy: (m, 2) centres, px from there.
        size: (m,) log R.
        stretch: (m, 2) as that of `analysis.scene.disc`.
        bright: (m, 3) their grey value at the centre, and what it gains to the right and down, per radius.
    """

    index: Integers
    middle: Integers
    x: Floats32
    y: Floats32
    grey: Floats32
    sigma: Floats32
    xy: Floats
    size: Floats
    stretch: Floats
    bright: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """The adjustment of m discs at their present unknowns.

    Attributes:
        normal: (m, 8, 8), right: (m, 8), with priors.
        v: (m, p) image minus model.
        ground: (m, p) behind the discs.
        contrast: (m,) of the discs' centres with it.
        weight: (m, p) of the pixels.
    """

    normal: Floats
    right: Floats
    v: Floats32
    ground: Floats32
    contrast: Floats32
    weight: Floats32


def fit_shaded_discs(grey: Floats, sigma: Floats, xy: Floats, radius: Floats) -> list[Disc | None]:
    """Fit a disc near each of some places.

    Args:
        grey: (rows, columns) image.
        sigma: (rows, columns) standard deviations of its grey values.
        xy: (n, 2) approximate centres, px.
        radius: (n,) approximate radii, px.

    Returns:
        n discs; None where a disc explains little of what differs from the ground.
    """
    found: list[Disc | None] = [None] * len(xy)
    for discs in _groups(grey, sigma, xy, radius):
        for i, disc in zip(discs.index.tolist(), _fitted(discs), strict=True):
            found[i] = disc
    return found


def _groups(grey: Floats, sigma: Floats, xy: Floats, radius: Floats) -> Iterator[_Discs]:
    half = np.ceil(radius * (1 + _RADIUS_SPREAD) + MARGIN).astype(int)
    rows, columns = grey.shape
    for own in np.unique(half).tolist():
        index = np.flatnonzero(half == own)
        steps = np.arange(-own, own + 1)
        centre = np.rint(xy[index]).astype(int)
        y, x = (part.ravel() for part in np.meshgrid(steps, steps, indexing="ij"))
        column, row = centre[:, :1] + x, centre[:, 1:] + y
        inside = (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
        at = np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)
        yield _Discs(
            index,
            centre,
            x.astype(np.float32),
            y.astype(np.float32),
            grey[at].astype(np.float32),
            np.where(inside, sigma[at], np.inf).astype(np.float32),
            xy[index] - centre,
            np.log(radius[index]),
            np.zeros((len(index), 2)),
            np.zeros((len(index), 3)),
        )


def _fitted(discs: _Discs) -> list[Disc | None]:
    """Least squares with priors of log R, stretch and shades (Gauss-Newton with bounded steps)."""
    start, first = discs.size.copy(), discs.xy.copy()
    discs.bright = np.zeros((len(first), 3))
    discs.bright[:, 0] = _of_disc(discs.grey, _model(discs)[1])
    for _ in range(_STEPS_MOST):
        equations = _equations(discs, start)
        step = np.linalg.solve(equations.normal, equations.right[..., None])[..., 0]
        discs.xy = discs.xy + np.clip(step[:, :2], -_FARTHEST, _FARTHEST)
        discs.size = np.clip(discs.size + np.clip(step[:, 2], -_LARGEST, _LARGEST), -1.0, 3.0)
        discs.stretch = np.clip(discs.stretch + np.clip(step[:, 3:5], -_LARGEST, _LARGEST), -0.6, 0.6)
        discs.bright = discs.bright + step[:, 5:]
    return _judged(discs, start, np.hypot(*(discs.xy - first).T))


def _judged(discs: _Discs, start: Floats, moved: Floats) -> list[Disc | None]:
    """Those that explain the difference from the ground and lie near their start; they moved by (m,) px."""
    last = _equations(discs, start)
    v, weight, radius = last.v, last.weight, np.exp(discs.size)
    used = weight > 0
    squares, behind = ((weight * off**2).sum(axis=1) for off in (v, discs.grey - last.ground))
    more = np.maximum(used.sum(axis=1) - _UNKNOWNS, 1)
    factor = np.sqrt((np.where(used, v / discs.sigma, 0.0) ** 2).sum(axis=1) / more)
    rms = np.sqrt((used * v**2).sum(axis=1) / np.maximum(used.sum(axis=1), 1))
    grown = _CORRELATED * np.maximum(1.0, squares / more)
    covariance = np.asarray(np.linalg.inv(last.normal)[:, :2, :2] * grown[:, None, None], float)
    good = (squares < (1 - _EXPLAINED) * behind) & (moved < np.maximum(1.2, radius))
    stretch = 2 * np.arctanh(np.minimum(0.99, np.hypot(*discs.stretch.T)))
    shapes = zip(radius.tolist(), stretch.tolist(), last.contrast.tolist(), rms.tolist(), factor.tolist(), strict=True)
    return [
        Disc(discs.middle[i] + discs.xy[i], covariance[i], size, BLUR, longer, above, off, ratio) if good[i] else None
        for i, (size, longer, above, off, ratio) in enumerate(shapes)
    ]


def _model(discs: _Discs) -> tuple[Floats32, Floats32, tuple[Floats32, ...], Flags]:
    """The ground (m, p), the discs (m, p), their derivatives by x, y, log R and stretch, and the fitted pixels."""
    dx, dy = (of - at.astype(np.float32)[:, None] for of, at in zip((discs.x, discs.y), discs.xy.T, strict=True))
    p, q = discs.stretch.astype(np.float32).T[..., None]
    u, w = (1 + p) * dx + q * dy, q * dx + (1 - p) * dy
    r, radius = np.sqrt(u * u + w * w) + np.float32(1e-9), np.exp(discs.size).astype(np.float32)
    beyond = r - radius[:, None]
    inside = np.isfinite(discs.sigma)
    around = inside & (beyond > CLEAR) & (beyond < MARGIN)
    side = int(np.sqrt(len(discs.x)))
    square = (len(r), side, side)
    ground = ground_behind(discs.grey.reshape(square), around.reshape(square)).reshape(r.shape).astype(np.float32)
    disc, by_r, by_radius = cover(r, radius, np.full(len(radius), BLUR, np.float32))
    along_u, along_w = by_r / r * u, by_r / r * w
    derivatives = (
        -(along_u * (1 + p) + along_w * q),
        -(along_u * q + along_w * (1 - p)),
        by_radius * radius[:, None],
        along_u * dx - along_w * dy,
        along_u * dy + along_w * dx,
    )
    return ground, disc, derivatives, inside & (beyond < REACH)


def _of_disc(values: Floats32, disc: Floats32) -> Floats32:
    """Means (m,) of values (m, p) under the discs."""
    return np.asarray((values * disc).sum(axis=1) / np.maximum(disc.sum(axis=1), np.float32(1e-9)))


def _equations(discs: _Discs, start: Floats) -> _Equations:
    ground, disc, derivatives, used = _model(discs)
    radius = np.exp(discs.size)[:, None]
    right, down = (
        ((of - at[:, None]) / radius).astype(np.float32) for of, at in zip((discs.x, discs.y), discs.xy.T, strict=True)
    )
    level, to_right, to_down = discs.bright.astype(np.float32).T[..., None]
    above = level + to_right * right + to_down * down - ground
    contrast = level[:, 0] - _of_disc(ground, disc)
    v = discs.grey - ground - above * disc
    weight = used / (discs.sigma**2 + (_MODEL * contrast[:, None]) ** 2)
    design = np.stack((*(above * part for part in derivatives), disc, disc * right, disc * down), axis=1)
    weighted = design * weight[:, None]
    normal = weighted @ design.swapaxes(1, 2)
    gradient = (weighted @ v[..., None])[..., 0]
    prior = np.full((len(start), _UNKNOWNS), _NEXT_TO_NOTHING)
    prior[:, 2], prior[:, 3:5] = _RADIUS_SPREAD**-2, _STRETCH_SPREAD**-2
    prior[:, 6:] = 1 / (_SHADE * np.maximum(np.abs(contrast), 1.0)[:, None]) ** 2
    off = np.zeros_like(prior)
    off[:, 2], off[:, 3:5], off[:, 6:] = start - discs.size, -discs.stretch, -discs.bright[:, 1:]
    return _Equations(
        normal + prior[:, :, None] * np.eye(_UNKNOWNS), gradient + prior * off, v, ground, contrast, weight
    )
