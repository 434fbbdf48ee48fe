"""Finds a thing again by its appearance: a template from one image, matched in another by least squares.

The thing moves before what is behind it, and markers are small or there are none: often its outline before the snow is
all that an image shows of it. So a template knows which share of each pixel belongs to the thing, from the difference
to the static background, and a match composes it with the background of the new place,

    I(x + A p) = gain T(p) + offset + (1 - share(p)) (B(x + A p) - B_T(p)),

with unknown place x, affine A, gain and offset (least-squares matching, Gruen 1985). Pixels that do not agree (a limb
that moves otherwise, a flake of snow) lose their weight. Residuals of neighbouring pixels go together, so that the
covariance is taken from blocks of pixels, each with the residuals that it has (a sandwich estimate).
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.candidates.median import median
from analysis.digitizing.following.points.thing_template import Picture, Template
from analysis.scene.static_image import GreyImage
from rig.arrays import Floats

CORRELATED: Final = 0.8  #: correlation of a match, at least
_STEPS_MOST, _SETTLED_PX = 15, 1e-2  # iterations; px
_LARGEST_STEP = 1.0  # px
_FARTHEST = 3.0  # px that a match may lie from its start: farther away is another start
_AFFINE_SPREAD = 0.04  # of A from one match to the next
_GAIN_SPREAD, _OFFSET_SPREAD = 0.2, 10.0  # grey values
_MAD_TO_SIGMA = 1.4826
_HALF_SIGMAS = 3.0  # residuals that count half
_BLOCK = 3  # px; residuals farther apart are independent
_APART = 2.0  # px between two peaks of the correlation
_RIVAL = 0.25  # of the correlation, by which a peak may be lower than the highest one: it is taken on whole pixels
_UNKNOWNS = 8  # x, y, A, gain, offset
_WEIGHT_AGREEING = 0.25  # of the weight of the template, that must agree
_UNEXPLAINED = 1.5  # times the noise: larger residuals say that what surrounds the thing may move otherwise
_CORE = 0.35  # of the half size of a template: the thing itself
_DETERMINED_PX = 1.0  # sigma of a match of the core alone, at most


@dataclass(frozen=True, slots=True, eq=False)
class Match:
    """A template found again.

    Attributes:
        xy: (2,) place of the thing, px.
        covariance: (2, 2) px^2, of the match alone.
        drift: (2, 2) px^2, by how much less certain the place of the thing on the template is from then on.
        affine: (2, 2) A.
        correlation: of template and image, weighted.
        score: minus twice the logarithm of the likelihood, up to a constant of the template: what two matches of it
            are compared by.
    """

    xy: Floats
    covariance: Floats
    drift: Floats
    affine: Floats
    correlation: float
    score: float


def search(
    of: Template, picture: Picture, xy: Floats, covariance: Floats, affine: Floats, gate: float, most: int
) -> Floats:
    """Places (n, 2) px where the normalised correlation with a template peaks, the highest first.

    Args:
        of: the template.
        picture: where to look.
        xy: (2,) predicted place, px.
        covariance: (2, 2) of the prediction, px^2.
        affine: (2, 2) A as it was last.
        gate: chi-squared of the predicted place up to which to look.
        most: peaks.
    """
    reach = np.ceil(np.sqrt(gate * np.diagonal(covariance))).astype(int) + 2
    corner = np.rint(xy).astype(int)
    half = of.half
    patch, mask = _patch(of, affine, half)
    wanted = _window(picture.grey, corner - reach - half, corner + reach + half)
    answer = cv2.matchTemplate(wanted, patch, cv2.TM_CCOEFF_NORMED, mask=mask)
    answer[~np.isfinite(answer)] = -1.0
    y, x = np.mgrid[-reach[1] : reach[1] + 1, -reach[0] : reach[0] + 1]
    off = np.stack((x, y), axis=-1) + (corner - xy)
    inverse = np.linalg.inv(covariance + np.eye(2))  # a peak on whole pixels is off by up to one
    answer[np.einsum("yxi,ij,yxj->yx", off, inverse, off) > gate] = -1.0
    peaks = []
    least = float(answer.max()) - _RIVAL
    for _ in range(most):
        row, column = np.unravel_index(int(answer.argmax()), answer.shape)
        if answer[row, column] <= max(0.0, least):
            break
        peaks.append(corner - reach + (column, row))
        answer[np.hypot(x - x[row, column], y - y[row, column]) <= _APART] = -1.0
    return np.array(peaks, float).reshape(-1, 2)


def match(of: Template, picture: Picture, start: Floats, affine: Floats) -> Match | None:
    """Match a template near a place.

    Args:
        of: the template.
        picture: where it is to be found.
        start: (2,) approximate place, px.
        affine: (2, 2) A as it was last.

    Returns:
        The match, however well it correlates; None if it leaves its start or the image.
    """
    reach = of.half * 1.5 + _FARTHEST + 2
    if not picture.holds(start, 2.0):
        return None
    corner = np.floor(start - reach).astype(int)
    layers = _layers(picture, corner, np.ceil(start + reach).astype(int))
    expected = np.concatenate((start - corner, affine.ravel(), (1.0, 0.0)))
    scale = float(np.hypot(of.noise, picture.noise))
    whole = _fitted(of, layers, of.weight, expected, expected, scale)
    if whole is None or not picture.holds(whole.theta[:2] + corner, 2.0):
        return None
    covariance = whole.covariance
    if whole.spread > _UNEXPLAINED * scale:
        core = _fitted(of, layers, of.weight * _core(of), whole.theta, expected, scale)
        if core is not None and np.trace(core.covariance) < _DETERMINED_PX**2:
            off = (core.theta - whole.theta)[:2]
            covariance = covariance + np.outer(off, off)
    return Match(
        whole.theta[:2] + corner,
        covariance,
        covariance + whole.drift,
        whole.theta[2:6].reshape(2, 2),
        _correlation(of.grey, whole.theta[6] * of.grey - whole.v, of.weight * whole.inside),
        _score(of, whole.v, whole.inside, scale),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """A template adjusted to an image.

    Attributes:
        theta: (8,) place, A, gain and offset.
        v: (k,) residuals.
        inside: (k,) 1 for the pixels that lie in the window.
        spread: of the residuals, robust.
        covariance: (2, 2) px^2 of the place.
        drift: (2, 2) px^2, see `_drift`.
    """

    theta: Floats
    v: Floats
    inside: Floats
    spread: float
    covariance: Floats
    drift: Floats


def _fitted(
    of: Template, layers: list[GreyImage], weights: Floats, start: Floats, expected: Floats, scale: float
) -> _Fit | None:
    """Adjust place, A, gain and offset; None if the place leaves its start, or too little of the thing is seen.

    Args:
        of: the template.
        layers: of the window.
        weights: (k,) of its pixels.
        start: (8,) unknowns, px of the window.
        expected: (8,) that A, gain and offset are expected near.
        scale: noise of a residual.
    """
    prior = np.array((0, 0, *[_AFFINE_SPREAD**-2] * 4, _GAIN_SPREAD**-2, _OFFSET_SPREAD**-2))
    theta, spread = start, scale
    for _ in range(_STEPS_MOST):
        v, design, inside = _residuals(of, layers, theta)
        spread = max(scale, _MAD_TO_SIGMA * median(np.abs(v)))
        weight = weights * inside / (1 + (v / (_HALF_SIGMAS * spread)) ** 2)
        weighted = design * weight[:, None] / spread**2
        normal = weighted.T @ design + np.diag(prior) + 1e-9 * np.eye(_UNKNOWNS)
        step = np.linalg.solve(normal, weighted.T @ v + prior * (expected - theta))
        size = float(np.hypot(*step[:2]))
        theta = theta + step * min(1.0, _LARGEST_STEP / max(size, 1e-9))
        if size < _SETTLED_PX:
            break
    if not np.isfinite(theta).all() or np.hypot(*(theta - start)[:2]) > _FARTHEST:
        return None
    v, design, inside = _residuals(of, layers, theta)
    weight = weights * inside / (1 + (v / (_HALF_SIGMAS * spread)) ** 2)
    if weight.sum() < _WEIGHT_AGREEING * weights.sum():
        return None
    weighted = design * weight[:, None] / spread**2
    inverse = np.asarray(np.linalg.inv(weighted.T @ design + np.diag(prior) + 1e-9 * np.eye(_UNKNOWNS)), float)
    covariance = _covariance(of, weighted, v, inverse, scale / spread)
    return _Fit(theta, v, inside, spread, covariance, _drift(of, design, weight))


def _core(of: Template) -> Floats:
    """Weights (k,) of the pixels next to the thing."""
    return np.asarray(np.exp(-(of.places**2).sum(axis=1) / (2 * (_CORE * of.half) ** 2)))


def _patch(of: Template, affine: Floats, half: int) -> tuple[GreyImage, GreyImage]:
    """A template as an image of odd size, turned by A about the place of the thing, and which pixels are known."""
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    raster, mask = (
        np.zeros((2 * half + 3, 2 * half + 3), np.float32),
        np.zeros((2 * half + 3, 2 * half + 3), np.float32),
    )
    fraction = of.places[0] - np.rint(of.places[0])
    column, row = np.rint(of.places - fraction).astype(int).T + half + 1
    raster[row, column], mask[row, column] = of.grey, 1.0
    source = np.stack((x, y), axis=-1) @ np.linalg.inv(affine).T - fraction + half + 1
    across, down = np.ascontiguousarray(np.moveaxis(source, -1, 0), np.float32)
    known = cv2.remap(mask, across, down, cv2.INTER_LINEAR)
    patch = cv2.remap(raster, across, down, cv2.INTER_LINEAR)
    return np.asarray(patch / np.maximum(known, 0.5), np.float32), (known > 0.5).astype(np.float32)


def _window(image: GreyImage, low: NDArray[np.intp], high: NDArray[np.intp]) -> GreyImage:
    """The pixels from `low` (2,) to `high` (2,), x and y; the border repeats where the image ends."""
    rows, columns = image.shape
    y = np.clip(np.arange(low[1], high[1] + 1), 0, rows - 1)
    x = np.clip(np.arange(low[0], high[0] + 1), 0, columns - 1)
    return np.ascontiguousarray(image[y[:, None], x])


def _layers(picture: Picture, low: NDArray[np.intp], high: NDArray[np.intp]) -> list[GreyImage]:
    """Grey values with their slopes along x and y, of the image and of the background, if it is known."""
    images = [picture.grey] if picture.behind is None else [picture.grey, picture.behind]
    layers = []
    for image in images:
        part = _window(image, low, high)
        slopes = (cv2.Sobel(part, cv2.CV_32F, *by, ksize=1, scale=0.5) for by in ((1, 0), (0, 1)))
        layers.append(np.dstack((part, *slopes, np.ones_like(part))))
    return layers


def _residuals(of: Template, layers: list[GreyImage], theta: Floats) -> tuple[Floats, Floats, Floats]:
    """Residuals (k,), their derivatives (k, 8), and which pixels lie in the window."""
    places = theta[:2] + of.places @ theta[2:6].reshape(2, 2).T
    columns, rows = np.ascontiguousarray(places.T, np.float32)[:, None]
    grey, right, down, inside = cv2.remap(layers[0], columns, rows, cv2.INTER_CUBIC)[0].astype(float).T
    if len(layers) > 1:
        behind, behind_right, behind_down, _ = cv2.remap(layers[1], columns, rows, cv2.INTER_CUBIC)[0].astype(float).T
        through = 1 - of.share
        grey = grey - through * (behind - of.behind)
        right, down = right - through * behind_right, down - through * behind_down
    x, y = of.places.T
    v = theta[6] * of.grey + theta[7] - grey
    design = np.column_stack((right, down, right * x, right * y, down * x, down * y, -of.grey, -np.ones(len(x))))
    return v, design, (inside > 0.99).astype(float)


def _covariance(of: Template, weighted: Floats, v: Floats, inverse: Floats, least: float) -> Floats:
    """Covariance (2, 2) of the place: from residuals that go together in blocks, at least that of the noise."""
    floor = least**2 * inverse[:2, :2]
    grown = 1.0
    for size in (_BLOCK, of.half):
        block = np.floor((of.places - of.places.min(axis=0)) / size).astype(int)
        sums = np.stack([np.bincount(block[:, 0] * 100 + block[:, 1], column * v) for column in weighted.T])
        sandwich = (inverse @ (sums @ sums.T) @ inverse)[:2, :2]
        grown = max(grown, float(np.trace(sandwich) / np.trace(floor)))
    return np.asarray(floor * grown)


def _drift(of: Template, design: Floats, weight: Floats) -> Floats:
    """Covariance (2, 2) of a step by which the place of the thing moves against what is matched.

    What tells the place may lie beside it, a boot beside a binding, and turns about another point: the lever times the
    spread of A.
    """
    telling = weight * (design[:, 0] ** 2 + design[:, 1] ** 2)
    lever = telling @ of.places / max(float(telling.sum()), 1e-9)
    return np.asarray(_AFFINE_SPREAD**2 * float(lever @ lever) * np.eye(2))


def _correlation(one: Floats, other: Floats, weight: Floats) -> float:
    total = weight.sum()
    a, b = one - weight @ one / total, other - weight @ other / total
    norm = float(np.sqrt((weight @ a**2) * (weight @ b**2)))
    return float(weight @ (a * b)) / norm if norm > 0 else 0.0


def _score(of: Template, v: Floats, inside: Floats, scale: float) -> float:
    """Squared residuals, capped, over the noise: of blocks, since neighbouring pixels go together."""
    capped = np.minimum((v / (2 * scale)) ** 2, 9.0)
    return float((of.weight * np.where(inside > 0, capped, 9.0)).sum() / _BLOCK**2)
