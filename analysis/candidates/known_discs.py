"""Fits discs of known size that may be partly covered: the visible arc and the size tell where the centre is.

A ski or a limb before a marker leaves a part of its disc. A spot fitted to that part alone lies on the visible side,
far outside its standard deviation. All markers of a jumper have one size, and the exposure time tells the streak; so
here the disc is given, blurred by the lens and smeared by the motion, and pixels that do not agree with it (what covers
it, what lies beside it) lose their weight; their neighbours, into which the lens blurs them, are left out. The size
keeps its uncertainty, which is what limits a centre that is covered on one side.

The problem has several minima where much is covered. It is started from several places, and what other minima explain
about as well as the best one makes the covariance larger.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chndtr

from rig.arrays import Floats, Integers

UNKNOWNS: Final = 7  #: x, y, logarithm of the radius, contrast, and the plane behind: level and slopes
BLUR_PX: Final = 0.62  #: of lens and pixel, typical; what differs is absorbed by the size that was learned with it
_MARGIN = 2.2  # px beyond the disc that are fitted
_STARTS_AWAY = 0.55  # radii, of the starts in eight directions about a place
_MOVED = 1.3  # radii: a centre that ends farther from its start belongs to something else
_STEPS, _LAST_STEPS, _ENOUGH = 12, 4, 3e-3  # iterations, with all pixels and with those that agree; px
_NODES = np.array((-1.0, 0.0, 1.0)) * np.sqrt(0.15)  # of a streak, in its lengths, and their weights (Gauss-Legendre)
_WEIGHTS = np.array((5.0, 8.0, 5.0)) / 18
_GRID = 0.04  # px, of the table of profiles
_SIZE_STEP = 0.03  # of the logarithm of the radius, likewise
_MODEL = 0.03  # of the contrast, standard deviation: uneven light on marker and suit, pixels cut by a border
_HALF = 3.0  # standard deviations at which a pixel counts half and less (Geman and McClure 1987)
_REJECTED = 0.3  # a pixel that counts less does not belong to disc or background
_SLOPE = 0.03  # of the contrast per px, standard deviation of the slopes of the plane
_UNCOVERED = 0.8  # share of the disc that counts, with which one start is enough
_NEARLY = 4.0  # pixels that another minimum may explain worse than the best one
_SHARE = 0.4  # of the disc and of its border that must agree: of less than a half, other circles explain as much
_LIKE = 2.0  # standard deviations by which its contrast may differ
_WORST = 1.0  # radii; a centre that is less certain than this says nothing
_FIRST_STEPS, _KEPT = 4, 3  # iterations after which only so many of the starts of a place go on


@dataclass(frozen=True, slots=True, eq=False)
class DiscShape:
    """What is known of the images of n markers.

    Attributes:
        radius: (n,) px.
        spread: standard deviation of its logarithm.
        streak: (n, 2) px, the way of the image during the exposure.
        contrast: grey values against what is around; negative: darker.
        sigma_contrast: of it, grey values.
    """

    radius: Floats
    spread: float
    streak: Floats
    contrast: float
    sigma_contrast: float

    def of(self, which: Integers) -> "DiscShape":
        """Of some of the places, which may repeat."""
        return DiscShape(self.radius[which], self.spread, self.streak[which], self.contrast, self.sigma_contrast)


@dataclass(frozen=True, slots=True, eq=False)
class Windows:
    """Parts of images about n places.

    Attributes:
        xy: (n, 2) the places in the windows, px.
        grey: (n, s, s) grey values.
        noise: (n, s, s) their standard deviation; infinite where there is no picture.
    """

    xy: Floats
    grey: Floats
    noise: Floats


@dataclass(frozen=True, slots=True, eq=False)
class KnownDiscs:
    """Discs fitted near n places.

    Attributes:
        xy: (n, 2) centres in the windows, px; NaN where there is none.
        covariance: (n, 2, 2).
        contrast: (n,) grey values.
        sigma_contrast: (n,)
        share: (n,) of the disc and of its border that agrees with the image, the lesser of both.
    """

    xy: Floats
    covariance: Floats
    contrast: Floats
    sigma_contrast: Floats
    share: Floats


def half_size(shape: DiscShape) -> int:
    """So many px a window must reach to each side of the pixel of its place."""
    streak = float(np.linalg.norm(shape.streak, axis=1).max(initial=0.0))
    return int(np.ceil((1 + _STARTS_AWAY) * float(shape.radius.max(initial=1.0)) + streak / 2 + _MARGIN))


def fit_known_discs(windows: Windows, shape: DiscShape) -> KnownDiscs:
    """Fit a disc near each place.

    Args:
        windows: about the places.
        shape: of the discs.
    """
    tables = _Profiles(shape.radius)
    n = len(windows.xy)
    owner = np.arange(n)
    found = _solved(windows, shape, tables, owner, windows.xy)
    doubtful = np.flatnonzero(found.share < _UNCOVERED)
    if len(doubtful):
        more, starts = _promising(windows, shape, tables, doubtful)
        others = _solved(windows, shape, tables, more, starts)
        owner, found = np.concatenate((owner, more)), found.joined(others)
    return _best(windows, shape, owner, found)


def _promising(windows: Windows, shape: DiscShape, tables: "_Profiles", places: Integers) -> tuple[Integers, Floats]:
    """Other starts for some places: the best ones of those around, each with the place that it belongs to."""
    angles = np.arange(8) * np.pi / 4
    which = np.repeat(places, len(angles))
    away = _STARTS_AWAY * np.tile(np.column_stack((np.cos(angles), np.sin(angles))), (len(places), 1))
    fit = _Fit(windows, shape.of(which), tables, which)
    theta, cost, _ = fit.iterated(fit.started(windows.xy[which] + away * shape.radius[which, None]), _FIRST_STEPS)
    order = cost.reshape(len(places), -1).argsort(axis=1)[:, :_KEPT]
    chosen = (order + np.arange(len(places))[:, None] * len(angles)).ravel()
    return which[chosen], theta[chosen, :2]


@dataclass(frozen=True, slots=True, eq=False)
class _Solutions:
    """k solutions: unknowns (k, 7), their covariances, costs (k,) and visible shares (k,)."""

    theta: Floats
    covariance: Floats
    cost: Floats
    share: Floats

    def joined(self, other: "_Solutions") -> "_Solutions":
        return _Solutions(
            *(np.concatenate((getattr(self, name), getattr(other, name))) for name in _Solutions.__slots__)
        )


def _best(windows: Windows, shape: DiscShape, owner: Integers, found: _Solutions) -> KnownDiscs:
    """The best of the solutions of each place, with the scatter of those that are about as good."""
    n = len(windows.xy)
    moved = np.linalg.norm(found.theta[:, :2] - windows.xy[owner], axis=1)
    sound = np.isfinite(found.cost) & (moved < _MOVED * shape.radius[owner]) & (found.share > _SHARE)
    sound &= np.abs(found.theta[:, 3] - shape.contrast) < _LIKE * shape.sigma_contrast
    variance = np.einsum("nii->ni", found.covariance)[:, :4]
    sound &= (variance > 0).all(axis=1) & (variance[:, :2].max(axis=1) < (_WORST * shape.radius[owner]) ** 2)
    least = np.full(n, np.inf)
    np.minimum.at(least, owner[sound], found.cost[sound])
    xy, covariance = np.full((n, 2), np.nan), np.tile(np.eye(2), (n, 1, 1))
    contrast, sigma, share = np.zeros(n), np.ones(n), np.zeros(n)
    for i in np.flatnonzero(np.isfinite(least)).tolist():
        mine = np.flatnonzero((owner == i) & sound & (found.cost < least[i] + _NEARLY * _HALF**2))
        best = mine[found.cost[mine].argmin()]
        # What one pixel explains is as good as nothing: borders of what covers a disc are no part of the model.
        weight = np.exp((least[i] - found.cost[mine]) / (2 * _HALF**2))
        weight /= weight.sum()
        off = found.theta[mine, :2] - found.theta[best, :2]
        xy[i] = found.theta[best, :2]
        covariance[i] = np.einsum("k,kij->ij", weight, found.covariance[mine, :2, :2])
        covariance[i] += np.einsum("k,ki,kj->ij", weight, off, off)
        contrast[i], sigma[i] = found.theta[best, 3], np.sqrt(found.covariance[best, 3, 3])
        share[i] = found.share[best]
    return KnownDiscs(xy, covariance, contrast, sigma, share)


def _solved(windows: Windows, shape: DiscShape, tables: "_Profiles", which: Integers, xy: Floats) -> _Solutions:
    """Solutions started at xy (k, 2) in the windows `which` (k,): with all pixels, then with those that agree."""
    fit = _Fit(windows, shape.of(which), tables, which)
    theta = fit.started(xy)
    whole, cost, _ = fit.iterated(theta, _STEPS)
    share = fit.shares(whole)
    fit.leave_out(whole)
    theta, _, normal = fit.iterated(whole, _LAST_STEPS)
    pulled = theta - whole
    # The border of what covers a disc pulls at it; by how much is known no better than what leaving it out changes.
    covariance = np.asarray(np.linalg.inv(normal) + pulled[:, :, None] * pulled[:, None])
    return _Solutions(theta, covariance, cost, share)


class _Profiles:
    """Profiles of blurred discs of several sizes about a middle one, as a table over distances and sizes."""

    def __init__(self, radius: Floats) -> None:
        self.middle = float(np.exp(np.log(radius).mean())) if len(radius) else 1.0
        most = float(np.abs(np.log(radius / self.middle)).max(initial=0.0)) + 0.15
        self._half = int(np.ceil(most / _SIZE_STEP))
        sizes = self.middle * np.exp(np.arange(-self._half, self._half + 1) * _SIZE_STEP)
        self._length = int(np.ceil((sizes[-1] + 5 * BLUR_PX) / _GRID)) + 2
        rho = np.asarray(np.arange(self._length) * _GRID, float)
        profile = np.stack([blurred_disc(rho, size) for size in sizes])
        by_size, by_rho = np.gradient(profile, _SIZE_STEP, _GRID)
        self._table = np.stack((profile, by_rho, by_size), axis=-1).reshape(-1, 3)

    def at(self, rho: Floats, size: Floats) -> tuple[Floats, Floats, Floats]:
        """Values and derivatives by distance and logarithm of the radius, at distances (k, p) for sizes (k,)."""
        row = np.clip(np.rint(size / _SIZE_STEP).astype(int) + self._half, 0, 2 * self._half)
        column = np.minimum(np.rint(rho / _GRID), self._length - 1).astype(int)
        value, by_rho, by_size = np.moveaxis(self._table[row[:, None] * self._length + column], -1, 0)
        off = np.minimum(rho - column * _GRID, _GRID)
        value = value + by_rho * off + by_size * (size - (row - self._half) * _SIZE_STEP)[:, None]
        return value, by_rho, by_size


class _Fit:
    """The model of a disc in k windows: Levenberg-Marquardt with weights by the residuals."""

    def __init__(self, windows: Windows, shape: DiscShape, tables: _Profiles, which: Integers) -> None:
        self._shape, self._tables = shape, tables
        k, side = len(which), windows.grey.shape[1]
        steps = np.arange(side, dtype=float)
        x, y = np.meshgrid(steps, steps)
        self._x, self._y = x.ravel(), y.ravel()
        self._grey, self._side = windows.grey[which].reshape(k, -1), side
        self._noise = windows.noise[which].reshape(k, -1)
        place = windows.xy[which]
        reach = (1 + _STARTS_AWAY) * shape.radius + np.linalg.norm(shape.streak, axis=1) / 2 + _MARGIN
        away = np.hypot(self._x - place[:, :1], self._y - place[:, 1:])
        self._used = np.isfinite(self._noise) & (away < reach[:, None])
        self._noise = np.where(self._used, self._noise, 1.0)
        self._size = np.log(shape.radius / tables.middle)

    def started(self, xy: Floats) -> Floats:
        """Unknowns to begin with at xy (k, 2): the level behind is the median of what lies around."""
        away = np.hypot(self._x - xy[:, :1], self._y - xy[:, 1:]) - self._shape.radius[:, None]
        around = np.where(self._used & (away > 1.0) & (away < 1.0 + _MARGIN), self._grey, np.nan)
        theta = np.zeros((len(xy), UNKNOWNS))
        theta[:, :2], theta[:, 2], theta[:, 3] = xy, self._size, self._shape.contrast
        there = np.isfinite(around).any(axis=1)
        theta[there, 4] = np.nanmedian(around[there], axis=1)
        return theta

    def iterated(self, theta: Floats, steps: int) -> tuple[Floats, Floats, Floats]:
        """Unknowns, costs and normal matrices after so many steps."""
        k = len(theta)
        theta, trial = theta.copy(), theta.copy()
        cost, damping = np.full(k, np.inf), np.full(k, 1e-2)
        normal, gradient = np.tile(np.eye(UNKNOWNS), (k, 1, 1)), np.zeros((k, UNKNOWNS))
        active = np.arange(k)
        for _ in range(steps):
            new = self._equations(trial[active], active)
            better = new[0] <= cost[active]
            won = active[better]
            theta[won] = trial[won]
            cost[won], normal[won], gradient[won] = (part[better] for part in new)
            damping[active] *= np.where(better, 0.2, 10.0)
            diagonal = np.einsum("nii->ni", normal[active])[:, :, None] * np.eye(UNKNOWNS)
            damped = normal[active] + damping[active, None, None] * diagonal
            step = np.linalg.solve(damped, gradient[active][..., None])[..., 0]
            step[:, :2] = np.clip(step[:, :2], -0.7, 0.7)
            trial[active] = theta[active] + step
            active = active[(np.abs(step[:, :2]).max(axis=1) > _ENOUGH) & (damping[active] < 1e6)]
            if not len(active):
                break
        return theta, cost, normal

    def leave_out(self, theta: Floats) -> None:
        """Use neither what does not agree with the discs nor its neighbours any more."""
        everything = np.arange(len(theta))
        _, _, share, _ = self._residuals(theta, everything)
        rejected = (self._used & (share < _REJECTED)).reshape(-1, self._side, self._side)
        wide = np.pad(rejected, ((0, 0), (1, 1), (1, 1)))
        near = np.zeros_like(rejected)
        for dy in range(3):
            for dx in range(3):
                near |= wide[:, dy : dy + self._side, dx : dx + self._side]
        self._used &= ~near.reshape(len(theta), -1)

    def shares(self, theta: Floats) -> Floats:
        """Shares (k,) of the discs and of their borders that agree with the image, the lesser of both."""
        _, _, share, design = self._residuals(theta, np.arange(len(theta)))
        area, border = np.clip(design[:, 3], 0.0, 1.0), design[:, 2] ** 2
        of_disc, of_border = (
            (share * part).sum(axis=1) / np.maximum(part.sum(axis=1), 1e-9) for part in (area, border)
        )
        return np.asarray(np.minimum(of_disc, of_border))

    def _model(self, theta: Floats, which: Integers) -> tuple[Floats, Floats]:
        """Grey values (k, p) and derivatives (k, 7, p)."""
        x, y, _, contrast, level, right, down = theta.T[..., None]
        dx, dy = self._x - x, self._y - y
        design = np.zeros((len(theta), UNKNOWNS, dx.shape[1]))
        for node, weight in zip(_NODES, _WEIGHTS, strict=True):
            sx, sy = (node * self._shape.streak[which]).T[..., None]
            ux, uy = dx - sx, dy - sy
            rho = np.hypot(ux, uy)
            value, by_rho, by_size = self._tables.at(rho, theta[:, 2])
            by_rho = weight * by_rho / np.maximum(rho, 1e-9)
            design[:, 0] -= by_rho * ux
            design[:, 1] -= by_rho * uy
            design[:, 2] += weight * by_size
            design[:, 3] += weight * value
        design[:, :3] *= contrast[:, None]
        design[:, 0] -= right
        design[:, 1] -= down
        design[:, 4], design[:, 5], design[:, 6] = 1.0, dx, dy
        return contrast * design[:, 3] + level + right * dx + down * dy, design

    def _residuals(self, theta: Floats, which: Integers) -> tuple[Floats, Floats, Floats, Floats]:
        """Residuals over their standard deviations (k, p), these, shares that they count, derivatives (k, 7, p)."""
        value, design = self._model(theta, which)
        sigma = np.hypot(self._noise[which], _MODEL * abs(self._shape.contrast))
        v = (self._grey[which] - value) / sigma
        share = self._used[which] / (1 + (v / _HALF) ** 2) ** 2
        return v, sigma, share, design

    def _equations(self, theta: Floats, which: Integers) -> tuple[Floats, Floats, Floats]:
        """Costs, normal matrices and right-hand sides, priors included."""
        v, sigma, share, design = self._residuals(theta, which)
        design /= sigma[:, None]
        weighted = design * share[:, None]
        normal = weighted @ design.swapaxes(1, 2)
        gradient = (weighted @ v[..., None])[..., 0]
        prior = np.full(UNKNOWNS, 1e-9)
        prior[2], prior[3] = self._shape.spread**-2, self._shape.sigma_contrast**-2
        prior[5:] = (_SLOPE * abs(self._shape.contrast)) ** -2
        off = theta.copy()
        off[:, [0, 1, 4]] = 0.0
        off[:, 2] -= self._size[which]
        off[:, 3] -= self._shape.contrast
        gradient -= prior * off
        cost = (self._used[which] * v**2 / (1 + (v / _HALF) ** 2)).sum(axis=1) + (prior * off**2).sum(axis=1)
        return cost, normal + np.diag(prior), gradient


def blurred_disc(rho: Floats, radius: float) -> Floats:
    """Profile of a disc of height 1 that lens and pixels blur, at distances `rho` from its centre, px.

    It is the probability that a normally distributed shift leads into the disc: a noncentral chi-square.
    """
    return np.asarray(chndtr((radius / BLUR_PX) ** 2, 2.0, (rho / BLUR_PX) ** 2), float)
