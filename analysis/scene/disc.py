"""Fits blurred discs to grey values, many at once: centre with covariance, radius, contrast. For balls.

The image of a uniform disc of radius R through a lens (a Gaussian of standard deviation s, which integration over a
pixel widens by 1/12 px^2) is the noncentral chi-squared distribution with two degrees of freedom:

    cover(r) = P(|N((r, 0), s^2 I)| <= R).

A small ellipse is the same in stretched coordinates. The fit is weighted least squares of ten unknowns: centre, log R,
log s, two of stretch, contrast, and a plane as background. Signalised features should be spherical so that their centre
of gravity can be found (paper, section 3); the model is symmetric, so the errors of its shape do not move the centre.

Each disc has an adjustment and a damping of its own (Levenberg-Marquardt); those with windows of similar size are
computed together, and leave when they are settled or given up.

The sigma of the centre is that of the adjustment a posteriori: the residuals around this very disc tell how large the
noise is there, whatever made it (sensor, texture, compression).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import log, pi, sqrt
from typing import Final

import numpy as np
from scipy.special import chndtr, erfc, i0e, i1e

from rig.arrays import Flags, Floats, Integers, Reals

_UNKNOWNS = 10
MARGIN: Final = 3.6  #: px beyond the disc that are fitted
_WIDER, _MARGIN_OF_WIDER = 1.35, 2.2  # times the radius and px: of a large one that is approximate more is needed
_NODES = 0.3  # blurs between the nodes of a profile
_TAIL = 6.0  # blurs from the border: there a profile is 1 or 0
_SIMILAR, _TOGETHER = 1.4, 16_000  # ratio of the reaches of windows that are computed together, and their pixels
_SHARP = 8.0  # R / s: from there on the border is that of a half plane, with the curvature's first term
_BLUR, _BLUR_SPREAD = 0.75, 0.5  # px; weak prior of log s, because radius and blur of a small disc go together
_LOG_BLUR = log(_BLUR)
_STRETCH_SPREAD = 0.2  # weak prior of the stretch
STEPS: Final = 25  #: iterations
_SETTLED_PX, _SETTLED_SHAPE = 1e-4, 1e-3  # of a step: px; log R, log s and stretch
_LOG_RADII, _LOG_BLURS = (log(0.2), log(40)), (log(0.15), log(8))  # that a fit may go through
_SETTLED = 2e-5  # relative decrease of the square sum: a twentieth of a sigma or less
_TRIAL_STEPS, _POOR = 4, 0.25  # steps after which the residuals over the contrast must be smaller than that
POOR_START: Final = 0.4  #: residuals over contrast, before the first step
_RADII = (0.75, 1.0, 1.33)  # times the approximate radius, to start from
_WINDOW_FITS = 0.15  # of log R, by which a disc may be larger or smaller than its window was made for
_MOST_DAMPED = 1e8  # no step helps
_LARGEST_STEP = 0.5  # of log R, log s and stretch
_SMALLEST_SIGMA = 5e-4  # px
#: Mean and inverse variance of the unknowns that have a prior.
_PRIOR = np.zeros((2, _UNKNOWNS))
_PRIOR[:, 3], _PRIOR[1, 4:6] = (_LOG_BLUR, _BLUR_SPREAD**-2), _STRETCH_SPREAD**-2


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


def fit_discs(
    grey: Floats,
    sigma: Floats,
    xy: Floats,
    radius: Floats,
    margin: float = MARGIN,
    poor_start: float = POOR_START,
    steps: int = STEPS,
) -> list[Disc | None]:
    """Fit a disc near each of some places.

    Args:
        grey: (rows, columns) image.
        sigma: (rows, columns) standard deviations of its grey values; their scale does not matter, and where they are
            infinite the image is not used.
        xy: (n, 2) approximate centres, px.
        radius: (n,) approximate radii, px.
        margin: so far beyond a disc its surroundings are one plane, px.
        poor_start: residuals over contrast from which on a disc of the approximate place and radius is given up.
        steps: iterations at most; few are enough for a clear disc.

    Returns:
        n discs; None if nothing there is one: no convergence, it leaves the place, or the image ends.
    """
    theta = np.zeros((len(xy), _UNKNOWNS))
    theta[:, :2], theta[:, 2], theta[:, 3] = xy, np.log(np.maximum(radius, 0.7)), _LOG_BLUR
    discs: list[Disc | None] = [None] * len(xy)
    waiting = np.arange(len(xy))
    for factors in (_RADII, (1.0,)):  # the second time with windows of the radii that were found
        size = theta[:, 2].copy()
        wider: list[Integers] = [waiting[:0]]
        for tried, around in _windows(grey, sigma, theta, _inside(grey, theta, waiting), margin):
            start, promising = _started(theta[tried], around, factors, poor_start)
            fitted, found = _fitted(start, promising, around, steps)
            found &= np.hypot(*(fitted[:, :2] - xy[tried]).T) <= np.maximum(1.5, radius[tried])
            theta[tried[found]] = fitted[found]
            done = np.abs(theta[tried, 2] - size[tried]) <= (_WINDOW_FITS if len(factors) > 1 else np.inf)
            last = found & done
            wider.append(tried[found & ~done])
            for i, disc in zip(tried[last].tolist(), _results(theta[tried[last]], around.only(last)), strict=True):
                discs[i] = disc
        waiting = np.concatenate(wider)
    return discs


def cover(r: Reals, radius: Reals, blur: Reals) -> tuple[Reals, Reals, Reals]:
    """Blurred discs (n,) at distances r (n, k): value, derivative by r, derivative by the radius."""
    value, by_r, by_radius = np.empty((3, *r.shape), r.dtype)
    sharp = radius / blur > _SHARP
    for chosen, of in ((sharp, _cover_sharp), (~sharp, _cover_soft)):
        if chosen.any():
            parts = of(r[chosen], radius[chosen, None], blur[chosen, None])
            value[chosen], by_r[chosen], by_radius[chosen] = parts
    return value, by_r, by_radius


def _cover_sharp(r: Reals, radius: Reals, blur: Reals) -> tuple[Reals, Reals, Reals]:
    u = (r - radius + blur**2 / (2 * radius)) / blur
    edge = np.exp(-0.5 * u**2) / (sqrt(2 * pi) * blur)
    return np.asarray(0.5 * erfc(u / sqrt(2))), -edge, edge


def _cover_soft(r: Reals, radius: Reals, blur: Reals) -> tuple[Reals, Reals, Reals]:
    a, b = r / blur, radius / blur
    common = (b / blur) * np.exp(-0.5 * (a - b) ** 2)
    return _share(a, b), np.asarray(-common * i1e(a * b)), np.asarray(common * i0e(a * b))


def _share(a: Reals, b: Reals) -> Reals:
    """The distribution function itself, which is slow: cubic between nodes that are dense enough for 1e-5.

    Args:
        a: (n, k) distances, in blurs.
        b: (n, 1) radii, in blurs.
    """
    b = b.astype(float)
    first = np.maximum(0.0, np.floor((b - _TAIL) / _NODES))  # from there on it is not 1
    last = min(float(a.max()), float(b.max()) + _TAIL) / _NODES - float(first.min())
    count = min(int(last), int(2 * _TAIL / _NODES) + 1) + 2
    node = (first + np.arange(count)) * _NODES
    value = chndtr(b * b, 2.0, node * node)
    by_a = -b * np.exp(-0.5 * (node - b) ** 2) * i1e(node * b) * _NODES
    place = np.clip(a / _NODES - first.astype(a.dtype), 0.0, count - 1)
    left = np.minimum(place.astype(np.intp), count - 2)
    t = place - left.astype(place.dtype)
    left += (np.arange(len(a)) * (count - 1))[:, None]
    # the cubic of each step as a polynomial: value, slope, and what makes it end as the next one begins
    rise, slope, next_slope = np.diff(value), by_a[:, :-1], by_a[:, 1:]
    terms = value[:, :-1], slope, 3 * rise - 2 * slope - next_slope, slope + next_slope - 2 * rise
    constant, linear, square, cube = (np.take(term.astype(a.dtype).ravel(), left) for term in terms)
    return np.asarray(constant + t * (linear + t * (square + t * cube)))


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """The pixels around n discs.

    Attributes:
        x, y: (n, k) places.
        grey: (n, k) grey values.
        weight: (n, k) one over the sigmas; 0: the pixel is not used.
        middle: (n,) of the sigmas.
    """

    x: Floats
    y: Floats
    grey: Floats
    weight: Floats
    middle: Floats

    def only(self, chosen: Integers | Flags) -> "_Windows":
        """Those of some discs."""
        return _Windows(self.x[chosen], self.y[chosen], self.grey[chosen], self.weight[chosen], self.middle[chosen])

    @property
    def count(self) -> Integers:
        """(n,) of the pixels that are used."""
        return np.asarray(np.count_nonzero(self.weight, axis=1))


def _inside(grey: Floats, theta: Floats, chosen: Integers) -> Integers:
    """Those of the chosen discs that lie in the image, the smallest first."""
    room = np.minimum(theta[chosen, :2], np.array(grey.shape[::-1]) - 1 - theta[chosen, :2]).min(axis=1)
    chosen = chosen[room > np.exp(theta[chosen, 2])]
    return np.asarray(chosen[np.argsort(theta[chosen, 2], kind="stable")])


def _windows(
    grey: Floats, sigma: Floats, theta: Floats, order: Integers, margin: float
) -> Iterator[tuple[Integers, _Windows]]:
    """Discs of similar size, in their order from small to large, and their windows; without those of few pixels."""
    radius = np.exp(theta[:, 2])
    reach = np.maximum(radius + margin, _WIDER * radius + min(margin, _MARGIN_OF_WIDER))
    while len(order):
        most = min(_SIMILAR * reach[order[0]], reach[order[-1]])
        together = max(1, int(_TOGETHER / (np.pi * most**2)))
        chosen = order[: min(together, int(np.searchsorted(reach[order], most, side="right")))]
        order = order[len(chosen) :]
        windows = _window(grey, sigma, theta[chosen, :2], reach[chosen])
        enough = windows.count >= 2 * _UNKNOWNS
        yield chosen[enough], windows.only(enough)


def _window(grey: Floats, sigma: Floats, xy: Floats, reach: Floats) -> _Windows:
    """The pixels within reach (n,) of places (n, 2)."""
    rows, columns = grey.shape
    centre = np.rint(xy).astype(int)
    half = int(reach.max() + 0.5)
    y, x = (part.ravel() for part in np.mgrid[-half : half + 1, -half : half + 1])
    within = x * x + y * y <= (float(reach.max()) + np.sqrt(0.5)) ** 2
    x, y = x[within] + centre[:, :1], y[within] + centre[:, 1:]
    near = (x - xy[:, :1]) ** 2 + (y - xy[:, 1:]) ** 2 <= reach[:, None] ** 2
    near &= (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    place = np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)
    spread = np.where(near, sigma[place], np.inf)
    middle = np.sort(spread)[np.arange(len(xy)), np.isfinite(spread).sum(axis=1) // 2]
    return _Windows(x.astype(float), y.astype(float), grey[place].astype(float), 1 / spread, middle)


def _started(theta: Floats, windows: _Windows, factors: tuple[float, ...], poor: float) -> tuple[Floats, Flags]:
    """Start values with the best of some radii; and whether a disc is near: no fit would mend such residuals."""
    dx, dy = windows.x - theta[:, :1], windows.y - theta[:, 1:2]
    r = np.hypot(dx, dy)
    radii = np.exp(theta[:, 2:3]) * np.array(factors)
    n = len(factors)
    columns = np.empty((len(theta), n + 4, r.shape[1]))  # of the design, a cover for each radius, and the grey values
    # the border as that of a half plane is near enough for a start
    columns[:, :n] = 0.5 * erfc((r[:, None] - radii[..., None]) / (np.sqrt(2) * np.exp(theta[:, 3, None, None])))
    columns[:, n], columns[:, n + 1], columns[:, n + 2], columns[:, n + 3] = 1.0, dx, dy, windows.grey
    columns *= windows.weight[:, None]
    products = columns @ columns.transpose(0, 2, 1)
    own = np.column_stack((np.arange(n), np.tile(np.arange(n, n + 3), (n, 1))))
    normal = products[:, own[:, :, None], own[:, None]] + 1e-12 * np.eye(4)
    right = products[:, own, -1]
    linear = np.linalg.solve(normal, right[..., None])[..., 0]
    squares = (products[:, -1:, -1] - (linear * right).sum(axis=2)) / windows.count[:, None]
    best = np.arange(len(theta)), squares.argmin(axis=1)
    misfit = np.sqrt(np.maximum(0.0, squares[best])) * windows.middle
    start = np.column_stack((theta[:, :2], np.log(radii[best]), theta[:, 3:6], linear[best]))
    return start, np.asarray(misfit < poor * np.abs(start[:, 6]))


def _fitted(theta: Floats, promising: Flags, windows: _Windows, steps: int) -> tuple[Floats, Flags]:
    """Unknowns by Levenberg-Marquardt, and whether each converged; those that promise nothing are left as they are."""
    n, poor = len(theta), windows.count * (_POOR / windows.middle) ** 2
    best, trial, converged = theta.copy(), theta.copy(), np.zeros(n, bool)
    damping, cost = np.full(n, 1e-3), np.full(n, np.inf)
    normal, gradient = np.tile(np.eye(_UNKNOWNS), (n, 1, 1)), np.zeros((n, _UNKNOWNS))
    active, windows = np.flatnonzero(promising), windows.only(promising)
    for number in range(steps):
        if not len(active):
            break
        new_cost, new_normal, new_gradient = _normal_equations(trial[active], windows)
        better = new_cost <= cost[active]
        settled = better & (cost[active] - new_cost < _SETTLED * new_cost)
        won = active[better]
        best[won], cost[won] = trial[won], new_cost[better]
        normal[won], gradient[won] = new_normal[better], new_gradient[better]
        damping[active] *= np.where(better, 1 / 8, 10.0)
        settled |= damping[active] > _MOST_DAMPED
        given_up = better & (number >= _TRIAL_STEPS) & (cost[active] > poor[active] * best[active, 6] ** 2)
        step = _step(normal[active], gradient[active], damping[active])
        size = np.abs(step[:, :6])
        small = ~settled & (size[:, :2].max(axis=1) < _SETTLED_PX) & (size[:, 2:].max(axis=1) < _SETTLED_SHAPE)
        trial[active] = best[active] + step
        best[active[small & ~given_up]] = trial[active[small & ~given_up]]
        settled |= small & ~given_up
        converged[active[settled]] = True
        goes_on = ~(settled | given_up) & _possible(trial[active])
        active, windows = active[goes_on], windows.only(goes_on)
    return best, converged


def _step(normal: Floats, gradient: Floats, damping: Floats) -> Floats:
    """Steps (n, 10) of the unknowns."""
    damped = normal.copy()
    diagonal = np.einsum("nii->ni", damped)  # a view
    diagonal += damping[:, None] * (diagonal + 1e-12)
    step = np.asarray(np.linalg.solve(damped, gradient[..., None])[..., 0], float)
    np.clip(step[:, 2:6], -_LARGEST_STEP, _LARGEST_STEP, out=step[:, 2:6])
    return step


def _possible(theta: Floats) -> Flags:
    """Whether a fit may go through such unknowns."""
    possible = np.isfinite(theta).all(axis=1)
    for unknown, (low, high) in ((2, _LOG_RADII), (3, _LOG_BLURS)):
        possible &= (low < theta[:, unknown]) & (theta[:, unknown] < high)
    return np.asarray(possible)


def _normal_equations(theta: Floats, windows: _Windows) -> tuple[Floats, Floats, Floats]:
    """Costs, normal matrices and right-hand sides, priors included."""
    value, design = _model(theta, windows)
    v = (windows.grey - value) * windows.weight
    design *= windows.weight[:, None]
    off = _PRIOR[0] - theta
    normal = design @ design.transpose(0, 2, 1) + np.diag(_PRIOR[1])
    gradient = (design @ v[..., None])[..., 0] + _PRIOR[1] * off
    return np.einsum("nk,nk->n", v, v) + off**2 @ _PRIOR[1], normal, gradient


def _model(theta: Floats, windows: _Windows) -> tuple[Floats, Floats]:
    """Grey values (n, k) and their derivatives (n, 10, k)."""
    x, y, log_r, log_s, p, q, contrast, level, right, down = theta.T[..., None]
    radius, blur = np.exp(log_r), np.exp(log_s)
    dx, dy = windows.x - x, windows.y - y
    # stretched coordinates (I + [[p, q], [q, -p]]) d
    u, w = (1 + p) * dx + q * dy, q * dx + (1 - p) * dy
    r = np.sqrt(u * u + w * w) + 1e-9
    value, by_r, by_radius = cover(r, radius[:, 0], blur[:, 0])
    along = by_r / r
    along_u, along_w = along * u, along * w
    design = np.empty((len(theta), _UNKNOWNS, r.shape[1]))
    design[:, 0] = -(along_u * (1 + p) + along_w * q)
    design[:, 1] = -(along_u * q + along_w * (1 - p))
    design[:, 2] = by_radius * radius
    design[:, 3] = -(r * by_r + radius * by_radius)  # the cover depends on the ratios of r, R and s alone
    design[:, 4] = along_u * dx - along_w * dy
    design[:, 5] = along_u * dy + along_w * dx
    design[:, :6] *= contrast[:, None]
    design[:, 6], design[:, 7] = value, 1.0
    design[:, 8], design[:, 9] = dx, dy
    # the plane hangs on the centre, whose derivative it therefore has too
    design[:, 0] -= right
    design[:, 1] -= down
    return contrast * value + level + right * dx + down * dy, design


def _results(theta: Floats, windows: _Windows) -> list[Disc | None]:
    """The discs of unknowns (n, 10); None where they are not determined."""
    if not len(theta):
        return []
    _, normal, _ = _normal_equations(theta, windows)
    value, _ = _model(theta, windows)
    off = (windows.grey - value) * (windows.weight > 0)
    factor = np.sqrt(((off * windows.weight) ** 2).sum(axis=1) / (windows.count - _UNKNOWNS))
    sound = np.isfinite(np.linalg.slogdet(normal)[1])
    normal[~sound] = np.eye(_UNKNOWNS)
    covariance = np.linalg.inv(normal)[:, :2, :2] * factor[:, None, None] ** 2
    sound &= np.isfinite(covariance).all(axis=(1, 2)) & (np.einsum("nii->ni", covariance) > 0).all(axis=1)
    covariance += _SMALLEST_SIGMA**2 * np.eye(2)
    radius, blur = np.exp(theta[:, 2:4].T)
    stretch = 2 * np.arctanh(np.minimum(0.99, np.hypot(theta[:, 4], theta[:, 5])))
    rms = np.sqrt((off**2).sum(axis=1) / windows.count)
    shapes = zip(*(part.tolist() for part in (radius, blur, stretch, theta[:, 6], rms, factor)), strict=True)
    return [
        Disc(theta[i, :2].copy(), covariance[i].copy(), *shape) if sound[i] else None for i, shape in enumerate(shapes)
    ]
