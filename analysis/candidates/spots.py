"""Candidates for markers: bright or dark spots on or beside what moves.

Extrema of the Laplacian over place and scale (`analysis.scene.detection` does the same for balls) are fitted by soft
discs. What is no spot goes: too long, too large, not explained by the model, too uncertain.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from scipy.special import chdtri

from analysis.candidates.background import Region
from analysis.candidates.median import median
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
_OF_PLACE = 3  # fits around one expected place: the marker, and what may be confused with it
_STRENGTH = 6.0  # contrast over its sigma
_STRETCH = 0.75  # log of the ratio of the axes: a streak of 26 m/s and 2 ms is no longer
_MISFIT = 0.25  # residuals over contrast
_TIGHT, _TIGHT_MISFIT = 14, 0.15  # places that are fitted again in smaller windows, and what is asked of them there
_GAP = 26  # px between regions on the sheet
_WORST_SIGMA = 0.5  # px
_SECOND_ANSWER, _SECOND_STRENGTH = 3.0, 4.0  # where a spot is expected, a few places compete, not a whole image
_USUAL_RADII = (1.0, 1.6, 2.6)  # px; to start from
_START_SIGMA = 1.0  # px; of a blob's place before the fit
_GATE = float(chdtri(2, 0.001))
_NEAR = 2  # px from what is in front


def find_spots(regions: Sequence[Region], most: Sequence[int]) -> Spots:
    """Spots of all regions of an image, in px of the image, the clearest first.

    Args:
        regions: parts of an image.
        most: for each, how many places are fitted, those with the strongest answers.
    """
    blobs = [_blobs(region) for region in regions]
    places = [of[0][:count] for of, count in zip(blobs, most, strict=True)]
    radii = [of[1][:count] for of, count in zip(blobs, most, strict=True)]
    return _fitted(regions, places, radii, _STRENGTH)


def find_expected(parts: Sequence[Region], columns: Sequence[int]) -> list[Spots]:
    """Spots around expected places in several images side by side, all at once: the clearest of each image first.

    Args:
        parts: of the images around each place; their columns count from the first column of the first image.
        columns: first column of each image, and behind the last one.

    Returns:
        By image, in px of the image.
    """
    found = find_spots(parts, [_OF_PLACE] * len(parts))
    image = np.searchsorted(columns, found.xy[:, 0] + 0.5, side="right") - 1
    spots = []
    for i in range(len(columns) - 1):
        own = found.only(image == i)
        spots.append(replace(own, xy=own.xy - (columns[i], 0.0)))
    return spots


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
    spots = _fitted([region], [places], [np.concatenate((radii, tried))], _SECOND_STRENGTH)
    squares = _squares(spots.xy - xy, covariance + spots.covariance)
    order = np.argsort(squares)
    return spots.only(order[squares[order] < _GATE])


def _squares(off: Floats, covariance: Floats) -> Floats:
    """Chi-squared (n,) of deviations (n, 2)."""
    inverse = np.broadcast_to(np.linalg.inv(covariance), (len(off), 2, 2))
    return np.asarray(np.einsum("ni,nij,nj->n", off, inverse, off))


def _fitted(regions: Sequence[Region], places: Sequence[Floats], radii: Sequence[Floats], strength: float) -> Spots:
    """The spots near some places (n, 2) of each region; what lies close around one counts less if it spoils the fit."""
    if not sum(len(of) for of in places):
        return Spots.none()
    sheet = _Sheet(regions)
    xy = np.concatenate([of + offset for of, offset in zip(places, sheet.offsets, strict=True)])
    home = np.repeat(sheet.to_image, [len(of) for of in places], axis=0)
    radius = np.concatenate(radii)
    wide = fit_soft_discs(sheet.grey, sheet.noise, xy, radius)
    sound = _sound(wide, strength)
    first = _spots(wide, sound, home)
    first = _apart(first.only(np.argsort(-first.strength)))
    again = _first_of_each(np.flatnonzero(~sound), home)
    if not len(again):
        return first
    tight = fit_soft_discs(sheet.grey, sheet.noise, xy[again], radius[again], tight=True)
    return _apart(Spots.joined([first, _spots(tight, _sound(tight, strength, _TIGHT_MISFIT), home[again])]))


class _Sheet:
    """Regions one below the other, with unusable pixels between them, so that all spots are fitted at once.

    Attributes:
        grey, noise: of the sheet.
        offsets: (regions, 2) places on the sheet minus those in the region.
        to_image: (regions, 2) places in the image minus those on the sheet.
    """

    def __init__(self, regions: Sequence[Region]) -> None:
        rows = np.cumsum([0, *(region.grey.shape[0] + _GAP for region in regions)])
        columns = max(region.grey.shape[1] for region in regions)
        self.grey = np.zeros((int(rows[-1]), columns), np.float32)
        self.noise = np.full_like(self.grey, np.inf)
        for row, region in zip(rows, regions, strict=False):
            part = slice(row, row + region.grey.shape[0]), slice(region.grey.shape[1])
            self.grey[part], self.noise[part] = region.grey, region.noise
        self.offsets = np.column_stack((np.zeros(len(regions)), rows[:-1]))
        self.to_image = np.array([(region.x, region.y) for region in regions]) - self.offsets


def _first_of_each(chosen: Integers, home: Floats) -> Integers:
    """Of the chosen places the first few of each region."""
    kept = [chosen[(home[chosen] == of).all(axis=1)][:_TIGHT] for of in np.unique(home[chosen], axis=0)]
    return np.sort(np.concatenate(kept)) if kept else chosen


def _spots(discs: SoftDiscs, chosen: Flags, home: Floats) -> Spots:
    """The chosen discs as spots of the image; `home` (n, 2) leads from the sheet to it."""
    return Spots(
        discs.xy[chosen] + home[chosen],
        discs.covariance[chosen],
        discs.radius[chosen],
        discs.contrast[chosen],
        np.abs(discs.contrast[chosen]) / np.maximum(discs.sigma_contrast[chosen], 1e-9),
    )


def _apart(spots: Spots) -> Spots:
    """Without those that lie on an earlier one."""
    kept: list[int] = []
    for i in range(len(spots)):
        near = (max(spots.radius[i], spots.radius[k], 1.0) for k in kept)
        if all(np.hypot(*(spots.xy[i] - spots.xy[k])) > least for k, least in zip(kept, near, strict=True)):
            kept.append(i)
    return spots.only(np.array(kept, int))


def _sound(discs: SoftDiscs, strength: float, misfit: float = _MISFIT) -> Flags:
    with np.errstate(invalid="ignore"):
        worst = np.sqrt(np.einsum("nii->ni", discs.covariance).max(axis=1))
        return np.asarray(
            discs.good
            & (np.abs(discs.contrast) >= strength * discs.sigma_contrast)
            & (discs.stretch <= _STRETCH)
            & (discs.rms <= misfit * np.abs(discs.contrast))
            & (worst <= _WORST_SIGMA)
        )


def _blobs(region: Region, answer: float = _ANSWER) -> tuple[Floats, Floats]:
    """Places (n, 2) in the region and radii (n,) of blobs, the strongest answers first."""
    rows, columns = region.grey.shape
    largest = max(rows, columns) / _LARGEST
    scales = [float(scale) for scale in _SCALES if scale <= max(_SCALES[2], largest / np.sqrt(2) * 1.4)]
    grey = region.grey
    noise = median(region.noise)
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
