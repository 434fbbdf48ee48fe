"""Candidates for markers: bright or dark spots on or beside what moves.

Extrema of the Laplacian over place and scale (`analysis.scene.detection` does the same for balls) are fitted by soft
discs. What is no spot goes: too long, too large, not explained by the model, too uncertain.
"""

import cv2
import numpy as np
from scipy.stats import chi2

from analysis.candidates.background import Region
from analysis.candidates.model import Spots
from analysis.candidates.soft_discs import SoftDiscs, fit_soft_discs
from analysis.scene.static_image import GreyImage
from rig.arrays import Flags, Floats, Integers

_SCALES = 1.0 * 1.4 ** np.arange(8)  # px; a disc of radius R answers most at R / sqrt(2)
_LARGEST = 16  # radii of a marker that a jumper with skis measures at least, from any side
_ANSWER = 5.0  # times its noise: of the Laplacian
_NOISE_OF_ANSWER = 0.35  # standard deviation of the normalised Laplacian at scale 1 for noise 1; falls as 1 / scale
_ROUND = 4.0  # ratio of the curvatures of a blob, at most
MOST = 40  #: fits of a region
_STRENGTH = 6.0  # contrast over its sigma
_STRETCH = 0.75  # log of the ratio of the axes: a streak of 26 m/s and 2 ms is no longer
_MISFIT = 0.25  # residuals over contrast
_WORST_SIGMA = 0.5  # px
_SECOND_ANSWER, _SECOND_STRENGTH = 3.0, 4.0  # where a spot is expected, a few places compete, not a whole image
_USUAL_RADII = (1.0, 1.6, 2.6)  # px; to start from
_START_SIGMA = 1.0  # px; of a blob's place before the fit
_GATE = float(chi2.ppf(0.999, 2))
_NEAR = 2  # px from what is in front


def find_spots(region: Region, most: int = MOST) -> Spots:
    """Spots of a region, in px of the image, the strongest first.

    Args:
        region: part of an image.
        most: places that are fitted, those with the strongest answers.
    """
    places, radius = _blobs(region)
    places, radius = places[:most], radius[:most]
    if not len(places):
        return Spots.none()
    discs = fit_soft_discs(region.grey, region.sigma, places, radius)
    return collected(discs, _sound(discs, _STRENGTH), region)


def look_for_spots(region: Region, xy: Floats, covariance: Floats, radius: float | None = None) -> Spots:
    """Spots near a predicted place, on weaker evidence; the nearest by chi-squared first.

    Args:
        region: part of the image that holds the place.
        xy: (2,) predicted place, px of the image.
        covariance: (2, 2) of the prediction, px^2.
        radius: expected, px, where it is known.
    """
    place = xy - (region.x, region.y)
    places, radii = _blobs(region, _SECOND_ANSWER)
    gate = covariance + _START_SIGMA**2 * np.eye(2)
    near = _squares(places - place, gate) < _GATE
    tried = [radius] if radius is not None else list(_USUAL_RADII)
    places, radii = places[near][:MOST], radii[near][:MOST]
    places = np.concatenate((places, np.repeat(place[None], len(tried), axis=0)))
    discs = fit_soft_discs(region.grey, region.sigma, places, np.concatenate((radii, tried)))
    spots = collected(discs, _sound(discs, _SECOND_STRENGTH), region)
    squares = _squares(spots.xy - xy, covariance + spots.covariance)
    order = np.argsort(squares)
    return spots.only(order[squares[order] < _GATE])


def _squares(off: Floats, covariance: Floats) -> Floats:
    """Chi-squared (n,) of deviations (n, 2)."""
    inverse = np.broadcast_to(np.linalg.inv(covariance), (len(off), 2, 2))
    return np.asarray(np.einsum("ni,nij,nj->n", off, inverse, off))


def collected(discs: SoftDiscs, chosen: Flags, region: Region) -> Spots:
    """The chosen discs of a region as spots of the image, the strongest first, none on top of another one."""
    strength = np.abs(discs.contrast) / np.maximum(discs.sigma_contrast, 1e-9)
    kept: list[int] = []
    for i in sorted(np.flatnonzero(chosen).tolist(), key=lambda i: -strength[i]):
        if all(np.hypot(*(discs.xy[i] - discs.xy[k])) > max(discs.radius[i], discs.radius[k], 1.0) for k in kept):
            kept.append(i)
    order = np.array(kept, int)
    return Spots(
        discs.xy[order] + (region.x, region.y),
        discs.covariance[order],
        discs.radius[order],
        discs.contrast[order],
        strength[order],
    )


def _sound(discs: SoftDiscs, strength: float) -> Flags:
    with np.errstate(invalid="ignore"):
        worst = np.sqrt(np.einsum("nii->ni", discs.covariance).max(axis=1))
        return np.asarray(
            discs.good
            & (np.abs(discs.contrast) >= strength * discs.sigma_contrast)
            & (discs.stretch <= _STRETCH)
            & (discs.rms <= _MISFIT * np.abs(discs.contrast))
            & (worst <= _WORST_SIGMA)
        )


def _blobs(region: Region, answer: float = _ANSWER) -> tuple[Floats, Floats]:
    """Places (n, 2) in the region and radii (n,) of blobs, the strongest answers first."""
    rows, columns = region.grey.shape
    largest = max(rows, columns) / _LARGEST
    scales = [float(scale) for scale in _SCALES if scale <= max(_SCALES[2], largest / np.sqrt(2) * 1.4)]
    grey = region.grey
    noise = float(np.median(region.sigma))
    smooth = [np.asarray(cv2.GaussianBlur(grey, (0, 0), scale), np.float32) for scale in scales]
    answers = np.stack([scale**2 * cv2.Laplacian(s, cv2.CV_32F) for scale, s in zip(scales, smooth, strict=True)])
    strength = np.abs(answers)
    largest_near = np.stack([cv2.dilate(layer, np.ones((3, 3), np.uint8)) for layer in strength])
    around = largest_near.copy()
    around[1:] = np.maximum(around[1:], largest_near[:-1])
    around[:-1] = np.maximum(around[:-1], largest_near[1:])
    limits = np.array([answer * _NOISE_OF_ANSWER * noise / scale for scale in scales], np.float32)
    near = cv2.dilate(region.front.astype(np.uint8), np.ones((2 * _NEAR + 1, 2 * _NEAR + 1), np.uint8)) > 0
    layer, row, column = np.nonzero((strength >= around) & (strength > limits[:, None, None]) & near)
    inside = (row > 1) & (row < rows - 2) & (column > 1) & (column < columns - 2)
    layer, row, column = layer[inside], row[inside], column[inside]
    keep = _is_round(np.stack(smooth), layer, row, column)
    layer, row, column = layer[keep], row[keep], column[keep]
    order = np.argsort(-strength[layer, row, column])
    places = np.column_stack((column[order], row[order])).astype(float)
    return places, np.sqrt(2) * np.array(scales)[layer[order]]


def _is_round(smooth: GreyImage, layer: Integers, row: Integers, column: Integers) -> Flags:
    """Whether the surface is curved alike in all directions there."""

    def at(dy: int, dx: int) -> Floats:
        return np.asarray(smooth[layer, row + dy, column + dx], float)

    xx, yy = at(0, 1) - 2 * at(0, 0) + at(0, -1), at(1, 0) - 2 * at(0, 0) + at(-1, 0)
    xy = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / 4
    trace, determinant = xx + yy, xx * yy - xy * xy
    return np.asarray((determinant > 0) & (trace * trace < (_ROUND + 1) ** 2 / _ROUND * determinant))
