"""Fits one or several long bars to all pixels around them, before a known background.

The image of a uniform rectangle of half width h behind a blur s is the product of two differences of the normal
distribution, across and along:

    cover(u, t) = [F((u + h) / s) - F((u - h) / s)] [F((t - t0) / s) - F((t - t1) / s)].

Bars of one brightness B that cover each other hide what is behind by 1 - product(1 - cover). Width, blur and
brightness are those of a pair of skis: one for all bars. So two skis that nearly cover each other are separated by
what is known of each from where it is alone. The adjustment is robust in sections along the bars: a section that is
not explained (body, boot, marker, a flake of snow) is left out as a whole, because leaving out single pixels would move
the axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from analysis.candidates.background import Region
from rig.arrays import Floats, Integers

_SHARED = 3  # brightness, log of the half width, log of the blur
_OF_BAR = 4  # rho, theta, t0, t1
_MARGIN = 2.6  # px beside and beyond a bar that are fitted
_BLUR, _BLUR_SPREAD = 0.65, 0.4  # px; weak prior of log s: of lens and pixels
_WIDTH_SPREAD = 0.3  # of log h, around what the edges say
_END_SPREAD = 3.0  # px
_ROUNDS, _STEPS = 4, 3  # choice of sections; steps of the adjustment in each
_SETTLED = 0.01  # px by which an axis still moves
_SECTION = 2.0  # px along the bars
_POOR = 3.0  # times the median over the sections: mean square of normalized residuals
_CAP = 25.0  # squared residuals are counted up to that when explanations are compared
_HOPELESS = 12.0  # residuals over noise of a first explanation that no other start will mend
_MODEL = 0.03  # of the contrast: residuals that the model itself leaves
_OPPOSITE = 1  # px around pixels in front that differ from the background in the other direction
_FEWEST = 30  # pixels
_NORMAL = 1.59577, 0.07056  # logit of the normal distribution: error below 2e-4, one exponential for it and its slope


@dataclass(frozen=True, slots=True, eq=False)
class Bar:
    """A bar, px of the region.

    Attributes:
        ends: (2, 2) ends of its axis.
        width: px.
    """

    ends: Floats
    width: float

    @property
    def length(self) -> float:
        """Length, px."""
        return float(np.hypot(*(self.ends[1] - self.ends[0])))


@dataclass(frozen=True, slots=True, eq=False)
class FittedBar:
    """A bar with points on its axis.

    Attributes:
        bar: its axis and width.
        xy: (k, 2) points of the axis, px of the region.
        sigma: (k,) across the axis, independent.
        common: px across the axis, of all points together.
        brightness: grey value.
        contrast: brightness minus the background's median.
        misfit: root mean square of the normalized residuals of the sections that count.
    """

    bar: Bar
    xy: Floats
    sigma: Floats
    common: float
    brightness: float
    contrast: float
    misfit: float


def fit_bars(region: Region, starts: Sequence[Sequence[Bar]], brighter: bool, points: int) -> list[FittedBar]:
    """Fit bars that lie near each other together.

    Args:
        region: part of an image.
        starts: what may be there, approximately, each one bar or several, the likeliest first; the explanation that
            fits best is taken, and of two that are nearly alike the one with fewer bars. If the first is hopeless,
            there are no bars.
        brighter: than their background.
        points: on each axis, at most.

    Returns:
        The bars of the best explanation that are seen; none if nothing is explained.
    """
    pixels = _pixels(region, [bar for start in starts for bar in start], brighter)
    if len(pixels.grey) < _FEWEST:
        return []
    fits: list[_Fit] = []
    for start in starts:
        fits.append(_Fit(pixels, start))
        fits[-1].round()
        if fits[0].misfit > _HOPELESS:
            return []
        fits[-1].round()
    unit = max(1.0, min(fit.misfit for fit in fits)) ** 2
    price = unit * _OF_BAR * float(np.log(len(pixels.grey)))
    best = min(fits, key=lambda fit: fit.cost + price * fit.count)
    if not best.solve():
        return []
    return [bar for k in range(best.count) if (bar := best.measured(k, points)) is not None]


@dataclass(frozen=True, slots=True, eq=False)
class _Pixels:
    """The pixels around bars; coordinates from an origin among the bars.

    Attributes:
        origin: (2,) px of the region.
        x, y: (n,) px.
        grey, behind, sigma: (n,) grey value, background, standard deviation.
        brightness: approximate grey value of the bars.
    """

    origin: Floats
    x: Floats
    y: Floats
    grey: Floats
    behind: Floats
    sigma: Floats
    brightness: float


def _line(bar: Bar, origin: Floats) -> tuple[float, float, float, float]:
    """rho, theta, t0, t1 of a bar."""
    a, b = bar.ends - origin
    theta = float(np.arctan2(b[1] - a[1], b[0] - a[0]))
    along, across = np.array((np.cos(theta), np.sin(theta))), np.array((-np.sin(theta), np.cos(theta)))
    return float((a + b) @ across) / 2, theta, float(a @ along), float(b @ along)


def _pixels(region: Region, bars: Sequence[Bar], brighter: bool) -> _Pixels:
    origin = np.mean([bar.ends for bar in bars], axis=(0, 1))
    rows, columns = region.grey.shape
    reach = max(bar.width for bar in bars) / 2 + _MARGIN
    low = np.min([bar.ends for bar in bars], axis=(0, 1)) - reach - _MARGIN
    high = np.max([bar.ends for bar in bars], axis=(0, 1)) + reach + _MARGIN
    left, top = np.maximum(0, low.astype(int))
    right, bottom = np.minimum((columns, rows), high.astype(int) + 2)
    part = slice(top, bottom), slice(left, right)
    y, x = np.mgrid[part] - origin[::-1, None, None]
    near = np.zeros(x.shape, bool)
    for bar in bars:
        rho, theta, t0, t1 = _line(bar, origin)
        t, u = x * np.cos(theta) + y * np.sin(theta), y * np.cos(theta) - x * np.sin(theta) - rho
        near |= (np.abs(u) <= reach) & (t >= t0 - _MARGIN) & (t <= t1 + _MARGIN)
    difference = region.grey[part] - region.behind[part]
    opposite = region.front[part] & ((difference < 0) if brighter else (difference > 0))
    square = np.ones((2 * _OPPOSITE + 1, 2 * _OPPOSITE + 1), np.uint8)
    near &= cv2.dilate(opposite.astype(np.uint8), square) == 0
    grey, behind = region.grey[part][near].astype(float), region.behind[part][near].astype(float)
    inside = grey[region.front[part][near]]
    brightness = float(np.percentile(inside, 75 if brighter else 25)) if len(inside) else 0.0
    sigma = np.hypot(region.sigma[part][near].astype(float), _MODEL * np.abs(brightness - behind))
    return _Pixels(origin, x[near], y[near], grey, behind, sigma, brightness)


class _Fit:
    """The adjustment; unknowns: B, log h, log s, then rho, theta, t0, t1 of each bar."""

    def __init__(self, pixels: _Pixels, bars: Sequence[Bar]) -> None:
        self._pixels, self.count = pixels, len(bars)
        width = float(np.median([bar.width for bar in bars]))
        lines = [_line(bar, pixels.origin) for bar in bars]
        self.theta = np.concatenate(([pixels.brightness, np.log(max(width, 0.8) / 2), np.log(_BLUR)], *lines))
        spread = np.full(len(self.theta), np.inf)
        spread[1:3] = _WIDTH_SPREAD, _BLUR_SPREAD
        for k in range(len(bars)):
            spread[_SHARED + _OF_BAR * k + 2 :][:2] = _END_SPREAD
        self._expected, self._prior = self.theta.copy(), spread**-2.0
        longest = int(np.argmax([bar.length for bar in bars]))
        theta = lines[longest][1]
        along = pixels.x * np.cos(theta) + pixels.y * np.sin(theta)
        self._section = np.floor((along - along.min()) / _SECTION).astype(int)
        self._good = np.ones(len(pixels.grey), bool)
        self._normal = np.eye(len(self.theta))
        self.misfit = self.cost = np.inf

    def round(self) -> bool:
        """Some steps and a new choice of sections; whether nothing changes any more."""
        kept = self._good
        moved = self._adjust()
        self._choose()
        return bool(moved < _SETTLED and np.array_equal(kept, self._good))

    def solve(self) -> bool:
        """Adjust; False if too few pixels are explained."""
        for _ in range(_ROUNDS):
            if np.count_nonzero(self._good) < _FEWEST:
                return False
            if self.round():
                break
        return bool(np.count_nonzero(self._good) >= _FEWEST)

    def _adjust(self) -> float:
        """Some steps with the present sections; by how much the axes moved in the last one, px."""
        damping, moved = 1e-3, np.inf
        cost, normal, gradient = self._equations(self.theta)
        for _ in range(_STEPS):
            step = np.asarray(np.linalg.solve(normal + damping * np.diag(np.diag(normal)), gradient), float)
            trial = self._bounded(self.theta, step)
            new = self._equations(trial)
            if new[0] > cost:
                damping *= 10
                continue
            moved = self._moved(trial - self.theta)
            self.theta, (cost, normal, gradient), damping = trial, new, damping / 10
            if moved < _SETTLED:
                break
        self._normal = normal
        return moved

    def _moved(self, step: Floats) -> float:
        lines = step[_SHARED:].reshape(-1, _OF_BAR)
        reach = float(np.abs(self.theta[_SHARED + 2 :: _OF_BAR]).max())
        return float((np.abs(lines[:, 0]) + reach * np.abs(lines[:, 1])).max())

    @staticmethod
    def _bounded(theta: Floats, step: Floats) -> Floats:
        step = step.copy()
        step[1:3] = np.clip(step[1:3], -0.3, 0.3)
        step[_SHARED::_OF_BAR] = np.clip(step[_SHARED::_OF_BAR], -1.0, 1.0)
        step[_SHARED + 1 :: _OF_BAR] = np.clip(step[_SHARED + 1 :: _OF_BAR], -0.05, 0.05)
        new = theta + step
        new[2] = np.clip(new[2], np.log(0.35), np.log(3.0))
        return np.asarray(new)

    def _choose(self) -> None:
        """Keep the sections that are explained about as well as most."""
        value, _ = self._model(self.theta)
        square = ((self._pixels.grey - value) / self._pixels.sigma) ** 2
        count = np.bincount(self._section)
        mean = np.bincount(self._section, square) / np.maximum(count, 1)
        typical = max(1.0, float(np.median(mean[count > 0])))
        poor = (mean > _POOR * typical) & (count > 0)
        self._good = ~poor[self._section]
        self.misfit = float(np.sqrt(square[self._good].mean())) if self._good.any() else np.inf
        self.cost = float(np.minimum(square, _CAP).sum())

    def _equations(self, theta: Floats) -> tuple[float, Floats, Floats]:
        value, design = self._model(theta)
        good = self._good
        v = ((self._pixels.grey - value) / self._pixels.sigma)[good]
        j = (design / self._pixels.sigma[:, None])[good]
        off = self._expected - theta
        normal = j.T @ j + np.diag(self._prior + 1e-9)
        return float(v @ v + self._prior @ off**2), normal, j.T @ v + self._prior * off

    def _model(self, theta: Floats) -> tuple[Floats, Floats]:
        """Grey values (n,) and their derivatives (n, unknowns)."""
        h, s = float(np.exp(theta[1])), float(np.exp(theta[2]))
        covers, parts = [], []
        for k in range(self.count):
            cover, by = self._cover(theta[_SHARED + _OF_BAR * k :][:_OF_BAR], h, s)
            covers.append(cover)
            parts.append(by)
        open_ = np.prod([1 - c for c in covers], axis=0)
        contrast = theta[0] - self._pixels.behind
        design = np.zeros((len(self._pixels.grey), len(theta)))
        design[:, 0] = 1 - open_
        for k, by in enumerate(parts):
            others = np.prod([1 - c for i, c in enumerate(covers) if i != k], axis=0) * contrast
            design[:, _SHARED + _OF_BAR * k :][:, :_OF_BAR] = by[:, :_OF_BAR] * others[:, None]
            design[:, 1:3] += by[:, _OF_BAR:] * others[:, None]
        return self._pixels.behind + contrast * (1 - open_), design

    def _cover(self, line: Floats, h: float, s: float) -> tuple[Floats, Floats]:
        """Cover (n,) of a bar; derivatives (n, 6) by rho, theta, t0, t1, log h, log s."""
        rho, theta, t0, t1 = line
        cosine, sine = np.cos(theta), np.sin(theta)
        t, w = self._pixels.x * cosine + self._pixels.y * sine, self._pixels.y * cosine - self._pixels.x * sine
        u = w - rho
        above, below, front, back = (u + h) / s, (u - h) / s, (t - t0) / s, (t - t1) / s
        (f_above, d_above), (f_below, d_below), (f_front, d_front), (f_back, d_back) = map(
            _normal, (above, below, front, back)
        )
        across, along = f_above - f_below, f_front - f_back
        by_u, by_t = (d_above - d_below) / s * along, (d_front - d_back) / s * across
        by = np.empty((len(u), 6))
        by[:, 0] = -by_u
        by[:, 1] = -by_u * t + by_t * w
        by[:, 2], by[:, 3] = -d_front / s * across, d_back / s * across
        by[:, 4] = (d_above + d_below) * h / s * along
        by[:, 5] = -(above * d_above - below * d_below) * along - (front * d_front - back * d_back) * across
        return across * along, by

    def measured(self, k: int, points: int) -> FittedBar | None:
        """Points on the axis of a bar, each from the pixels of a section, with all other unknowns as adjusted."""
        theta = self.theta
        rho, angle, t0, t1 = theta[_SHARED + _OF_BAR * k :][:_OF_BAR]
        h = float(np.exp(theta[1]))
        along = self._pixels.x * np.cos(angle) + self._pixels.y * np.sin(angle)
        value, design = self._model(theta)
        sections = max(1, int(min(points, (t1 - t0) / _SECTION)))
        place = np.floor((along - t0) / max(1e-9, t1 - t0) * sections).astype(int)
        good = self._good & (place >= 0) & (place < sections)
        j = (design[:, _SHARED::_OF_BAR] / self._pixels.sigma[:, None])[good]
        v = ((self._pixels.grey - value) / self._pixels.sigma)[good]
        t, shift, sigma = self._shifts(k, j, v, place[good], along[good], sections)
        fine = np.isfinite(sigma)
        if np.count_nonzero(fine) < 2:
            return None
        t, shift, sigma = t[fine], shift[fine], max(1.0, self.misfit) * sigma[fine]
        axis, normal = np.array((np.cos(angle), np.sin(angle))), np.array((-np.sin(angle), np.cos(angle)))
        xy = self._pixels.origin + t[:, None] * axis + (rho + shift)[:, None] * normal
        ends = self._pixels.origin + np.array((t0, t1))[:, None] * axis + rho * normal
        contrast = float(np.median(theta[0] - self._pixels.behind))
        common = self._common(k, t, sigma)
        return FittedBar(Bar(ends, 2 * h), xy, sigma, common, float(theta[0]), contrast, self.misfit)

    def _shifts(
        self, k: int, j: Floats, v: Floats, place: Integers, along: Floats, sections: int
    ) -> tuple[Floats, Floats, Floats]:
        """Where along, how far off the axis, and with which sigma, section by section: all bars' shifts together."""
        t, shift, sigma = (np.full(sections, np.nan) for _ in range(3))
        for i in range(sections):
            own = place == i
            a = j[own]
            seen = (a**2).sum(axis=0) > 1e-6
            if not seen[k]:
                continue
            normal = a[:, seen].T @ a[:, seen]
            inverse = np.linalg.pinv(normal + 1e-9 * np.eye(len(normal)))
            at = int(np.count_nonzero(seen[:k]))
            weight = a[:, k] ** 2
            t[i] = weight @ along[own] / weight.sum()
            shift[i], sigma[i] = (inverse @ (a[:, seen].T @ v[own]))[at], np.sqrt(inverse[at, at])
        sigma[~(sigma < _MARGIN)] = np.nan
        return t, shift, sigma

    def _common(self, k: int, t: Floats, sigma: Floats) -> float:
        """What width, brightness and blur add to the sigma of the axis; all points share it."""
        first = _SHARED + _OF_BAR * k
        whole = np.linalg.inv(self._normal)[first : first + 2, first : first + 2] * max(1.0, self.misfit) ** 2
        weight = sigma**-2
        at = float(np.average(t, weights=weight))
        row = np.array((1.0, at))
        return float(np.sqrt(max(0.0, row @ whole @ row - 1 / weight.sum())))


def _normal(x: Floats) -> tuple[Floats, Floats]:
    """The normal distribution function and its derivative, approximately."""
    a, b = _NORMAL
    square = x * x
    value = 1 / (1 + np.exp(np.clip(-x * (a + b * square), -500, 500)))
    return value, value * (1 - value) * (a + 3 * b * square)
