"""Fits straight borders to grey values: one edge, or the two edges of a bar, in sections along them.

Across a border the image is a step behind a blur s, the normal distribution F((u - d) / s). What lies on either side of
a border changes along it, a ski crosses snow, trees and a boot. So each section of some px has grey values of its own,
one beside each border, and only the geometry is common: where the borders are at both ends, and the blur. The grey
values are linear and are eliminated section by section (variable projection; Kaufman's derivative). Sections that the
model does not explain lose their weight as a whole: leaving out single pixels would move the border.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import ndtr

from rig.arrays import Floats
from rig.images.picture import Grey

SECTION_PX: Final = 2.0  #: length of a section
REACH_PX: Final = 3.5  #: beyond the outer borders that are fitted: a blur's border is over within two
_BLUR, _BLUR_SPREAD = 0.65, 0.5  # px, of lens and pixel; weak prior of its logarithm
_BLURS = np.log(0.3), np.log(3.0)
_ROBUST = 3.0  # times the usual misfit at which a section counts half
_STEPS_MOST, _SETTLED_PX = 25, 1e-4  # iterations; px
_LARGEST_STEP = 1.0  # px, and of the logarithm
_THINNEST = 1.0  # px; borders that are nearer to each other are one behind the blur
_MOVED = 0.5  # px from the start: then the pixels around the border are others
_PIXELS_LEAST = 6  # pixels of a section


@dataclass(frozen=True, slots=True, eq=False)
class Strip:
    """The pixels along a straight line, in s sections of at most p pixels.

    Attributes:
        start: (2,) where the line begins, px.
        along: (2,) unit vector.
        length: px.
        t: (s, p) where along the line, 0 at its start, 1 at its end.
        u: (s, p) px, to the right of it as the image is seen (y down).
        grey: (s, p) grey values.
        there: (s, p) 1 where there is a pixel, 0 elsewhere.
    """

    start: Floats
    along: Floats
    length: float
    t: Floats
    u: Floats
    grey: Floats
    there: Floats

    @property
    def across(self) -> Floats:
        """(2,) unit vector in which `u` grows."""
        return np.array((-self.along[1], self.along[0]))

    def point(self, t: Floats, u: Floats) -> Floats:
        """Points (..., 2) of the image, px."""
        along, across = t[..., None] * self.length * self.along, u[..., None] * self.across
        return np.asarray(self.start + along + across)

    def within(self, low: Floats, high: Floats) -> "Strip":
        """Only the pixels between two lines, each (2,) u at start and end."""
        line_low, line_high = (line[0] + (line[1] - line[0]) * self.t for line in (low, high))
        there = self.there * (self.u >= line_low) * (self.u <= line_high)
        enough = there.sum(axis=1) >= _PIXELS_LEAST
        return replace(self, **{k: getattr(self, k)[enough] for k in ("t", "u", "grey")}, there=there[enough])


@dataclass(frozen=True, slots=True, eq=False)
class Borders:
    """Fitted borders, b of them: 1, an edge, or 2, a bar.

    Attributes:
        ends: (b, 2) u of each border at the start and at the end of the strip, px.
        covariance: (2 b, 2 b) of them, a posteriori.
        blur: px.
        step: (b,) root mean square of the grey value's step at each border.
        evidence: (b,) sum of the squared steps of all sections over their variance; by chance as many as `sections`.
        sections: how many count.
        square: weighted sum of the squared residuals over the variance of a pixel's noise.
        redundancy: of it.
        explained: by how much the borders lower that sum against none, over the variance that remains.
        unknowns: that they have more than none: their places, and grey values in each section.
    """

    ends: Floats
    covariance: Floats
    blur: float
    step: Floats
    evidence: Floats
    sections: int
    square: float
    redundancy: float
    explained: float
    unknowns: int


def strip(image: Grey, start: Floats, end: Floats, reach: float) -> Strip:
    """The pixels within `reach` px of the line from `start` (2,) to `end` (2,), px.

    Parts of it outside the image hold no pixels.
    """
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    rows, columns = image.shape
    low = np.maximum(np.floor(np.minimum(start, end) - reach), 0).astype(int)
    high = np.minimum(np.ceil(np.maximum(start, end) + reach), (columns - 1, rows - 1)).astype(int)
    x, y = (part.ravel() for part in np.meshgrid(np.arange(low[0], high[0] + 1), np.arange(low[1], high[1] + 1)))
    t = ((x - start[0]) * along[0] + (y - start[1]) * along[1]) / length
    u = (y - start[1]) * along[0] - (x - start[0]) * along[1]
    chosen = (np.abs(u) <= reach) & (t >= 0) & (t <= 1)
    t, u, grey = t[chosen], u[chosen], image[y[chosen], x[chosen]].astype(float)
    count = max(1, round(length / SECTION_PX))
    section = np.minimum((t * count).astype(int), count - 1)
    order = np.argsort(section, kind="stable")
    sizes = np.bincount(section, minlength=count)
    place = np.arange(len(order)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    parts = np.zeros((4, count, max(1, int(sizes.max(initial=0)))))
    parts[:, section[order], place] = t[order], u[order], grey[order], np.ones(len(order))
    return Strip(start, along, length, *parts)


def fit_borders(pixels: Strip, ends: Floats, noise: float) -> Borders | None:
    """Fit borders.

    Args:
        pixels: around them.
        ends: (b, 2) approximate u of each border at start and end, px, from small to large u.
        noise: standard deviation of a pixel's grey value.

    Returns:
        The borders; None if there are too few pixels, or they leave them or each other.
    """
    found = _fitted(pixels, ends, noise)
    if found is not None and np.abs(found.ends - ends).max() > _MOVED:
        return _fitted(pixels, found.ends, noise)
    return found


def _fitted(pixels: Strip, ends: Floats, noise: float) -> Borders | None:
    """As `fit_borders`, with the pixels around the start."""
    near = pixels.within(ends[0] - REACH_PX, ends[-1] + REACH_PX)
    if near.there.sum() < 2 * _PIXELS_LEAST:
        return None
    theta = np.append(ends.ravel(), np.log(_BLUR))
    weight, damping = np.ones(len(near.t)), 1e-3
    seen = _seen(near, theta, noise)
    cost, equations = _cost(theta, seen, weight), _equations(near, theta, seen, weight, noise)
    for _ in range(_STEPS_MOST):
        normal = equations[0].copy()
        normal.flat[:: len(normal) + 1] *= 1 + damping
        step = np.clip(np.linalg.solve(normal, equations[1]), -_LARGEST_STEP, _LARGEST_STEP)
        trial = theta + step
        trial[-1] = np.clip(trial[-1], *_BLURS)
        new = _seen(near, trial, noise)
        if _cost(trial, new, weight) <= cost:
            theta, seen, damping = trial, new, damping / 5
            weight = _weights(seen)
            cost, equations = _cost(theta, seen, weight), _equations(near, theta, seen, weight, noise)
            if np.abs(step[:-1]).max() < _SETTLED_PX:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    return _judged(near, theta, ends, seen, equations[0], weight, noise)


@dataclass(frozen=True, slots=True, eq=False)
class _Seen:
    """What borders leave unexplained.

    Attributes:
        z: (b, s, p) distances from the borders over the blur.
        columns: (s, p, b + 1) shares of the grey values of a section.
        normal: (s, b + 1, b + 1) equations of these.
        linear: (s, b + 1) grey values.
        off: (s, p) residuals.
        squares: (s,) of them, over the noise.
        counts: (s,) pixels.
    """

    z: Floats
    columns: Floats
    normal: Floats
    linear: Floats
    off: Floats
    squares: Floats
    counts: Floats


def _seen(pixels: Strip, theta: Floats, noise: float) -> _Seen:
    """Borders with the grey values that fit best, section by section."""
    borders = (len(theta) - 1) // 2
    ends, blur = theta[:-1].reshape(borders, 2), np.exp(theta[-1])
    line = ends[:, 0, None, None] + (ends[:, 1] - ends[:, 0])[:, None, None] * pixels.t
    z = (pixels.u - line) / blur
    shape = np.concatenate((np.ones_like(z[:1]), ndtr(z))) * pixels.there  # (b + 1, s, p)
    columns = shape.transpose(1, 2, 0)
    normal = columns.transpose(0, 2, 1) @ columns + 1e-6 * np.eye(borders + 1)
    linear = np.linalg.solve(normal, columns.transpose(0, 2, 1) @ pixels.grey[..., None])
    off = pixels.grey * pixels.there - (columns @ linear)[..., 0]
    counts = np.asarray(pixels.there.sum(axis=1), float)
    grey = np.asarray(linear[..., 0], float)
    return _Seen(z, columns, normal, grey, off, (off**2).sum(axis=1) / noise**2, counts)


def _cost(theta: Floats, seen: _Seen, weight: Floats) -> float:
    return float(weight @ seen.squares) + _BLUR_SPREAD**-2 * float(np.log(_BLUR) - theta[-1]) ** 2


def _equations(pixels: Strip, theta: Floats, seen: _Seen, weight: Floats, noise: float) -> tuple[Floats, Floats]:
    """Normal equations of the geometry and their right side, the grey values of each section eliminated."""
    z, columns = seen.z, seen.columns
    density = np.exp(-0.5 * z**2) / np.sqrt(2 * np.pi) * pixels.there * seen.linear[:, 1:].T[..., None]
    by_line = -density / np.exp(theta[-1])
    rows = [part * factor for part in by_line for factor in (1 - pixels.t, pixels.t)]
    rows.append(-(density * z).sum(axis=0))
    design = np.stack(rows, axis=-1)  # (s, p, 2 b + 1)
    design = design - columns @ np.linalg.solve(seen.normal, columns.transpose(0, 2, 1) @ design)
    w = weight / noise**2
    prior = np.zeros(len(theta))
    prior[-1] = _BLUR_SPREAD**-2
    weighed = (design * w[:, None, None]).reshape(-1, len(theta)).T
    full = weighed @ design.reshape(-1, len(theta)) + np.diag(prior + 1e-9)
    gradient = weighed @ seen.off.ravel()
    gradient[-1] += prior[-1] * (np.log(_BLUR) - theta[-1])
    return full, gradient


def _weights(now: _Seen) -> Floats:
    """Weights of the sections (Cauchy), against the usual one."""
    free = np.maximum(now.counts - now.linear.shape[1], 1)
    misfit = np.sqrt(now.squares / free)
    return np.asarray(1 / (1 + (misfit / (_ROBUST * max(1.0, float(np.median(misfit))))) ** 2))


def _judged(
    pixels: Strip, theta: Floats, start: Floats, now: _Seen, normal: Floats, weight: Floats, noise: float
) -> Borders | None:
    ends = theta[:-1].reshape(-1, 2)
    if np.abs(ends - start).max() > REACH_PX or (np.diff(ends, axis=0) < _THINNEST).any():
        return None
    linear = ends.shape[0] + 1
    redundancy = float(weight @ (now.counts - linear)) - len(theta)
    if redundancy < len(theta):
        return None
    square = float(weight @ now.squares)
    factor = max(1.0, square / redundancy)
    level = (pixels.grey * pixels.there).sum(axis=1) / pixels.there.sum(axis=1)
    without = float(weight @ (((pixels.grey - level[:, None]) * pixels.there) ** 2).sum(axis=1)) / noise**2
    step = np.sqrt((weight @ now.linear[:, 1:] ** 2) / weight.sum())
    variance = np.diagonal(np.linalg.inv(now.normal), axis1=1, axis2=2)  # of the grey values, for noise 1
    evidence = weight @ (now.linear[:, 1:] ** 2 / variance[:, 1:]) / (noise**2 * factor)
    covariance = np.asarray(np.linalg.inv(normal)[:-1, :-1] * factor, float)
    explained, unknowns = (without - square) / factor, len(theta) + len(ends) * len(weight)
    blur, sections = float(np.exp(theta[-1])), len(weight)
    return Borders(ends, covariance, blur, step, evidence, sections, square, redundancy, explained, unknowns)
