"""Fits a blurred disc to grey values: centre with covariance, radius, contrast. For balls and for the jumper's markers.

The image of a uniform disc of radius R through a lens (a Gaussian of standard deviation s, which integration over a
pixel widens by 1/12 px^2) is the noncentral chi-squared distribution with two degrees of freedom:

    cover(r) = P(|N((r, 0), s^2 I)| <= R).

A small ellipse is the same in stretched coordinates. The fit is weighted least squares of ten unknowns: centre, log R,
log s, two of stretch, contrast, and a plane as background. Signalised features should be spherical so that their centre
of gravity can be found (paper, section 3); the model is symmetric, so the errors of its shape do not move the centre.

The sigma of the centre is that of the adjustment a posteriori: the residuals around this very disc tell how large the
noise is there, whatever made it (sensor, texture, compression).
"""

from dataclasses import dataclass
from math import exp, isfinite, log
from typing import Final

import numpy as np
from scipy.special import chndtr, erfc, i0e, i1e

from rig.arrays import Floats

_UNKNOWNS = 10
MARGIN: Final = 3.6  #: px beyond the disc that are fitted
_WIDER, _MARGIN_OF_WIDER = 1.35, 2.2  # times the radius and px: of a large one that is approximate more is needed
_NODES = 0.3  # blurs between the nodes of a profile
_SHARP = 8.0  # R / s: from there on the border is that of a half plane, with the curvature's first term
_BLUR, _BLUR_SPREAD = 0.75, 0.5  # px; weak prior of log s, because radius and blur of a small disc go together
_LOG_BLUR = log(_BLUR)
_STRETCH_SPREAD = 0.2  # weak prior of the stretch
STEPS: Final = 25  #: iterations
_ENOUGH, _ENOUGH_OF_SHAPE = 1e-4, 1e-3  # of a step: px; log R, log s and stretch
_LOG_RADII, _LOG_BLURS = (log(0.2), log(40)), (log(0.15), log(8))  # that a fit may go through
_SETTLED = 2e-5  # relative decrease of the square sum: a twentieth of a sigma or less
_TRIAL_STEPS, _POOR = 4, 0.25  # steps after which the residuals over the contrast must be smaller than that
POOR_START: Final = 0.4  #: residuals over contrast, before the first step
_RADII = (0.75, 1.0, 1.33)  # times the approximate radius, to start from
_LARGEST_STEP = 0.5  # of log R, log s and stretch
_SMALLEST_SIGMA = 5e-4  # px


@dataclass(frozen=True, slots=True, eq=False)
class Disc:
    """A fitted disc; pixel frame.

    Attributes:
        xy: (2,) centre, px.
        covariance: (2, 2) of the centre, px^2, a posteriori.
        radius: of the disc before the blur, px: geometric mean of both axes.
        blur: standard deviation of the blur, px.
        stretch: log of the ratio of the axes, >= 0.
        contrast: grey value of the disc minus background; negative: dark.
        rms: root mean square of the residuals, grey values.
        factor: a-posteriori / a-priori standard deviation.
    """

    xy: Floats
    covariance: Floats
    radius: float
    blur: float
    stretch: float
    contrast: float
    rms: float
    factor: float

    @property
    def sigma(self) -> Floats:
        """(2,) standard deviations of x and y, px."""
        return np.sqrt(np.diagonal(self.covariance))


def fit_disc(
    grey: Floats,
    sigma: Floats,
    xy: Floats,
    radius: float,
    mask: Floats | None = None,
    margin: float = MARGIN,
    poor_start: float = POOR_START,
    steps: int = STEPS,
) -> Disc | None:
    """Fit a disc near a place.

    Args:
        grey: (rows, columns) image.
        sigma: (rows, columns) standard deviations of its grey values; their scale does not matter.
        xy: (2,) approximate centre, px.
        radius: approximate radius, px.
        mask: (rows, columns) where the image may be used; everywhere if left out.
        margin: so far beyond the disc its surroundings are one plane, px.
        poor_start: residuals over contrast from which on a disc of the approximate place and radius is given up.
        steps: iterations at most; few are enough for a clear disc.

    Returns:
        The disc; None if nothing there is one: no convergence, it leaves the place, or the image ends.
    """
    theta = np.array([xy[0], xy[1], np.log(max(radius, 0.7)), np.log(_BLUR), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    window = None
    for again in range(2):  # the second time with a window of the radius that was found
        window = _window(grey, sigma, theta[:2], float(np.exp(theta[2])), mask, margin)
        if window is None:
            return None
        start = _started(theta, window, _RADII if not again else (1.0,), poor_start)
        fitted = None if start is None else _fitted(start, *window, steps)
        if fitted is None or np.hypot(*(fitted[:2] - xy)) > max(1.5, radius):
            return None
        wider = abs(fitted[2] - theta[2]) > 0.15
        theta = fitted
        if not wider or again:
            break
    return None if window is None else _result(theta, *window)


def cover(r: Floats, radius: float, blur: float) -> tuple[Floats, Floats, Floats]:
    """Blurred disc at distances r (n,): value, derivative by r, derivative by the radius."""
    if radius / blur > _SHARP:
        u = (r - radius + blur**2 / (2 * radius)) / blur
        edge = np.exp(-0.5 * u**2) / (np.sqrt(2 * np.pi) * blur)
        return np.asarray(0.5 * erfc(u / np.sqrt(2))), -edge, edge
    a, b = r / blur, radius / blur
    common = (b / blur) * np.exp(-0.5 * (a - b) ** 2)
    slope = -common * i1e(a * b)
    return _share(r, radius, blur), np.asarray(slope), np.asarray(common * i0e(a * b))


def _share(r: Floats, radius: float, blur: float) -> Floats:
    """The distribution function itself, which is slow: cubic between nodes that are dense enough for 1e-5."""
    b = radius / blur
    last = float(r.max(initial=0.0))
    count = int(last / (_NODES * blur)) + 2
    if 2 * count > len(r):
        return np.asarray(chndtr(b * b, 2.0, (r / blur) ** 2))
    width = last / (count - 1)
    a = np.arange(count) * (width / blur)
    value = chndtr(b * b, 2.0, a * a)
    by_r = -(b / blur) * np.exp(-0.5 * (a - b) ** 2) * i1e(a * b) * width
    place = r / width
    left = np.minimum(place.astype(np.intp), count - 2)
    t = place - left
    # the cubic of each step as a polynomial: value, slope, and what makes it end as the next one begins
    rise, slope, next_slope = np.diff(value), by_r[:-1], by_r[1:]
    square, cube = (3 * rise - 2 * slope - next_slope)[left], (slope + next_slope - 2 * rise)[left]
    return np.asarray(value[left] + t * (slope[left] + t * (square + t * cube)))


_Window = tuple[Floats, Floats, Floats]


def _window(
    grey: Floats, sigma: Floats, xy: Floats, radius: float, mask: Floats | None, margin: float
) -> _Window | None:
    """Places (n, 2), grey values (n,) and sigmas (n,) around a disc; None if too much of it is outside."""
    reach = max(radius + margin, _WIDER * radius + min(margin, _MARGIN_OF_WIDER))
    rows, columns = grey.shape
    left, right = int(np.ceil(xy[0] - reach)), int(np.floor(xy[0] + reach))
    top, bottom = int(np.ceil(xy[1] - reach)), int(np.floor(xy[1] + reach))
    if not (radius < xy[0] < columns - 1 - radius and radius < xy[1] < rows - 1 - radius):
        return None
    part = slice(max(0, top), min(rows, bottom + 1)), slice(max(0, left), min(columns, right + 1))
    x, y = np.arange(part[1].start, part[1].stop), np.arange(part[0].start, part[0].stop)
    inside = (x - xy[0]) ** 2 + ((y - xy[1]) ** 2)[:, None] <= reach**2
    if mask is not None:
        inside &= mask[part] > 0
    row, column = np.nonzero(inside)
    if len(row) < 2 * _UNKNOWNS:
        return None
    places = np.empty((len(row), 2))
    places[:, 0], places[:, 1] = x[column], y[row]
    return places, grey[part][inside].astype(float), sigma[part][inside].astype(float)


def _started(theta: Floats, window: _Window, factors: tuple[float, ...], poor: float) -> Floats | None:
    """Start values with the best of some radii; None if no disc is near: no fit would mend such residuals."""
    places, grey, sigma = window
    dx, dy = places[:, 0] - theta[0], places[:, 1] - theta[1]
    r = np.hypot(dx, dy)
    radii = np.array(factors) * float(np.exp(theta[2]))
    n = len(radii)
    columns = np.empty((n + 4, len(r)))  # of the design, one cover for each radius, and the grey values
    # the border as that of a half plane is near enough for a start
    columns[:n] = 0.5 * erfc((r - radii[:, None]) / (np.sqrt(2) * np.exp(theta[3])))
    columns[n], columns[n + 1], columns[n + 2], columns[n + 3] = 1.0, dx, dy, grey
    columns /= sigma
    products = columns @ columns.T
    own = np.column_stack((np.arange(n), np.tile(np.arange(n, n + 3), (n, 1))))
    normal = products[own[:, :, None], own[:, None]] + 1e-12 * np.eye(4)
    right = products[own, -1]
    linear = np.linalg.solve(normal, right[..., None])[..., 0]
    squares = (products[-1, -1] - (linear * right).sum(axis=1)) / len(r)
    best = int(squares.argmin())
    if not np.sqrt(max(0.0, squares[best])) * _middle(sigma) < poor * abs(float(linear[best, 0])):
        return None
    return np.concatenate((theta[:2], [np.log(radii[best])], theta[3:6], linear[best]))


def _middle(values: Floats) -> float:
    """The median, or its upper neighbour."""
    return float(np.partition(values, len(values) // 2)[len(values) // 2])


def _fitted(theta: Floats, places: Floats, grey: Floats, sigma: Floats, steps: int) -> Floats | None:
    """Levenberg-Marquardt; None if it does not converge."""
    damping, cost = 1e-3, np.inf
    middle = _middle(sigma)
    normal, gradient = np.eye(_UNKNOWNS), np.zeros(_UNKNOWNS)
    best = theta
    for step_number in range(steps):
        new_cost, new_normal, new_gradient = _normal_equations(theta, places, grey, sigma)
        if new_cost <= cost:
            gain = cost - new_cost
            best, cost, normal, gradient, damping = theta, new_cost, new_normal, new_gradient, damping / 8
            if gain < _SETTLED * cost:
                break
            if step_number >= _TRIAL_STEPS and cost > len(grey) * (_POOR * theta[6] / middle) ** 2:
                return None
        else:
            damping *= 10
            if damping > 1e8:
                break
        damped = normal.copy()
        diagonal = damped.reshape(-1)[:: _UNKNOWNS + 1]
        diagonal += damping * (diagonal + 1e-12)
        step = np.linalg.solve(damped, gradient)
        np.minimum(np.maximum(step[2:6], -_LARGEST_STEP, out=step[2:6]), _LARGEST_STEP, out=step[2:6])
        if not isfinite(step.sum()):
            return None
        theta = best + step
        off = np.abs(step[:6]).tolist()
        if max(off[:2]) < _ENOUGH and max(off[2:]) < _ENOUGH_OF_SHAPE:
            best = theta
            break
        if not (_LOG_RADII[0] < theta[2] < _LOG_RADII[1] and _LOG_BLURS[0] < theta[3] < _LOG_BLURS[1]):
            return None
    else:
        return None
    return best


def _normal_equations(theta: Floats, places: Floats, grey: Floats, sigma: Floats) -> tuple[float, Floats, Floats]:
    """Cost, normal matrix and right-hand side, priors included."""
    value, design = _model(theta, places)
    v = (grey - value) / sigma
    design /= sigma
    normal, gradient, cost = design @ design.T, design @ v, float(v @ v)
    for i, mean, spread in ((3, _LOG_BLUR, _BLUR_SPREAD), (4, 0.0, _STRETCH_SPREAD), (5, 0.0, _STRETCH_SPREAD)):
        off = mean - float(theta[i])
        normal[i, i] += spread**-2
        gradient[i] += off / spread**2
        cost += (off / spread) ** 2
    return cost, normal, gradient


def _model(theta: Floats, places: Floats) -> tuple[Floats, Floats]:
    """Grey values (n,) and their derivatives (10, n)."""
    x, y, log_r, log_s, p, q, contrast, *plane = theta.tolist()
    radius, blur = exp(log_r), exp(log_s)
    dx, dy = places[:, 0] - x, places[:, 1] - y
    # stretched coordinates (I + [[p, q], [q, -p]]) d
    u, w = (1 + p) * dx + q * dy, q * dx + (1 - p) * dy
    r = np.sqrt(u * u + w * w) + 1e-9
    value, by_r, by_radius = cover(r, radius, blur)
    nu, nw = u / r, w / r
    design = np.empty((_UNKNOWNS, len(r)))
    design[0] = -by_r * (nu * (1 + p) + nw * q)
    design[1] = -by_r * (nu * q + nw * (1 - p))
    design[2] = by_radius * radius
    design[3] = -(r * by_r + radius * by_radius)  # the cover depends on the ratios of r, R and s alone
    design[4] = by_r * (nu * dx - nw * dy)
    design[5] = by_r * (nu * dy + nw * dx)
    design[:6] *= contrast
    design[6] = value
    design[7] = 1.0
    design[8], design[9] = dx, dy
    # the plane hangs on the centre, whose derivative it therefore has too
    design[0] -= plane[1]
    design[1] -= plane[2]
    return contrast * value + plane[0] + plane[1] * dx + plane[2] * dy, design


def _result(theta: Floats, places: Floats, grey: Floats, sigma: Floats) -> Disc | None:
    _, normal, _ = _normal_equations(theta, places, grey, sigma)
    value, _ = _model(theta, places)
    v = (grey - value) / sigma
    factor = float(np.sqrt(v @ v / (len(v) - _UNKNOWNS)))
    try:
        covariance = np.linalg.inv(normal)[:2, :2] * factor**2
    except np.linalg.LinAlgError:
        return None
    if not (np.isfinite(covariance).all() and (np.diagonal(covariance) > 0).all()):
        return None
    covariance = covariance + _SMALLEST_SIGMA**2 * np.eye(2)
    stretch = 2 * float(np.arctanh(min(0.99, float(np.hypot(theta[4], theta[5])))))
    rms = float(np.sqrt(np.mean((grey - value) ** 2)))
    shape = float(np.exp(theta[2])), float(np.exp(theta[3])), stretch
    return Disc(theta[:2].copy(), covariance, *shape, float(theta[6]), rms, factor)
