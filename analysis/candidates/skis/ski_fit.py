"""Fits one or several long bars (`analysis.candidates.skis.bar_model`) to all pixels around them, background known.

Two skis that nearly cover each other are separated by what is known of each from where it is alone. The adjustment is
robust in sections along the bars: a section that is not explained (body, boot, marker, a flake of snow) is left out as
a whole, because leaving out single pixels would move the axis. Which explanation holds, one bar or two, is decided by
what remains unexplained, with a price for each bar.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.candidates.median import median, quantile
from analysis.candidates.skis.bar_model import (
    MARGIN,
    MODEL,
    OF_BAR,
    SHARED,
    WIDTH,
    Bar,
    GreyValues,
    Pixels,
    alike_widths,
    directions,
    lines_of,
    modelled,
    pixels_around,
    place_of_width,
)
from rig.arrays import Flags, Floats, Integers

_BLUR, _BLUR_SPREAD = 0.65, 0.4  # px; weak prior of log s: of lens and pixels
_BLURS = np.log(0.35), np.log(3.0)
_WIDTH_SPREAD = 0.3  # of log h, around what the edges say
_END_SPREAD = 3.0  # px
_BRIGHTNESS_SPREAD = 0.25  # of the contrast
_ROUNDS, _STEPS = 4, 3  # choice of sections; steps of the adjustment in each
_SETTLED = 0.01  # px by which an axis still moves
_LARGEST_STEPS = 0.3, 1.0, 0.05  # of logarithms, rho and theta
_SECTION = 2.0  # px along the bars
_POOR, _TYPICAL = 3.0, 0.35  # mean square of the residuals of a section: times this quantile over the sections
_ROBUST = 3.0  # residuals over noise that count half in the first steps
_CAP = 25.0  # squared residuals are counted up to that when explanations are compared
_HOPELESS = 5.0  # residuals over noise of a first explanation that no other start will mend
_COMPARED = 700  # pixels with which explanations are compared; the best one is adjusted to all
_UNSEEN = 1e-3  # 1 / px^2: weight of a bar's shift below which a section says nothing about it
_BOTH_EDGES = 0.5  # of the weight of a section's width is left beside its shift, at least, where both edges tell it
_POINT = 0.012  # of the width: a ski's border waves by that, and it is nearer to the camera at one end
_SIDECUT = 0.03  # of the width, standard deviation along a ski: some 0.11 m at shovel and tail, 0.10 m at the waist
#: By so much the middle between the edges of a ski may be off its axis, standard deviation, px.
AXIS_PX: Final = 0.015
_FEWEST = 30  # pixels
_KNOWS_NOTHING = 1e-2  # precision of a width's logarithm


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
        one_sided: (k,) by how much the points move across the axis if the bar's half width grows by 1: 0 where both its
            edges are seen, -1 or 1 where one is.
        widening: (k,) by how much half of the width is larger there than the bar's, px; NaN where nothing tells, and in
            bars that were fitted together: another one may be what is wider.
        width_spread: standard deviation of the width's logarithm, without what was expected of it.
        of_width: px, the part of `common` and `lasting` that the uncertainty of the width makes.
        lasting: px, the part of `common` that neighbouring images share: they show the same things beside the ski.
    """

    bar: Bar
    xy: Floats
    sigma: Floats
    common: float
    brightness: float
    contrast: float
    misfit: float
    one_sided: Floats
    widening: Floats
    width_spread: float
    of_width: float
    lasting: float


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
    pixels = pixels_around(region, [bar for start in starts for bar in start], brighter)
    if len(pixels) < _FEWEST:
        return []
    few = pixels.thinned(_COMPARED)
    fits: list[_Fit] = []
    for start in starts:
        fits.append(_Fit(few, start))
        fits[-1].round()
        if fits[0].misfit > _HOPELESS:
            return []
        if len(starts) > 1:  # to be compared
            fits[-1].round()
    unit = max(1.0, min(fit.misfit for fit in fits)) ** 2
    price = unit * OF_BAR * float(np.log(len(few)))
    chosen = min(fits, key=lambda fit: fit.cost + price * fit.count)
    best = chosen.on(pixels)
    if not best.solve():
        return []
    rivals = [fit for fit in fits if fit.count > chosen.count and fit.cost < chosen.cost + price * fit.count]
    doubt = max((fit.farthest(best) for fit in rivals), default=0.0)
    return [bar for k in range(best.count) if (bar := best.measured(k, points, doubt)) is not None]


class _Fit:
    """The adjustment; unknowns as in `modelled`."""

    def __init__(self, pixels: Pixels, bars: Sequence[Bar], begin: Floats | None = None) -> None:
        """Prepare the adjustment of bars to pixels, from these bars or from unknowns that are known better."""
        self._pixels, self._bars, self.count = pixels, bars, len(bars)
        lines = [(*bar.line(pixels.origin), np.log(max(bar.width, 0.8) / 2)) for bar in bars]
        start = np.concatenate(([pixels.brightness, np.log(_BLUR)], *lines))
        spread = np.full(len(start), np.inf)
        spread[0] = _BRIGHTNESS_SPREAD * (1 + abs(pixels.brightness - median(pixels.behind)))
        spread[1] = _BLUR_SPREAD
        lines_of(spread)[:, 2:] = _END_SPREAD, _END_SPREAD, _WIDTH_SPREAD
        alone = np.diag(spread**-2.0)
        self._prior = alone + alike_widths(bars)
        self._of_prior = self._prior + 1e-9 * np.eye(len(start))
        self._expected = np.linalg.solve(self._of_prior, (alone + 1e-9 * np.eye(len(start))) @ start)
        self._largest = np.full(len(start), np.inf)
        self._largest[1] = lines_of(self._largest)[:, WIDTH] = _LARGEST_STEPS[0]
        lines_of(self._largest)[:, :2] = _LARGEST_STEPS[1:]
        theta = lines[int(np.argmax([bar.length for bar in bars]))][1]
        along = pixels.x * np.cos(theta) + pixels.y * np.sin(theta)
        self._section = np.floor((along - along.min()) / _SECTION).astype(int)
        self._in_section = np.bincount(self._section)
        self._good = np.ones(len(pixels), bool)
        self._robust = True
        self.misfit = self.cost = np.inf
        self._at = self._modelled(start if begin is None else begin)

    @property
    def theta(self) -> Floats:
        """The unknowns as adjusted."""
        return self._at.theta

    def on(self, pixels: Pixels) -> "_Fit":
        """The same explanation with other pixels, from where this one has come to."""
        if pixels is self._pixels:
            return self
        other = _Fit(pixels, self._bars, self.theta)
        other._robust = False
        other._choose()
        return other

    def round(self) -> bool:
        """Some steps and a new choice of sections; whether nothing changes any more."""
        kept = self._good
        moved = self._adjust()
        self._choose()
        self._robust = False
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
        now = self._equations(self._at)
        for _ in range(_STEPS):
            damped = now.normal.copy()
            damped.flat[:: len(damped) + 1] *= 1 + damping
            trial = self._bounded(np.asarray(np.linalg.solve(damped, now.gradient), float))
            there = self._modelled(trial)
            new = self._equations(there)
            if new.cost > now.cost:
                damping *= 10
                continue
            moved = self._moved(trial - self.theta)
            self._at, now, damping = there, new, damping / 10
            if moved < _SETTLED:
                break
        self._normal = now.normal
        return moved

    def _moved(self, step: Floats) -> float:
        reach = float(np.abs(lines_of(self.theta)[:, 2:WIDTH]).max())
        lines = lines_of(step)
        return float((np.abs(lines[:, 0]) + reach * np.abs(lines[:, 1])).max())

    def _bounded(self, step: Floats) -> Floats:
        new = self.theta + np.minimum(np.maximum(step, -self._largest), self._largest)
        new[1] = min(max(new[1], _BLURS[0]), _BLURS[1])
        return np.asarray(new)

    def _choose(self) -> None:
        """Keep the sections that are explained about as well as most."""
        square = self._at.residuals**2
        mean = np.bincount(self._section, square) / np.maximum(self._in_section, 1)
        there = self._in_section > 0
        typical = max(1.0, quantile(mean[there], _TYPICAL))
        self._good = ~(mean > _POOR * typical)[self._section]
        self.misfit = float(np.sqrt(square[self._good].mean())) if self._good.any() else np.inf
        self.cost = float(np.minimum(square, _CAP).sum())

    def _modelled(self, theta: Floats) -> "_Modelled":
        value, design = modelled(self._pixels, theta)
        design /= self._pixels.sigma
        return _Modelled(theta, (self._pixels.grey - value) / self._pixels.sigma, design)

    def _equations(self, at: "_Modelled") -> "_Equations":
        off = self._expected - at.theta
        square = at.residuals**2
        if self._robust:  # Cauchy's estimator
            weight = self._good / (1 + square / np.float32(_ROBUST**2))
            cost = _ROBUST**2 * float(np.log1p(square / np.float32(_ROBUST**2)) @ self._good)
        else:
            weight = self._good.astype(np.float32)
            cost = float(square @ weight)
        weighted = at.design * weight
        normal = (weighted @ at.design.T).astype(float) + self._of_prior
        pulled = self._prior @ off
        gradient = weighted @ at.residuals + pulled
        return _Equations(cost + float(pulled @ off), normal, gradient)

    def farthest(self, other: "_Fit") -> float:
        """By how much the axes of this explanation lie aside the nearest axis of another one, at their middles, px."""
        worst = 0.0
        for rho, theta, t0, t1, _ in lines_of(self.theta):
            along, across = directions(theta)
            place = (t0 + t1) / 2 * along + rho * across
            off = [abs(float(place @ directions(a)[1]) - r) for r, a, *_ in lines_of(other.theta)]
            worst = max(worst, min(off))
        return min(worst, MARGIN)

    def measured(self, k: int, points: int, doubt: float) -> FittedBar | None:
        """Points on the axis of a bar, each from the pixels of a section, with all other unknowns as adjusted.

        Args:
            k: number of the bar.
            points: on its axis, at most.
            doubt: px by which another explanation has axes elsewhere.
        """
        theta, pixels = self.theta, self._pixels
        rho, angle, t0, t1, log_h = lines_of(theta)[k]
        axis, across = directions(angle)
        along = pixels.x * axis[0] + pixels.y * axis[1]
        sections = max(1, int(min(points, (t1 - t0) / _SECTION)))
        place = np.floor((along - t0) / max(1e-9, t1 - t0) * sections).astype(int)
        good = self._good & (place >= 0) & (place < sections)
        bar = Bar(pixels.origin + np.array((t0, t1))[:, None] * axis + rho * across, 2 * float(np.exp(log_h)))
        t, shift, sigma, one_sided, widening, doubtful = self._shifts(k, good, place[good], along[good], sections)
        fine = np.isfinite(sigma)
        if np.count_nonzero(fine) < 2:
            return None
        t, shift, one_sided = t[fine], shift[fine], one_sided[fine] / (bar.width / 2)
        model = np.hypot(_POINT, _SIDECUT / 2 * one_sided) * bar.width
        scale = max(1.0, self.misfit)
        # what is wider by more than that has an edge which is not its own: its middle is off by as much
        foreign = np.maximum(0.0, widening[fine] ** 2 - (scale * doubtful[fine]) ** 2 - _SIDECUT**2)
        sigma = np.sqrt((scale * sigma[fine]) ** 2 + model**2 + np.nan_to_num(foreign) * (bar.width / 2) ** 2)
        xy = pixels.origin + t[:, None] * axis + (rho + shift)[:, None] * across
        contrast = median(theta[0] - pixels.behind)
        own, of_width, width_spread = self._common(k, t, sigma)
        lasting = float(np.hypot(of_width, doubt))
        return FittedBar(
            bar,
            xy,
            sigma,
            float(np.linalg.norm((own, lasting, AXIS_PX))),
            float(theta[0]),
            contrast,
            self.misfit,
            one_sided,
            widening[fine] * bar.width / 2 if self.count == 1 else np.full(len(t), np.nan),
            width_spread,
            of_width,
            lasting,
        )

    def _shifts(
        self, k: int, good: Flags, place: Integers, along: Floats, sections: int
    ) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats]:
        """Where along, how far off the axis, and with which sigma, section by section: all bars' shifts together.

        The last three arrays are how the shifts change with the logarithm of the bar's width, by how much it differs in
        the section, and the sigma of this; the last two are NaN where both edges do not tell it.
        """
        j, v, by_width = (
            part[..., good]
            for part in (self._at.design[SHARED::OF_BAR], self._at.residuals, self._at.design[place_of_width(k)])
        )
        normal = np.empty((sections, self.count, self.count))
        right, right_width = np.empty((sections, self.count)), np.empty((sections, self.count))
        for a in range(self.count):
            right[:, a] = np.bincount(place, j[a] * v, sections)
            right_width[:, a] = np.bincount(place, j[a] * by_width, sections)
            for b in range(self.count):
                normal[:, a, b] = np.bincount(place, j[a] * j[b], sections)
        seen = normal[:, k, k] > _UNSEEN
        right, right_width = right[seen], right_width[seen]
        inverse = np.linalg.inv(normal[seen] + _UNSEEN * np.eye(self.count))
        shifts, of_width = ((inverse @ part[..., None])[..., 0] for part in (right, right_width))
        t, shift, sigma, one_sided, widening, doubtful = (np.full(sections, np.nan) for _ in range(6))
        t[seen] = np.bincount(place, j[k] ** 2 * along, sections)[seen] / normal[seen, k, k]
        shift[seen], one_sided[seen] = shifts[:, k], -of_width[:, k]
        sigma[seen] = np.sqrt(inverse[:, k, k])
        sigma[~(sigma < MARGIN)] = np.nan
        width = np.bincount(place, by_width**2, sections)[seen]
        left = width - (right_width * of_width).sum(axis=1)
        off = np.bincount(place, by_width * v, sections)[seen] - (right_width * shifts).sum(axis=1)
        told = left > _BOTH_EDGES * width
        with np.errstate(all="ignore"):
            widening[seen], doubtful[seen] = np.where(told, (off / left, left**-0.5), np.nan)
        return t, shift, sigma, one_sided, widening, doubtful

    def _common(self, k: int, t: Floats, sigma: Floats) -> tuple[float, float, float]:
        """What all points of an axis share: from brightness and blur, from the width, px; and the width's own spread.

        What a model does not know of a border (its softness, a stripe, a print) is alike all along a bar: it does not
        average out over the length as noise does, and the width takes it up. It moves both edges alike, not the axis.
        """
        inverse = np.linalg.inv(self._normal)
        line, width = slice(SHARED + OF_BAR * k, SHARED + OF_BAR * k + 2), place_of_width(k)
        by_width = inverse[line, width] / inverse[width, width]
        given = inverse[line, line] - np.outer(by_width, by_width) * inverse[width, width]
        weight = sigma**-2
        row = np.array((1.0, float(np.average(t, weights=weight))))
        scale, own = max(1.0, self.misfit) ** 2, 1 / float(weight.sum())
        common = max(0.0, scale * float(row @ given @ row) - own)
        # of the pixels, without what was expected
        precision = max(_KNOWS_NOTHING, 1 / float(inverse[width, width]) - _WIDTH_SPREAD**-2.0)
        variance = (scale + self._alike(k)) / precision
        whole = 1 / (1 / variance + _WIDTH_SPREAD**-2.0)
        return float(np.sqrt(common)), abs(float(row @ by_width)) * float(np.sqrt(whole)), float(np.sqrt(variance))

    def _alike(self, k: int) -> float:
        """How much more the model's own errors, alike along a bar, add to the variance of its width than noise does."""
        pixels, (_, angle, t0, t1, _) = self._pixels, lines_of(self.theta)[k]
        along = pixels.x * np.cos(angle) + pixels.y * np.sin(angle)
        here = self._good & (along > t0) & (along < t1)
        if not here.any():
            return 0.0
        of_model = MODEL * (self.theta[0] - pixels.behind[here]) / pixels.sigma[here]
        rows = _SECTION * len(np.unique(self._section[here]))
        return rows * float(np.minimum(of_model**2, 1.0).mean())


@dataclass(frozen=True, slots=True, eq=False)
class _Modelled:
    """What the model says with some unknowns: normalized residuals (n,) and derivatives (unknowns, n)."""

    theta: Floats
    residuals: GreyValues
    design: GreyValues


@dataclass(frozen=True, slots=True, eq=False)
class _Equations:
    """Normal equations of an adjustment."""

    cost: float
    normal: Floats
    gradient: Floats
