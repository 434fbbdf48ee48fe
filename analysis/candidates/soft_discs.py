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

from rig.arrays import Flags, Floats, Integers

UNKNOWNS: Final = 10
_TIGHT, _HALF_SIGMAS, _HALF_CONTRAST = 2.0, 3.0, 0.06  # the same in px; residuals that count half
_COUNTED = 0.6  # share of the pixels that must count
MARGIN: Final = 2.6  #: px beyond the disc that are fitted: a lens blurs a border over two
_HALVES = 4, 6, 10, 16, 24  # px; half sizes of windows
_BLUR = 0.62  # px; of lens and pixel, typical: only the reported radius depends on it
_STRETCH_SPREAD, _SHAPE, _SHAPE_SPREAD = 0.25, 0.3, 0.5  # weak priors
_SIZE_SPREAD = 0.4  # of log size
_PENALTY = 3.0  # power of the misfit by which the covariance grows: 2 for noise, more for residuals that lie together
_STEPS, _ENOUGH = 7, 5e-3  # iterations; px
_POOR_START = 0.4  # residuals over contrast, before the first step
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
        tight: something lies close around the spots: what a spot in a smaller window does not explain counts less.
    """
    margin = _TIGHT if tight else MARGIN
    n = len(xy)
    theta, covariance = np.zeros((n, UNKNOWNS)), np.full((n, UNKNOWNS, UNKNOWNS), np.nan)
    misfit, rms, good = np.full(n, np.inf), np.full(n, np.inf), np.zeros(n, bool)
    half = np.searchsorted(_HALVES, np.minimum(radius + margin, _HALVES[-1]))
    for size in np.unique(half):
        mine = np.flatnonzero(half == size)
        fitted = _Batch(grey, sigma, xy[mine], radius[mine], _HALVES[size], margin, tight).solved()
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


def _second_moment(log_size: Floats, log_shape: Floats) -> Floats:
    """Variance along an axis of the spot; that of a disc of radius R is R^2 / 4."""
    p = np.exp(log_shape)
    return np.asarray(np.exp(2 * log_size) * 2 ** (1 / p) * gamma(2 / p) / (2 * gamma(1 / p)))


_Fitted = tuple[Floats, Floats, Floats, Floats, Flags]


class _Batch:
    """Spots with windows of one size."""

    def __init__(
        self,
        grey: NDArray[np.float32],
        sigma: NDArray[np.float32],
        xy: Floats,
        radius: Floats,
        half: int,
        margin: float,
        robust: bool,
    ) -> None:
        rows, columns = grey.shape
        steps = np.arange(-half, half + 1)
        centre = np.rint(xy).astype(int)
        x = centre[:, 0, None, None] + steps[None, None, :]
        y = centre[:, 1, None, None] + steps[None, :, None]
        inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
        near = (x - xy[:, 0, None, None]) ** 2 + (y - xy[:, 1, None, None]) ** 2 <= (radius + margin)[
            :, None, None
        ] ** 2
        x, y = np.broadcast_to(x, inside.shape), np.broadcast_to(y, inside.shape)
        place = np.clip(y, 0, rows - 1), np.clip(x, 0, columns - 1)
        n = len(xy)
        self._x, self._y = x.reshape(n, -1).astype(float), y.reshape(n, -1).astype(float)
        self._grey = grey[place].reshape(n, -1).astype(float)
        self._weight = np.where(inside & near, 1 / sigma[place], 0.0).reshape(n, -1).astype(float)
        self._start, self._radius, self._robust = xy, radius, robust

    def solved(self) -> _Fitted:
        """Unknowns, their covariance a priori, misfit, rms, and whether the fit is good (Levenberg-Marquardt)."""
        n = len(self._start)
        theta = self._started()
        damping, active = np.full(n, 1e-3), np.flatnonzero(self._promising(theta))
        cost, normal, gradient = np.full(n, np.inf), np.tile(np.eye(UNKNOWNS), (n, 1, 1)), np.zeros((n, UNKNOWNS))
        if len(active):
            cost[active], normal[active], gradient[active] = self._equations(theta[active], active)
        for _ in range(_STEPS):
            if not len(active):
                break
            damped = normal[active] + damping[active, None, None] * _diagonal(normal[active])
            step = np.linalg.solve(damped, gradient[active][..., None])[..., 0]
            step[:, 2:6] = np.clip(step[:, 2:6], -_LARGEST_STEP, _LARGEST_STEP)
            step[:, :2] = np.clip(step[:, :2], -1.0, 1.0)
            trial = theta[active] + step
            trial[:, 5] = np.clip(trial[:, 5], -0.3, 2.5)
            trial[:, 2] = np.clip(trial[:, 2], -1.5, 4.0)
            new = self._equations(trial, active)
            better = new[0] <= cost[active]
            won = active[better]
            theta[won], cost[won], normal[won], gradient[won] = (
                trial[better],
                new[0][better],
                new[1][better],
                new[2][better],
            )
            damping[active] *= np.where(better, 0.2, 10.0)
            settled = (np.abs(step[:, :2]).max(axis=1) < _ENOUGH) | (damping[active] > 1e6)
            active = active[~settled]
        return self._judged(theta, normal, cost)

    def _promising(self, theta: Floats) -> Flags:
        """Whether the spot to start from explains enough; no fit would mend larger residuals."""
        value, _ = self._model(theta, np.arange(len(theta)))
        used = self._weight > 0
        v = (self._grey - value) * used
        if self._robust:
            return np.ones(len(theta), bool)
        rms = np.sqrt((v**2).sum(axis=1) / np.maximum(1, used.sum(axis=1)))
        return np.asarray(rms < _POOR_START * np.abs(theta[:, 6]))

    def _started(self) -> Floats:
        theta = np.zeros((len(self._start), UNKNOWNS))
        theta[:, :2] = self._start
        theta[:, 2] = np.log(np.sqrt(self._radius**2 / 4 + _BLUR**2))
        theta[:, 5] = _SHAPE
        design = self._model(theta, np.arange(len(theta)))[1][:, 6:] * self._weight[:, None, :]
        normal = design @ design.transpose(0, 2, 1) + 1e-9 * np.eye(4)
        right = design @ (self._grey * self._weight)[..., None]
        theta[:, 6:] = np.linalg.solve(normal, right)[..., 0]
        self._prior = np.zeros((UNKNOWNS,))
        self._prior[2:6] = _SIZE_SPREAD**-2, _STRETCH_SPREAD**-2, _STRETCH_SPREAD**-2, _SHAPE_SPREAD**-2
        self._expected = np.zeros_like(theta)
        self._expected[:, 2], self._expected[:, 5] = theta[:, 2], _SHAPE
        return theta

    def _equations(self, theta: Floats, chosen: Integers) -> tuple[Floats, Floats, Floats]:
        """Cost, normal matrix and right-hand side of the chosen spots, priors included."""
        value, design = self._model(theta, chosen)
        v = self._grey[chosen] - value
        weight = self._weight[chosen]
        if self._robust:
            weight = weight * np.sqrt(self._share(v, weight, theta[:, 6]))
        v *= weight
        design *= weight[:, None, :]
        off = self._expected[chosen] - theta
        normal = design @ design.transpose(0, 2, 1) + np.diag(self._prior)
        gradient = (design @ v[..., None])[..., 0] + self._prior * off
        return (v**2).sum(axis=1) + (self._prior * off**2).sum(axis=1), normal, gradient

    @staticmethod
    def _share(v: Floats, weight: Floats, contrast: Floats) -> Floats:
        """How much residuals (n, k) count (Cauchy): half at some sigmas and a part of the contrast."""
        half = _HALF_SIGMAS / np.maximum(weight, 1e-9) + _HALF_CONTRAST * np.abs(contrast)[:, None]
        return np.asarray(1 / (1 + (v / half) ** 2))

    def _model(self, theta: Floats, chosen: Integers) -> tuple[Floats, Floats]:
        """Grey values (n, k) and their derivatives (n, 10, k)."""
        x, y, log_w, s, t, log_p, contrast, b, bx, by = theta.T[..., None]
        dx, dy = self._x[chosen] - x, self._y[chosen] - y
        p, scale = np.exp(log_p), np.exp(-2 * log_w)
        # stretched coordinates (I + [[s, t], [t, -s]]) d
        u, w = (1 + s) * dx + t * dy, t * dx + (1 - s) * dy
        q = (u * u + w * w) * scale + 1e-12
        log_q = np.log(q)
        power = np.exp(p * log_q)
        value = np.exp(-0.5 * power)
        by_power = -0.5 * contrast * p * power * value
        by_q = by_power / q
        along = 2 * scale * by_q
        design = np.empty((len(dx), UNKNOWNS, dx.shape[1]))
        design[:, 0] = -along * (u * (1 + s) + w * t) - bx
        design[:, 1] = -along * (u * t + w * (1 - s)) - by
        design[:, 2] = -2 * by_power
        design[:, 3] = along * (u * dx - w * dy)
        design[:, 4] = along * (u * dy + w * dx)
        design[:, 5] = by_power * log_q
        design[:, 6] = value
        design[:, 7] = 1.0
        design[:, 8], design[:, 9] = dx, dy
        return contrast * value + b + bx * dx + by * dy, design

    def _judged(self, theta: Floats, normal: Floats, cost: Floats) -> _Fitted:
        everything = np.arange(len(theta))
        value, _ = self._model(theta, everything)
        used = self._weight > 0
        count = used.sum(axis=1)
        v = (self._grey - value) * used
        share = self._share(v, self._weight, theta[:, 6]) * used if self._robust else used.astype(float)
        counted = share.sum(axis=1)
        square = (share * (v * self._weight) ** 2).sum(axis=1)
        misfit = np.asarray(np.sqrt(square / np.maximum(1, counted - UNKNOWNS)), float)
        rms = np.asarray(np.sqrt((share * v**2).sum(axis=1) / np.maximum(1, counted)), float)
        covariance = np.asarray(np.linalg.inv(normal + 1e-12 * _diagonal(normal)), float)
        away = np.hypot(*(theta[:, :2] - self._start).T)
        spread = np.einsum("nii->ni", covariance)[:, :2]
        good: Flags = (
            np.isfinite(cost)
            & (count >= 2 * UNKNOWNS)
            & (away <= np.maximum(1.2, self._radius))
            & (spread > 0).all(axis=1)
        )
        good &= np.isfinite(theta).all(axis=1)
        return theta, covariance, misfit, rms, good


def _diagonal(matrices: Floats) -> Floats:
    """The diagonals of (n, m, m) as diagonal matrices, never quite zero."""
    return np.asarray(np.einsum("nii->ni", matrices)[:, :, None] * np.eye(matrices.shape[1]) + 1e-12)
