"""Fits discs of known size that may be partly covered: the visible arc and the size tell where the centre is.

A ski or a limb before a marker leaves a part of its disc. A spot fitted to that part alone lies on the visible side,
far outside its standard deviation. All markers of a jumper have one size, and the exposure time tells the streak; so
here the disc is given, blurred by the lens and smeared by the motion, and pixels that do not agree with it (what covers
it, what lies beside it) lose their weight; their neighbours, into which the lens blurs them, are left out. The size
keeps its uncertainty, which is what limits a centre that is covered on one side. What is behind is a plane with bends:
of all that it may be, only terms that are odd in one direction can be taken for a shift of the centre.

The problem has several minima where much is covered. It is started from several places, and what other minima explain
about as well as the best one makes the covariance larger.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.candidates.markers.disc_profiles import Pixels, Profiles, middle_size
from rig.arrays import Flags, Floats, Integers

UNKNOWNS: Final = 9  #: x, y, logarithm of the radius, contrast, and what is behind: level, slopes and bends
_BEHIND = 5  # index of the first slope
_MARGIN = 1.6  # px beyond the disc that are fitted: pixels farther away show other things
_STARTS_AWAY = 0.55  # radii, of the starts in eight directions about a place
_MOVED = 1.3  # radii: a centre that ends farther from its start belongs to something else
_STEPS, _LAST_STEPS, _ENOUGH = 12, 4, 3e-3  # iterations, with all pixels and with those that agree; px
_STREAKS = 0.1, 1.5  # px; a longer streak is the mean of two discs, and of three (Gauss-Legendre)
_BLOCK = 48  # windows whose pixels are computed at a time: they stay in the processor's cache
_TINY = np.float32(1e-12)
_MODEL = 0.015  # of the contrast, standard deviation: uneven light on marker and suit, pixels cut by a border
_HALF = 3.0  # standard deviations at which a pixel counts a quarter and less (Geman and McClure 1987)
_USUAL = 0.84  # mean weight of a pixel whose residual is noise alone
_ALONE, _TOGETHER = 4.0, 3.0  # standard deviations: residual of a pixel, and of the mean of 3 x 3, that rejects it
_SLOPE = 0.015  # of the contrast per px, standard deviation of the slopes of what is behind
_BEND = 0.05  # of the contrast, standard deviation of what bends add to them where the fitted pixels end
_UNCOVERED = 0.8  # visible share of the disc from which on one start is enough
_NEARLY = 4.0  # pixels that another minimum may explain worse than the best one and still widen the covariance
_SHARE = 0.4  # share of disc and border that must agree: less than half a disc fits other circles as well
_LIKE = 2.0  # standard deviations by which its contrast may differ
_WORST = 1.0  # radii: a centre with a larger sigma is not used
_FIRST_STEPS, _KEPT = 4, 3  # iterations; starts of a place that go on after them
_TELLING = 24  # places, spread over all, from which size and contrast of the discs are estimated
_MAD_TO_SIGMA = 1.4826
_COMMON = 0.1  # standard deviation of the logarithm of how much larger they all are than expected


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
    n = len(windows.xy)
    owner = np.arange(n)
    shape = _as_clear_ones(windows, shape, owner[:: max(1, n // _TELLING)])
    tables = Profiles(shape.radius)
    found = _solved(windows, shape, tables, owner, windows.xy)
    doubtful = np.flatnonzero(found.share < _UNCOVERED)
    if len(doubtful):
        more, starts = _promising(windows, shape, tables, doubtful)
        others = _solved(windows, shape, tables, more, starts)
        owner, found = np.concatenate((owner, more)), found.joined(others)
    return _best(windows, shape, owner, found)


def _as_clear_ones(windows: Windows, shape: DiscShape, places: Integers) -> DiscShape:
    """The shape with size and contrast estimated from the discs in full view among some places.

    The expected shape comes from soft spots: covered markers make smaller and fainter ones, and the lens may not blur
    by `BLUR_PX`. With a loose contrast, a whole faint disc would explain the rest of a covered one.
    """
    found = _solved(windows, shape, Profiles(shape.radius), places, windows.xy[places])
    off = found.theta[:, 2] - np.log(shape.radius[places] / middle_size(shape.radius))
    # Each fit contains the expected size as a prior; here the prior is taken out again.
    told = 1 / found.covariance[:, 2, 2]
    clear = (found.share >= _UNCOVERED) & (told > shape.spread**-2)
    alone = told[clear] - shape.spread**-2
    sizes = np.append((off * told)[clear] / alone, 0.0)
    weights = np.append(1 / (1 / alone + shape.spread**2), _COMMON**-2)
    order = np.argsort(sizes)
    middle = np.searchsorted(np.cumsum(weights[order]), weights.sum() / 2)
    contrasts = np.append(found.theta[clear, 3], shape.contrast)
    contrast = float(np.median(contrasts))
    scatter = _MAD_TO_SIGMA * float(np.median(np.abs(contrasts - contrast)))
    variance = (clear.sum() * scatter**2 + shape.sigma_contrast**2) / len(contrasts)
    return DiscShape(
        float(np.exp(sizes[order[middle]])) * shape.radius,
        shape.spread,
        shape.streak,
        contrast,
        float(np.sqrt(variance)),
    )


def _promising(windows: Windows, shape: DiscShape, tables: "Profiles", places: Integers) -> tuple[Integers, Floats]:
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
    """k solutions: unknowns (k, 9), their covariances, costs (k,) and visible shares (k,)."""

    theta: Floats
    covariance: Floats
    cost: Floats
    share: Floats

    def joined(self, other: "_Solutions") -> "_Solutions":
        return _Solutions(
            *(np.concatenate((getattr(self, name), getattr(other, name))) for name in _Solutions.__slots__)
        )


def _best(windows: Windows, shape: DiscShape, owner: Integers, found: _Solutions) -> KnownDiscs:
    """The best solution of each place; the scatter of those that fit about as well adds to its covariance."""
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
        # A difference of one pixel is not significant: the model leaves out the borders of covering things.
        weight = np.exp((least[i] - found.cost[mine]) / (2 * _HALF**2))
        weight /= weight.sum()
        off = found.theta[mine, :2] - found.theta[best, :2]
        xy[i] = found.theta[best, :2]
        covariance[i] = np.einsum("k,kij->ij", weight, found.covariance[mine, :2, :2])
        covariance[i] += np.einsum("k,ki,kj->ij", weight, off, off)
        contrast[i], sigma[i] = found.theta[best, 3], np.sqrt(found.covariance[best, 3, 3])
        share[i] = found.share[best]
    return KnownDiscs(xy, covariance, contrast, sigma, share)


def _solved(windows: Windows, shape: DiscShape, tables: "Profiles", which: Integers, xy: Floats) -> _Solutions:
    """Solutions started at xy (k, 2) in the windows `which` (k,): with all pixels, then with those that agree."""
    fit = _Fit(windows, shape.of(which), tables, which)
    theta = fit.started(xy)
    whole, cost, _ = fit.iterated(theta, _STEPS)
    share = fit.shares(whole)
    fit.leave_out(whole)
    theta, _, normal = fit.iterated(whole, _LAST_STEPS)
    pulled = theta - whole
    # The border of a covering thing shifts the fit; the change when it is left out is the sigma of that error.
    covariance = np.asarray(np.linalg.inv(normal) + pulled[:, :, None] * pulled[:, None])
    # The background is not exactly a plane with bends: their effect on the disc is taken as its own sigma.
    of_disc, behind = normal[:, :_BEHIND, :_BEHIND], normal[:, :_BEHIND, _BEHIND:] @ theta[:, _BEHIND:, None]
    bent = np.linalg.solve(of_disc, behind)
    covariance[:, :_BEHIND, :_BEHIND] += bent @ bent.swapaxes(1, 2)
    return _Solutions(theta, covariance, cost, share)


def _around(images: Pixels) -> Pixels:
    """Sums over 3 x 3 pixels of images (k, s, s)."""
    wide = np.pad(images, ((0, 0), (1, 1), (1, 1)))
    return np.asarray(np.lib.stride_tricks.sliding_window_view(wide, (3, 3), (1, 2)).sum(axis=(-1, -2)))


class _Fit:
    """The model of a disc in k windows: Levenberg-Marquardt with weights by the residuals.

    Unknowns and equations are 64 bits wide, pixels 32: they are noisier than that.
    """

    def __init__(self, windows: Windows, shape: DiscShape, tables: Profiles, which: Integers) -> None:
        self._shape, self._tables = shape, tables
        self._side, place, noise = windows.grey.shape[1], windows.xy[which], windows.noise[which]
        steps = np.arange(self._side, dtype=np.float32)
        x, y = (part.ravel() for part in np.meshgrid(steps, steps))
        reach = (1 + _STARTS_AWAY) * shape.radius + np.linalg.norm(shape.streak, axis=1) / 2 + _MARGIN
        noise = noise.reshape(len(which), -1)
        used = np.isfinite(noise) & (np.hypot(x - place[:, :1], y - place[:, 1:]) < reach[:, None])
        self._at = np.flatnonzero(used.any(axis=0))
        self._x, self._y, self._used = x[self._at], y[self._at], used[:, self._at]
        self._grey = windows.grey[which].reshape(len(which), -1)[:, self._at].astype(np.float32)
        self._noise = np.where(self._used, noise[:, self._at], 1.0).astype(np.float32)
        self._size = np.log(shape.radius / tables.middle)
        longest = float(np.linalg.norm(shape.streak, axis=1).max(initial=0.0))
        nodes, weights = np.polynomial.legendre.leggauss(1 + int(np.searchsorted(_STREAKS, longest)))
        self._nodes = [(node / 2, weight / 2) for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True)]

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
            if not len(active):
                break
            blocks = [active[first : first + _BLOCK] for first in range(0, len(active), _BLOCK)]
            parts = zip(*(self._equations(trial[block], block) for block in blocks), strict=True)
            new = tuple(np.concatenate(part) for part in parts)
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
        return theta, cost, normal

    def leave_out(self, theta: Floats) -> None:
        """Take pixels that do not agree with the discs, and their neighbours, out of the fit."""
        value, _ = self._model(theta, np.arange(len(theta)))
        parts = (self._used, (self._grey - value) * self._used, self._noise**2 * self._used)
        used, off, noise = (self._image(part) for part in parts)
        model = (_MODEL * self._shape.contrast) ** 2
        rejected = off**2 > _ALONE**2 * (noise + model)
        # A lens spreads each thing over some pixels: in their mean it stands out of the noise more.
        count = np.maximum(_around(used), 1)
        rejected |= (_around(off) / count) ** 2 > _TOGETHER**2 * (_around(noise) / count**2 + model)
        self._used &= _around(rejected * used).reshape(len(theta), -1)[:, self._at] == 0

    def _image(self, values: Pixels | Flags) -> Pixels:
        """Values of the pixels (k, p) as images (k, s, s)."""
        image = np.zeros((len(values), self._side**2), np.float32)
        image[:, self._at] = values
        return image.reshape(-1, self._side, self._side)

    def shares(self, theta: Floats) -> Floats:
        """Shares (k,) of the discs and of their borders that agree with the image, the lesser of both."""
        _, _, share, design = self._residuals(theta, np.arange(len(theta)))
        area, border = np.clip(design[:, 3], 0.0, 1.0), design[:, 2] ** 2
        of_disc, of_border = (
            (share * part).sum(axis=1) / np.maximum(part.sum(axis=1), 1e-9) for part in (area, border)
        )
        return np.asarray(np.minimum(1.0, np.minimum(of_disc, of_border) / _USUAL))

    def _model(self, theta: Floats, which: Integers) -> tuple[Pixels, Pixels]:
        """Grey values (k, p) and derivatives (k, 9, p)."""
        x, y, _, contrast, level, right, down, right_bend, down_bend = theta.T.astype(np.float32)[..., None]
        streak_x, streak_y = self._shape.streak[which].T.astype(np.float32)[..., None]
        dx, dy = self._x - x, self._y - y
        design = np.zeros((len(theta), UNKNOWNS, dx.shape[1]), np.float32)
        for node, weight in self._nodes:
            ux, uy = dx - node * streak_x, dy - node * streak_y
            rho = np.sqrt(ux * ux + uy * uy + _TINY)
            value, by_rho, by_size = self._tables.at(rho, theta[:, 2])
            by_rho *= weight / rho
            design[:, 0] -= by_rho * ux
            design[:, 1] -= by_rho * uy
            design[:, 2] += weight * by_size
            design[:, 3] += weight * value
        design[:, :3] *= contrast[:, None]
        design[:, 0] -= right
        design[:, 1] -= down
        bend = (dx * dx + dy * dy) * ((self._shape.radius[which] + _MARGIN) ** -3).astype(np.float32)[:, None]
        design[:, 4], design[:, 5], design[:, 6], design[:, 7], design[:, 8] = 1.0, dx, dy, bend * dx, bend * dy
        behind = level + right * dx + down * dy + right_bend * design[:, 7] + down_bend * design[:, 8]
        return contrast * design[:, 3] + behind, design

    def _residuals(self, theta: Floats, which: Integers) -> tuple[Pixels, Pixels, Pixels, Pixels]:
        """Residuals over their standard deviations (k, p), these, shares that they count, derivatives (k, 9, p)."""
        value, design = self._model(theta, which)
        sigma = np.sqrt(self._noise[which] ** 2 + np.float32((_MODEL * self._shape.contrast) ** 2))
        v = (self._grey[which] - value) / sigma
        share = self._used[which] / (1 + (v / np.float32(_HALF)) ** 2) ** 2
        return v, sigma, share, design

    def _equations(self, theta: Floats, which: Integers) -> tuple[Floats, Floats, Floats]:
        """Costs, normal matrices and right-hand sides, priors included."""
        v, sigma, share, design = self._residuals(theta, which)
        design /= sigma[:, None]
        weighted = design * share[:, None]
        normal = (weighted @ design.swapaxes(1, 2)).astype(float)
        gradient = (weighted @ v[..., None])[..., 0].astype(float)
        off = np.zeros_like(theta)
        off[:, 2], off[:, 3] = theta[:, 2] - self._size[which], theta[:, 3] - self._shape.contrast
        prior = np.full(theta.shape, 1e-9)
        prior[:, 2], prior[:, 3] = self._shape.spread**-2, self._shape.sigma_contrast**-2
        prior[:, 5:7], prior[:, 7:] = (_SLOPE * self._shape.contrast) ** -2, (_BEND * self._shape.contrast) ** -2
        off[:, _BEHIND:] = theta[:, _BEHIND:]
        robust = self._used[which] * v**2 / (1 + (v / np.float32(_HALF)) ** 2)
        cost = robust.sum(axis=1, dtype=float) + (prior * off**2).sum(axis=1)
        gradient -= prior * off
        return cost, normal + prior[:, :, None] * np.eye(UNKNOWNS), gradient
