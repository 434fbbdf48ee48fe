"""Fits many small discs at once: centre with covariance, size, contrast. A marker moves while it is exposed.

`analysis.scene.disc` fits one ball of a static image with the exact model. The images of a jumper hold dozens of places
to look at, each in one noisy frame only, and a marker's image is a short streak. So the model here is a soft elliptic
spot, from a Gaussian to a disc with a soft border,

    contrast * exp(-1/2 (d' A d)^p) + plane,

fitted to all places of an image together. It is symmetric: an error of its shape does not move the centre, and the
centre of a streak is the middle of the exposure. Residuals larger than the noise enlarge the covariance.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import gamma

from rig.arrays import Flags, Floats, Floats32, Integers

UNKNOWNS: Final = 10
_TIGHT, _HALF_SIGMAS, _HALF_CONTRAST = 2.0, 3.0, 0.06  # the same in px; residuals that count half
MARGIN: Final = 2.6  #: px beyond the disc that are fitted: a lens blurs a border over two
FARTHEST: Final = 24.0  #: px; no pixel farther away is fitted
_GROUPS = 5.0, 6.6, 10.5  # px; spots that are fitted up to a distance between these are fitted together
_FEWEST = 20  # spots of a group; fewer go with the next larger ones: each call costs more than their pixels
_BLUR = 0.62  # px; of lens and pixel, typical: only the reported radius depends on it
_STRETCH_SPREAD, _SHAPE, _SHAPE_SPREAD = 0.25, 0.3, 0.5  # weak priors
_SIZE_SPREAD = 0.4  # of log size
_PENALTY = 3.0  # power of the misfit by which the covariance grows: 2 for noise, more for residuals that lie together
_STEPS, _ENOUGH = 7, 5e-3  # iterations; px
_POOR_START = 0.4  # residuals over contrast, before the first step
_HOPELESS = {1: 0.5, 2: 0.35}  # by steps done: a fit with larger residuals over contrast is given up
_LARGEST_STEP = 0.4  # of the logarithms


@dataclass(frozen=True, slots=True, eq=False)
class SoftDiscs:
    """Fitted spots; px in the fitted image.

    Attributes:
        xy: (n, 2) centres.
        covariance: (n, 2, 2) a posteriori, where the residuals exceed the noise.
        radius: (n,) of the disc before the blur.
        stretch: (n,) log of the ratio of the axes, >= 0.
        contrast: (n,) grey values.
        sigma_contrast: (n,)
        misfit: (n,) root mean square of the residuals over that of the noise.
        rms: (n,) root mean square of the residuals, grey values.
        good: (n,) whether the fit converged near its start.
    """

    xy: Floats
    covariance: Floats
    radius: Floats
    stretch: Floats
    contrast: Floats
    sigma_contrast: Floats
    misfit: Floats
    rms: Floats
    good: Flags


def fit_soft_discs(
    grey: NDArray[np.float32], sigma: NDArray[np.float32], xy: Floats, radius: Floats, *, tight: bool = False
) -> SoftDiscs:
    """Fit spots near places; pixels of infinite noise do not count.

    Args:
        grey: (rows, columns) image.
        sigma: (rows, columns) noise of its grey values.
        xy: (n, 2) approximate centres.
        radius: (n,) approximate radii, px.
        tight: other things lie close around the spots: windows are smaller, and outlying pixels lose weight.
    """
    margin = _TIGHT if tight else MARGIN
    n = len(xy)
    theta, covariance = np.zeros((n, UNKNOWNS)), np.full((n, UNKNOWNS, UNKNOWNS), np.nan)
    misfit, rms, good = np.full(n, np.inf), np.full(n, np.inf), np.zeros(n, bool)
    reach = np.minimum(radius + margin, FARTHEST)
    for mine in _groups(reach):
        fitted = _Batch(grey, sigma, xy[mine], radius[mine], reach[mine], tight).solved()
        theta[mine], covariance[mine], misfit[mine], rms[mine], good[mine] = fitted
    spread = _second_moment(theta[:, 2], theta[:, 5])
    factor = np.maximum(1.0, misfit) ** _PENALTY
    return SoftDiscs(
        theta[:, :2],
        covariance[:, :2, :2] * factor[:, None, None],
        2 * np.sqrt(np.maximum(spread - _BLUR**2, 0.04)),
        2 * np.arctanh(np.minimum(0.99, np.hypot(theta[:, 3], theta[:, 4]))),
        theta[:, 6],
        np.sqrt(np.maximum(covariance[:, 6, 6], 0)) * np.maximum(1.0, misfit),
        misfit,
        rms,
        good,
    )


def _groups(reach: Floats) -> list[Integers]:
    """Groups of spots that are fitted together, from the reach (n,) of their windows: a group has one window size."""
    group = np.searchsorted(_GROUPS, reach)
    groups, waiting = [], np.empty(0, np.intp)
    for each in np.unique(group):
        waiting = np.concatenate((waiting, np.flatnonzero(group == each)))
        if len(waiting) >= _FEWEST:
            groups.append(waiting)
            waiting = waiting[:0]
    if groups and len(waiting) and len(groups[-1]) < 2 * _FEWEST and group[waiting].max() < len(_GROUPS):
        groups[-1] = np.concatenate((groups[-1], waiting))
    elif len(waiting):
        groups.append(waiting)
    return groups


def _second_moment(log_size: Floats, log_shape: Floats) -> Floats:
    """Variance along an axis of the spot; that of a disc of radius R is R^2 / 4."""
    p = np.exp(log_shape)
    return np.asarray(np.exp(2 * log_size) * 2 ** (1 / p) * gamma(2 / p) / (2 * gamma(1 / p)))


_Fitted = tuple[Floats, Floats, Floats, Floats, Flags]


@dataclass(frozen=True, slots=True, eq=False)
class _Windows:
    """The pixels around spots: places relative to a whole pixel near each, grey values, 1 / noise or 0."""

    x: Floats32
    y: Floats32
    grey: Floats32
    weight: Floats32

    def only(self, chosen: Integers | Flags) -> "_Windows":
        """Those of some spots."""
        return _Windows(self.x[chosen], self.y[chosen], self.grey[chosen], self.weight[chosen])


class _Batch:
    """Spots of similar size. Unknowns and equations are 64 bits wide, pixels 32: they are noisier than that."""

    def __init__(
        self,
        grey: NDArray[np.float32],
        sigma: NDArray[np.float32],
        xy: Floats,
        radius: Floats,
        reach: Floats,
        robust: bool,
    ) -> None:
        self._centre = np.rint(xy)
        self._start, self._radius, self._robust = xy - self._centre, radius, robust
        self._windows = _windows(grey, sigma, self._centre.astype(int), self._start, reach)
        self._prior = np.zeros(UNKNOWNS)
        self._prior[2:6] = _SIZE_SPREAD**-2, _STRETCH_SPREAD**-2, _STRETCH_SPREAD**-2, _SHAPE_SPREAD**-2

    def solved(self) -> _Fitted:
        """Unknowns, their covariance a priori, misfit, rms, and whether the fit is good (Levenberg-Marquardt)."""
        n = len(self._start)
        theta = self._started()
        damping, active = np.full(n, 1e-3), np.flatnonzero(self._promising(theta))
        cost, normal, gradient = np.full(n, np.inf), np.tile(np.eye(UNKNOWNS), (n, 1, 1)), np.zeros((n, UNKNOWNS))
        windows = self._windows.only(active)
        if len(active):
            cost[active], normal[active], gradient[active] = self._equations(theta[active], active, windows)
        for taken in range(_STEPS):
            if taken in _HOPELESS:
                most = (_HOPELESS[taken] * theta[active, 6]) ** 2
                hopeless = cost[active] > most * _sums(windows.weight, windows.weight)
                cost[active[hopeless]] = np.inf
                active, windows = active[~hopeless], windows.only(~hopeless)
            if not len(active):
                break
            step = np.linalg.solve(_damped(normal[active], damping[active]), gradient[active][..., None])[..., 0]
            np.clip(step[:, 2:6], -_LARGEST_STEP, _LARGEST_STEP, out=step[:, 2:6])
            np.clip(step[:, :2], -1.0, 1.0, out=step[:, :2])
            trial = theta[active] + step
            np.clip(trial[:, 5], -0.3, 2.5, out=trial[:, 5])
            np.clip(trial[:, 2], -1.5, 4.0, out=trial[:, 2])
            new = self._equations(trial, active, windows)
            better = new[0] <= cost[active]
            won = active[better]
            theta[won], cost[won], normal[won], gradient[won] = trial[better], *(part[better] for part in new)
            damping[active] *= np.where(better, 0.2, 10.0)
            settled = (np.abs(step[:, :2]).max(axis=1) < _ENOUGH) | (damping[active] > 1e6)
            if settled.any():
                active, windows = active[~settled], windows.only(~settled)
        return self._judged(theta, normal, cost)

    def _promising(self, theta: Floats) -> Flags:
        """Whether the residuals of the start are small enough for a fit to succeed."""
        if self._robust:
            return np.ones(len(theta), bool)
        used = self._windows.weight > 0
        v = (self._windows.grey - _Shape(theta, self._windows).grey) * used
        rms = np.sqrt(_sums(v, v) / np.maximum(1, used.sum(axis=1)))
        return np.asarray(rms < _POOR_START * np.abs(theta[:, 6]))

    def _started(self) -> Floats:
        theta = np.zeros((len(self._start), UNKNOWNS))
        theta[:, :2] = self._start
        theta[:, 2] = np.log(np.sqrt(self._radius**2 / 4 + _BLUR**2))
        theta[:, 5] = _SHAPE
        windows = self._windows
        design = _Shape(theta, windows).linear()
        weighted = design * (windows.weight**2)[:, None, :]
        normal = (weighted @ design.transpose(0, 2, 1)).astype(float) + 1e-9 * np.eye(4)
        right = weighted @ windows.grey[..., None]
        theta[:, 6:] = np.linalg.solve(normal, right.astype(float))[..., 0]
        self._expected = np.zeros_like(theta)
        self._expected[:, 2], self._expected[:, 5] = theta[:, 2], _SHAPE
        return theta

    def _equations(self, theta: Floats, chosen: Integers, windows: _Windows) -> tuple[Floats, Floats, Floats]:
        """Cost, normal matrix and right-hand side of the chosen spots, priors included."""
        shape = _Shape(theta, windows)
        v = windows.grey - shape.grey
        weight = windows.weight**2
        if self._robust:
            weight *= _share(v, windows.weight, theta[:, 6])
        design = shape.design()
        # a matrix times its own transpose takes NumPy three times as long as two matrices of this size
        weighted = design * weight[:, None, :]
        off = self._expected[chosen] - theta
        normal = (weighted @ design.transpose(0, 2, 1)).astype(float) + np.diag(self._prior)
        gradient = (weighted @ v[..., None])[..., 0] + self._prior * off
        return _sums(weight * v, v) + off**2 @ self._prior, normal, gradient

    def _judged(self, theta: Floats, normal: Floats, cost: Floats) -> _Fitted:
        windows = self._windows
        used = windows.weight > 0
        count = used.sum(axis=1)
        v = (windows.grey - _Shape(theta, windows).grey) * used
        share = _share(v, windows.weight, theta[:, 6]) * used if self._robust else used.astype(np.float32)
        counted = share.sum(axis=1, dtype=float)
        square, normalized = share * v, v * windows.weight**2
        misfit = np.sqrt(_sums(square, normalized) / np.maximum(1, counted - UNKNOWNS))
        rms = np.sqrt(_sums(square, v) / np.maximum(1, counted))
        covariance = np.asarray(np.linalg.inv(_damped(normal, np.full(len(normal), 1e-12))), float)
        away = np.hypot(*(theta[:, :2] - self._start).T)
        spread = np.einsum("nii->ni", covariance)[:, :2]
        good: Flags = (
            np.isfinite(cost)
            & (count >= 2 * UNKNOWNS)
            & (away <= np.maximum(1.2, self._radius))
            & (spread > 0).all(axis=1)
        )
        good &= np.isfinite(theta).all(axis=1)
        theta[:, :2] += self._centre
        return theta, covariance, misfit, rms, good


class _Shape:
    """What the model says about the pixels of n spots with unknowns (n, 10).

    Attributes:
        grey: (n, k) grey values.
    """

    def __init__(self, theta: Floats, windows: _Windows) -> None:
        x, y, log_w, s, t, log_p, contrast, b, bx, by = theta.T.astype(np.float32)[..., None]
        self._plus, self._minus, self._turn, self._p = 1 + s, 1 - s, t, np.exp(log_p)
        self._scale, self._contrast, self._bx, self._by = np.exp(-2 * log_w), contrast, bx, by
        self._dx, self._dy = windows.x - x, windows.y - y
        # stretched coordinates (I + [[s, t], [t, -s]]) d
        self._u, self._w = self._plus * self._dx + t * self._dy, t * self._dx + self._minus * self._dy
        q = self._u * self._u
        q += self._w * self._w
        q *= self._scale
        q += np.float32(1e-12)
        self._q, self._log_q = q, np.log(q)
        self._power = np.exp(self._p * self._log_q)
        self._value = np.exp(np.float32(-0.5) * self._power)
        self.grey = contrast * self._value
        self.grey += b + bx * self._dx
        self.grey += by * self._dy

    def linear(self) -> Floats32:
        """Derivatives (n, 4, k) of the grey values by contrast and plane."""
        return np.stack((self._value, np.ones_like(self._dx), self._dx, self._dy), axis=1)

    def design(self) -> Floats32:
        """Derivatives (n, 10, k) of the grey values."""
        u, w, dx, dy = self._u, self._w, self._dx, self._dy
        by_power = self._power * self._value
        by_power *= np.float32(-0.5) * self._contrast * self._p
        along = by_power / self._q
        along *= 2 * self._scale
        along_u, along_w = along * u, along * w
        design = np.empty((len(dx), UNKNOWNS, dx.shape[1]), np.float32)
        design[:, 0] = -self._bx - along_u * self._plus - along_w * self._turn
        design[:, 1] = -self._by - along_u * self._turn - along_w * self._minus
        np.multiply(by_power, -2, out=design[:, 2])
        np.subtract(along_u * dx, along_w * dy, out=design[:, 3])
        np.add(along_u * dy, along_w * dx, out=design[:, 4])
        np.multiply(by_power, self._log_q, out=design[:, 5])
        design[:, 6], design[:, 7] = self._value, 1.0
        design[:, 8], design[:, 9] = dx, dy
        return design


def _windows(
    grey: NDArray[np.float32], sigma: NDArray[np.float32], centre: Integers, off: Floats, reach: Floats
) -> _Windows:
    """The pixels of spots: those within reach (n,) of the places off (n, 2) from the whole pixels centre (n, 2)."""
    rows, columns = grey.shape
    half = int(np.ceil(reach.max() + np.abs(off).max()))
    y, x = (part.ravel() for part in np.mgrid[-half : half + 1, -half : half + 1])
    within = x * x + y * y <= (reach.max() + np.hypot(*off.T).max()) ** 2
    y, x = y[within], x[within]
    near = (x - off[:, 0, None]) ** 2 + (y - off[:, 1, None]) ** 2 <= reach[:, None] ** 2
    row, column = centre[:, 1, None] + y, centre[:, 0, None] + x
    near &= (column >= 0) & (column < columns) & (row >= 0) & (row < rows)
    place = np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)
    relative = np.broadcast_to(np.stack((x, y)).astype(np.float32)[:, None], (2, *near.shape))
    return _Windows(relative[0], relative[1], grey[place], np.where(near, 1 / sigma[place], np.float32(0)))


def _share(v: Floats32, weight: Floats32, contrast: Floats) -> Floats32:
    """How much residuals (n, k) count (Cauchy): half at some sigmas and a part of the contrast."""
    half = _HALF_SIGMAS / np.maximum(weight, np.float32(1e-9))
    half += (_HALF_CONTRAST * np.abs(contrast)[:, None]).astype(np.float32)
    return np.asarray(1 / (1 + (v / half) ** 2))


def _sums(one: Floats32, other: Floats32) -> Floats:
    """Sums (n,) of products over the pixels of each spot."""
    return np.asarray(np.einsum("nk,nk->n", one, other), float)


def _damped(normal: Floats, damping: Floats) -> Floats:
    """Normal matrices (n, m, m) with their diagonals increased by a share (n,), never quite zero."""
    damped = normal.copy()
    diagonal = np.einsum("nii->ni", damped)  # a view
    diagonal += damping[:, None] * (diagonal + 1e-12)
    return damped
