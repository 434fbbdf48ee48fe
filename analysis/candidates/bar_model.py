"""Long bars before a known background: the pixels around them, and what a model of bars says about their grey values.

The image of a uniform rectangle of half width h behind a blur s is the product of two differences of the normal
distribution, across and along:

    cover(u, t) = [F((u + h) / s) - F((u - h) / s)] [F((t - t0) / s) - F((t - t1) / s)].

Bars of one brightness B that cover each other hide what is behind by 1 - product(1 - cover). Width, blur and
brightness are those of a pair of skis: one for all bars.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from scipy.special import expit

from analysis.candidates.background import Region
from rig.arrays import Floats, Integers

SHARED: Final = 3  #: unknowns that all bars share: brightness, log of the half width, log of the blur
OF_BAR: Final = 4  #: unknowns of each bar: rho, theta, t0, t1
MARGIN: Final = 2.6  #: px beside and beyond a bar that are fitted
_OPPOSITE = 1  # px around pixels in front that differ from the background in the other direction
_MODEL = 0.03  # of the contrast: residuals that the model itself leaves
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
    x: Floats
    y: Floats
    grey: Floats
    behind: Floats
    sigma: Floats
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
    y, x = np.mgrid[part] - origin[::-1, None, None]
    near = np.zeros(x.shape, bool)
    for bar in bars:
        rho, theta, t0, t1 = bar.line(origin)
        t, u = x * np.cos(theta) + y * np.sin(theta), y * np.cos(theta) - x * np.sin(theta) - rho
        near |= (np.abs(u) <= reach) & (t >= t0 - MARGIN) & (t <= t1 + MARGIN)
    difference = region.grey[part] - region.behind[part]
    opposite = region.front[part] & ((difference < 0) if brighter else (difference > 0))
    square = np.ones((2 * _OPPOSITE + 1, 2 * _OPPOSITE + 1), np.uint8)
    near &= cv2.dilate(opposite.astype(np.uint8), square) == 0
    grey, behind = region.grey[part][near].astype(float), region.behind[part][near].astype(float)
    inside = grey[region.front[part][near]]
    brightness = float(np.percentile(inside, 75 if brighter else 25)) if len(inside) else 0.0
    sigma = np.hypot(region.sigma[part][near].astype(float), _MODEL * np.abs(brightness - behind))
    return Pixels(origin, x[near], y[near], grey, behind, sigma, brightness)


def lines_of(theta: Floats) -> Floats:
    """(bars, 4) rho, theta, t0, t1 among the unknowns."""
    return np.asarray(theta[SHARED:].reshape(-1, OF_BAR))


def modelled(pixels: Pixels, theta: Floats) -> tuple[Floats, Floats]:
    """Grey values (n,) and their derivatives (unknowns, n).

    Args:
        pixels: where.
        theta: B, log h, log s, then rho, theta, t0, t1 of each bar.
    """
    h, s = float(np.exp(theta[1])), float(np.exp(theta[2]))
    parts = [_cover(pixels, line.tolist(), h, s) for line in lines_of(theta)]
    contrast = theta[0] - pixels.behind
    open_ = np.ones(len(pixels))
    for part in parts:
        open_ *= 1 - part[0]
    design = np.zeros((len(theta), len(pixels)))
    design[0] = 1 - open_
    for k, part in enumerate(parts):
        others = contrast
        for i, other in enumerate(parts):
            if i != k:
                others = others * (1 - other[0])
        for i in range(OF_BAR):
            np.multiply(part[1 + i], others, out=design[SHARED + OF_BAR * k + i])
        design[1] += part[5] * others
        design[2] += part[6] * others
    return pixels.behind + contrast * design[0], design


def _cover(pixels: Pixels, line: list[float], h: float, s: float) -> tuple[Floats, ...]:
    """Cover (n,) of a bar, and its derivatives by rho, theta, t0, t1, log h, log s."""
    rho, theta, t0, t1 = line
    cosine, sine = np.cos(theta), np.sin(theta)
    t, w = pixels.x * cosine + pixels.y * sine, pixels.y * cosine - pixels.x * sine
    u, along = (w - rho) / s, t / s
    above, below, front, back = u + h / s, u - h / s, along - t0 / s, along - t1 / s
    (f_above, d_above), (f_below, d_below) = _normal(above), _normal(below)
    (f_front, d_front), (f_back, d_back) = _normal(front), _normal(back)
    across, length = f_above - f_below, f_front - f_back
    by_u, by_t = (d_above - d_below) * (length / s), (d_front - d_back) * (across / s)
    by_s = -(above * d_above - below * d_below) * length - (front * d_front - back * d_back) * across
    edge = across / s
    return (
        across * length,
        -by_u,
        by_t * w - by_u * t,
        -d_front * edge,
        d_back * edge,
        (d_above + d_below) * (h / s) * length,
        by_s,
    )


def _normal(x: Floats) -> tuple[Floats, Floats]:
    """The normal distribution function and its derivative, approximately."""
    a, b = _NORMAL
    square = x * x
    value = np.asarray(expit(x * (a + b * square)), float)
    return value, value * (1 - value) * (a + 3 * b * square)
