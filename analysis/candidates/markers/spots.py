"""Candidates for markers: bright or dark spots on or beside what moves.

Extrema of the Laplacian over place and scale (`analysis.scene.detection` does the same for balls) are fitted by soft
discs. What is no spot goes: too long, too large, not explained by the model, too uncertain.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import chdtri

from analysis.candidates.foreground.background import Region
from analysis.candidates.markers.soft_discs import FARTHEST, SoftDiscs, fit_soft_discs
from analysis.candidates.median import median
from analysis.candidates.model import Expected, Spots
from analysis.scene.static_image import GreyImage
from rig.arrays import Flags, Floats, Integers

_SCALES = 1.0 * 1.4 ** np.arange(8)  # px; a disc of radius R answers most at R / sqrt(2)
_LARGEST = 16  # radii of a marker that a jumper with skis measures at least, from any side
_ANSWER = 5.0  # times its noise: of the Laplacian
_NOISE_OF_ANSWER = 0.35  # standard deviation of the normalised Laplacian at scale 1 for noise 1; falls as 1 / scale
_ROUND = 4.0  # ratio of the curvatures of a blob, at most
MOST = 40  #: fits of a region
_OF_PLACE = 3  # fits around one expected place: the marker, and things that look like it
_STRENGTH = 6.0  # contrast over its sigma
_STRETCH = 0.75  # log of the ratio of the axes: a streak of 26 m/s and 2 ms is no longer
_MISFIT = 0.25  # residuals over contrast
_TIGHT, _TIGHT_MISFIT = 14, 0.15  # places that are fitted again in smaller windows, and the largest misfit there
_THINNEST = 4  # px; a smaller part of a region holds no spot
_GAP = 26  # px between regions on the sheet
_WORST_SIGMA = 0.5  # px
_SECOND_ANSWER, _SECOND_STRENGTH = 3.0, 4.0  # where a spot is expected, a few places compete, not a whole image
_USUAL_RADII = (1.0, 1.6, 2.6)  # px; to start from
_LOOKS = 100  # places that are looked at again together: the time grows slowly with them, their memory as the square
_START_SIGMA = 1.0  # px; of a blob's place before the fit
_GATE = float(chdtri(2, 0.001))
_NEAR = 2  # px from what is in front


def find_spots(images: Sequence[Sequence[Region]], most: Sequence[Sequence[int]]) -> list[Spots]:
    """Spots of several images, fitted all at once.

    Args:
        images: parts of each image.
        most: for each of them, how many places are fitted, those with the strongest answers.

    Returns:
        By image, in px of the image, the clearest first.
    """
    places = [
        [_Places(region, *_blobs(region)).only(slice(count)) for region, count in zip(regions, counts, strict=True)]
        for regions, counts in zip(images, most, strict=True)
    ]
    return _fitted(places, _STRENGTH)


def find_expected(images: Sequence[Sequence[Region]], expected: Sequence[Expected | None]) -> list[Spots]:
    """Spots around expected places in several images, fitted all at once.

    Args:
        images: parts of each image.
        expected: in each image; None: nothing.

    Returns:
        By image, in px of the image, the clearest first.
    """
    places = [
        [] if place is None else [found for region in regions if (found := _near(region, place)) is not None]
        for regions, place in zip(images, expected, strict=True)
    ]
    return _fitted(places, _STRENGTH)


def look_for_spots(regions: Sequence[Region], xy: Floats, covariance: Floats) -> list[Spots]:
    """Spots near predicted places, on weaker evidence; of each place the nearest by chi-squared first.

    Args:
        regions: n parts of images, each holds its place; the same one again for another place in it.
        xy: (n, 2) predicted places, px of the image.
        covariance: (n, 2, 2) of the predictions, px^2.
    """
    found: list[Spots] = []
    for first in range(0, len(regions), _LOOKS):
        part = slice(first, first + _LOOKS)
        found += _looked_for(regions[part], xy[part], covariance[part])
    return found


def _looked_for(regions: Sequence[Region], xy: Floats, covariance: Floats) -> list[Spots]:
    """As `look_for_spots`, all fitted at once."""
    answers = {key: _blobs(region, _SECOND_ANSWER) for key, region in {id(of): of for of in regions}.items()}
    starts: list[list[_Places]] = []
    for region, place, gate in zip(regions, xy, covariance + _START_SIGMA**2 * np.eye(2), strict=True):
        places, radii = answers[id(region)]
        places = places + np.array((region.x, region.y))
        near = _squares(places - place, gate) < _GATE
        places = np.concatenate((places[near][:MOST], np.repeat(place[None], len(_USUAL_RADII), axis=0)))
        low, high = places.min(axis=0), places.max(axis=0)
        part = region.around((low + high) / 2, float((high - low).max()) / 2 + FARTHEST + 1)
        of_part = places - np.array((part.x, part.y)), np.concatenate((radii[near][:MOST], _USUAL_RADII))
        starts.append([_Places(part, *of_part)])
    found = []
    for spots, place, spread in zip(_fitted(starts, _SECOND_STRENGTH), xy, covariance, strict=True):
        squares = _squares(spots.xy - place, spread + spots.covariance)
        order = np.argsort(squares)
        found.append(spots.only(order[squares[order] < _GATE]))
    return found


def _squares(off: Floats, covariance: Floats) -> Floats:
    """Chi-squared (n,) of deviations (n, 2)."""
    inverse = np.broadcast_to(np.linalg.inv(covariance), (len(off), 2, 2))
    return np.asarray(np.einsum("ni,nij,nj->n", off, inverse, off))


@dataclass(frozen=True, slots=True, eq=False)
class _Places:
    """Where spots of a region are fitted: places (n, 2) and radii (n,), px of the region, the likeliest first."""

    region: Region
    xy: Floats
    radius: Floats

    def only(self, chosen: slice | Integers) -> "_Places":
        """Some of them."""
        return _Places(self.region, self.xy[chosen], self.radius[chosen])


def _near(region: Region, expected: Expected) -> _Places | None:
    """The few likeliest places around each expected marker; None where the region holds nothing of them."""
    low, high = expected.markers - expected.reach[:, None], expected.markers + expected.reach[:, None]
    own = np.array((region.x, region.y)), np.array((region.x, region.y)) + region.grey.shape[::-1] - 1
    sides = np.minimum(high, own[1]) - np.maximum(low, own[0])
    there = sides.min(axis=1) >= _THINNEST
    if not there.any():
        return None
    first = low[there].min(axis=0)
    middle = (first + high[there].max(axis=0)) / 2
    part = region.around(middle, middle - first)
    xy, radius = _blobs(part, largest=float(sides[there].max()))
    found = xy + np.array((part.x, part.y))
    each = [
        np.flatnonzero(np.abs(found - marker).max(axis=1) <= reach)[:_OF_PLACE]
        for marker, reach in zip(expected.markers[there], expected.reach[there], strict=True)
    ]
    return _Places(part, xy, radius).only(np.unique(np.concatenate(each)))


def _fitted(images: Sequence[Sequence[_Places]], strength: float) -> list[Spots]:
    """The spots of each image near some places; where a fit fails, the place is fitted again in a smaller window."""
    places = [of_region for of_image in images for of_region in of_image]
    counts = [len(of_region.xy) for of_region in places]
    if not sum(counts):
        return [Spots.none() for _ in images]
    sheet = _Sheet([of_region.region for of_region in places])
    region = np.repeat(np.arange(len(places)), counts)
    image = np.repeat(np.arange(len(images)), [len(of_image) for of_image in images])[region]
    xy = np.concatenate([of_region.xy for of_region in places]) + sheet.offsets[region]
    radius, home = np.concatenate([of_region.radius for of_region in places]), sheet.to_image[region]
    wide = fit_soft_discs(sheet.grey, sheet.noise, xy, radius)
    sound = _sound(wide, strength)
    first = _spots(wide, sound, home)
    order = np.argsort(-first.strength)
    spots, image_of = first.only(order), image[sound][order]
    apart = _apart(spots, image_of)
    spots, image_of = spots.only(apart), image_of[apart]
    if len(again := _first_of_each(np.flatnonzero(~sound), region)):
        tight = fit_soft_discs(sheet.grey, sheet.noise, xy[again], radius[again], tight=True)
        sound = _sound(tight, strength, _TIGHT_MISFIT)
        spots = Spots.joined([spots, _spots(tight, sound, home[again])])
        image_of = np.concatenate((image_of, image[again][sound]))
        apart = _apart(spots, image_of)
        spots, image_of = spots.only(apart), image_of[apart]
    return [spots.only(image_of == i) for i in range(len(images))]


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


def _first_of_each(chosen: Integers, region: Integers) -> Integers:
    """Of the chosen places the first few of each region."""
    of = region[chosen]
    return chosen[np.arange(len(chosen)) - np.searchsorted(of, of) < _TIGHT]


def _spots(discs: SoftDiscs, chosen: Flags, home: Floats) -> Spots:
    """The chosen discs as spots of the image; `home` (n, 2) leads from the sheet to it."""
    return Spots(
        discs.xy[chosen] + home[chosen],
        discs.covariance[chosen],
        discs.radius[chosen],
        discs.contrast[chosen],
        np.abs(discs.contrast[chosen]) / np.maximum(discs.sigma_contrast[chosen], 1e-9),
    )


def _apart(spots: Spots, image: Integers) -> Flags:
    """Which spots do not lie on an earlier one of the same image (n,)."""
    least = np.maximum(np.maximum(spots.radius[:, None], spots.radius), 1.0)
    x, y = spots.xy.T
    on = (np.hypot(x[:, None] - x, y[:, None] - y) <= least) & (image[:, None] == image)
    kept = np.ones(len(spots), bool)
    for i in range(len(spots)):
        if kept[i]:
            kept[i + 1 :] &= ~on[i, i + 1 :]
    return kept


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


def _blobs(region: Region, answer: float = _ANSWER, largest: float | None = None) -> tuple[Floats, Floats]:
    """Places (n, 2) in the region and radii (n,) of blobs, the strongest answers first.

    Args:
        region: part of an image.
        answer: times its noise, at least.
        largest: px that a thing with such a blob measures; as large as the region if left out.
    """
    rows, columns = region.grey.shape
    largest = (max(rows, columns) if largest is None else largest) / _LARGEST
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
