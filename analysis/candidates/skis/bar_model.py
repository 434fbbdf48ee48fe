"""Long bars before a known background: the pixels around them, and what a model of bars says about their grey values.

The image of a uniform rectangle of half width h behind a blur s is the product of two differences of the normal
distribution, across and along:

    cover(u, t) = [F((u + h) / s) - F((u - h) / s)] [F((t - t0) / s) - F((t - t1) / s)].

Bars of one brightness B that cover each other hide what is behind by 1 - product(1 - cover). Blur and brightness are
those of a pair of skis: one for all bars. Each bar has a width of its own: two flat skis of a V turn their faces to a
camera at different angles, and are up to 1 : 2 as wide.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, permutations
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.candidates.foreground.background import Region
from analysis.candidates.median import quantile
from rig.arrays import Floats, Integers

SHARED: Final = 2  #: unknowns that all bars share: brightness, log of the blur
OF_BAR: Final = 5  #: unknowns of each bar: rho, theta, t0, t1, log of the half width
WIDTH: Final = 4  #: place of the last one among these
MARGIN: Final = 2.6  #: px beside and beyond a bar that are fitted
_OPPOSITE = 1  # px around pixels in front that differ from the background in the other direction
MODEL: Final = 0.03  #: of the contrast: residuals that the model itself leaves
#: Two parallel skis look equally wide but for some edging; of two that are turned against each other each is seen at
#: another angle. Flat skis are seen at some 0.3 rad, so a turn of 0.1 changes a width by a third.
_EDGED, _SEEN_AT = 0.1, 0.3
_FAR = 6.0  # of the normal distribution: 1e-9 from its limit
_NORMAL = 1.59577, 0.07056  # logit of the normal distribution: error below 2e-4, one exponential for it and its slope


GreyValues = NDArray[np.float32]  #: of pixels, and what is computed for each pixel


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

    def line(self, origin: Floats) -> tuple[float, float, float, float]:
        """rho, theta, t0, t1: distance of the axis from an origin, its direction, where along it the bar ends."""
        a, b = self.ends - origin
        theta = float(np.arctan2(b[1] - a[1], b[0] - a[0]))
        along, across = directions(theta)
        return float((a + b) @ across) / 2, theta, float(a @ along), float(b @ along)


@dataclass(frozen=True, slots=True, eq=False)
class Pixels:
    """The pixels around bars.

    Attributes:
        origin: (2,) of the coordinates, px of the region.
        x, y: (n,) px from the origin.
        grey, behind, sigma: (n,) grey value, background, standard deviation.
        brightness: approximate grey value of the bars.
    """

    origin: Floats
    x: GreyValues
    y: GreyValues
    grey: GreyValues
    behind: GreyValues
    sigma: GreyValues
    brightness: float

    def __len__(self) -> int:
        return len(self.grey)

    def thinned(self, most: int) -> "Pixels":
        """About so many of them, spread evenly."""
        if len(self) <= most:
            return self
        chosen: Integers = np.linspace(0, len(self) - 1, most).astype(np.intp)
        x, y, grey, behind, sigma = (part[chosen] for part in (self.x, self.y, self.grey, self.behind, self.sigma))
        return Pixels(self.origin, x, y, grey, behind, sigma, self.brightness)


def directions(theta: float) -> tuple[Floats, Floats]:
    """Unit vectors along and across an axis."""
    return np.array((np.cos(theta), np.sin(theta))), np.array((-np.sin(theta), np.cos(theta)))


def pixels_around(region: Region, bars: Sequence[Bar], brighter: bool) -> Pixels:
    """The pixels that say something about bars; without what differs from the background in the other direction.

    Args:
        region: part of an image.
        bars: approximately.
        brighter: than their background.
    """
    origin = np.mean([bar.ends for bar in bars], axis=(0, 1))
    rows, columns = region.grey.shape
    reach = max(bar.width for bar in bars) / 2 + MARGIN
    low = np.min([bar.ends for bar in bars], axis=(0, 1)) - reach - MARGIN
    high = np.max([bar.ends for bar in bars], axis=(0, 1)) + reach + MARGIN
    left, top = np.maximum(0, low.astype(int))
    right, bottom = np.minimum((columns, rows), high.astype(int) + 2)
    part = slice(top, bottom), slice(left, right)
    x = (np.arange(left, right) - origin[0]).astype(np.float32)
    y = (np.arange(top, bottom) - origin[1]).astype(np.float32)[:, None]
    near = np.zeros((len(y), len(x)), bool)
    for bar in bars:
        rho, theta, t0, t1 = bar.line(origin)
        t, u = x * np.cos(theta) + y * np.sin(theta), y * np.cos(theta) - x * np.sin(theta) - rho
        near |= (np.abs(u) <= reach) & (t >= t0 - MARGIN) & (t <= t1 + MARGIN)
    difference = region.grey[part] - region.behind[part]
    opposite = region.front[part] & ((difference < 0) if brighter else (difference > 0))
    square = np.ones((2 * _OPPOSITE + 1, 2 * _OPPOSITE + 1), np.uint8)
    near &= cv2.dilate(opposite.astype(np.uint8), square) == 0
    grey, behind = region.grey[part][near], region.behind[part][near]
    inside = grey[region.front[part][near]]
    brightness = quantile(inside, 0.75 if brighter else 0.25) if len(inside) else 0.0
    sigma = np.hypot(region.sigma[part][near], np.float32(MODEL) * np.abs(np.float32(brightness) - behind))
    row, column = np.nonzero(near)
    return Pixels(origin, x[column], y[row, 0], grey, behind, sigma, brightness)


def lines_of(theta: Floats) -> Floats:
    """(bars, 5) rho, theta, t0, t1, log h among the unknowns."""
    return np.asarray(theta[SHARED:].reshape(-1, OF_BAR))


def place_of_width(k: int) -> int:
    """Where among the unknowns the width of a bar is."""
    return SHARED + OF_BAR * k + WIDTH


def alike_widths(bars: Sequence[Bar]) -> Floats:
    """What is expected of the ratios of the widths of bars, as a part of normal equations of all unknowns."""
    normal = np.zeros((SHARED + OF_BAR * len(bars),) * 2)
    for i, j in combinations(range(len(bars)), 2):
        one, two = (bars[k].ends[1] - bars[k].ends[0] for k in (i, j))
        turned = abs(one[0] * two[1] - one[1] * two[0]) / (bars[i].length * bars[j].length)
        difference = np.zeros(len(normal))
        difference[[place_of_width(i), place_of_width(j)]] = 1.0, -1.0
        normal += np.outer(difference, difference) / (_EDGED**2 + (turned / _SEEN_AT) ** 2)
    return normal


def modelled(pixels: Pixels, theta: Floats) -> tuple[GreyValues, GreyValues]:
    """Grey values (n,) and their derivatives (unknowns, n).

    Args:
        pixels: where.
        theta: B, log s, then rho, theta, t0, t1, log h of each bar.
    """
    cover, by_line, by_blur = _covers(pixels, theta)
    contrast = theta[0].astype(pixels.behind.dtype) - pixels.behind
    open_ = 1 - cover
    design = np.empty((len(theta), len(pixels)), pixels.behind.dtype)
    of_bars = design[SHARED:].reshape(by_line.shape)
    through = np.repeat(contrast[None], len(cover), axis=0)  # what the other bars let through
    for k, i in permutations(range(len(cover)), 2):
        through[k] *= open_[i]
    np.multiply(by_line, through[:, None], out=of_bars)
    by_blur *= through
    np.sum(by_blur, axis=0, out=design[1])
    np.subtract(1, np.prod(open_, axis=0), out=design[0])
    return pixels.behind + contrast * design[0], design


def _covers(pixels: Pixels, theta: Floats) -> tuple[GreyValues, GreyValues, GreyValues]:
    """Covers (bars, n), and their derivatives by rho, theta, t0, t1, log h (bars, 5, n), and by log s (bars, n)."""
    lines = lines_of(theta).astype(pixels.x.dtype)
    s = np.exp(theta[1]).astype(pixels.x.dtype)
    rho, angle, t0, t1, log_h = lines.T[..., None]
    h = np.exp(log_h)
    cosine, sine = np.cos(angle), np.sin(angle)
    t, w = pixels.x * cosine + pixels.y * sine, pixels.y * cosine - pixels.x * sine
    border = np.empty((len(lines), 4, len(pixels)), t.dtype)  # distance from each, in units of the blur
    u, along = (w - rho) / s, t / s
    np.add(u, h / s, out=border[:, 0])
    np.subtract(u, h / s, out=border[:, 1])
    np.subtract(along, t0 / s, out=border[:, 2])
    np.subtract(along, t1 / s, out=border[:, 3])
    value, slope = _normal(border)
    across, length = value[:, 0] - value[:, 1], value[:, 2] - value[:, 3]
    edge, side = across / s, length / s
    by_u, by_t = (slope[:, 0] - slope[:, 1]) * side, (slope[:, 2] - slope[:, 3]) * edge
    by_line = np.empty((len(lines), OF_BAR, len(pixels)), t.dtype)
    np.negative(by_u, out=by_line[:, 0])
    np.subtract(by_t * w, by_u * t, out=by_line[:, 1])
    np.multiply(slope[:, 2], -edge, out=by_line[:, 2])
    np.multiply(slope[:, 3], edge, out=by_line[:, 3])
    np.multiply(slope[:, 0] + slope[:, 1], h * side, out=by_line[:, WIDTH])
    border *= slope
    by_blur = (border[:, 1] - border[:, 0]) * length - (border[:, 2] - border[:, 3]) * across
    return across * length, by_line, by_blur


def _normal(x: GreyValues) -> tuple[GreyValues, GreyValues]:
    """The normal distribution function and its derivative, approximately."""
    a, b = _NORMAL
    near = np.clip(x, -_FAR, _FAR)
    square = near * near
    value = np.asarray(1 / (1 + np.exp(-near * (a + b * square))), x.dtype)
    return value, value * (1 - value) * (a + 3 * b * square)
