"""Finds balls in a static image: bright ones on dark and dark ones on bright, each with centre and covariance.

Places where the image is a blob of some size (extrema of the Laplacian over place and scale, not on a line) are fitted
by a blurred disc. What a disc does not explain (edges, stripes, texture, letters) goes. What remains may still be
something else that is round: names sort that out (`analysis.scene.naming`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.special import chdtri

from analysis.scene.disc import MARGIN, Disc, fit_discs
from analysis.scene.shaded_disc import fit_shaded_discs
from analysis.scene.static_image import GreyImage, StaticImage
from rig.arrays import Floats, Integers

MOST = 80  #: detections of an image
_SCALES = 1.0 * 1.4 ** np.arange(8)  # px; a disc of radius R answers most at R / sqrt(2)
_MOST_FITS = 250
_DISC_ANSWER = 0.736  # of the contrast: Laplacian of a disc at its own scale
_LEAST_CONTRAST = 6.0  # grey values
_NOISE_FACTOR = 6.0  # contrast over the noise of the static image
_ROUND = 3.0  # ratio of the curvatures of a blob, at most
_RADII = (0.8, 16.0)  # px
_STEPS_MOST = 14  # of the fit: balls need 4 to 12
_STRETCH = 0.5  # log of the ratio of the axes
_MISFIT = 0.2  # residuals over contrast
_MISFIT_AT_START = 0.3  # the same for a disc where the blob is, before it is fitted
_WORST_SIGMA = 0.35  # px
_SPOILT = 1.5  # times the noise: with larger residuals something lies close around a ball
_TIGHT_MARGIN_PX = 1.8  # px around a ball that are fitted then
_CONTRADICTION = float(chdtri(2, 0.001))


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """The balls, and other round things, in one image; best first.

    Attributes:
        xy: (n, 2) centres, pixel frame.
        covariance: (n, 2, 2), px^2.
        radius: (n,) px.
        contrast: (n,) grey values, negative: dark.
        quality: (n,) contrast over residuals of the fit.
    """

    xy: Floats
    covariance: Floats
    radius: Floats
    contrast: Floats
    quality: Floats

    def __len__(self) -> int:
        return len(self.xy)

    def only(self, chosen: Integers) -> "Detections":
        """Some of them."""
        return Detections(
            self.xy[chosen], self.covariance[chosen], self.radius[chosen], self.contrast[chosen], self.quality[chosen]
        )


def detect_balls(image: StaticImage, most: int = MOST) -> Detections:
    """Find balls.

    Args:
        image: static image of a camera.
        most: detections, the best ones, at most.
    """
    sigma = np.asarray(image.sigma, float)
    grey = np.asarray(image.grey, float)
    blobs = np.array(_blobs(image.grey, float(np.median(sigma)))).reshape(-1, 3)
    return collected(_apart(_fitted(grey, sigma, blobs[:, :2], blobs[:, 2]))[:most])


def collected(discs: Sequence[Disc]) -> Detections:
    """Discs as detections."""
    return Detections(
        np.array([disc.xy for disc in discs], float).reshape(-1, 2),
        np.array([disc.covariance for disc in discs], float).reshape(-1, 2, 2),
        np.array([disc.radius for disc in discs], float),
        np.array([disc.contrast for disc in discs], float),
        np.array([_quality(disc) for disc in discs], float),
    )


def _fitted(grey: Floats, sigma: Floats, xy: Floats, radius: Floats) -> list[Disc]:
    """The balls at places (n, 2), where there are some. What lies close around one is left out if it spoils the fit."""

    def fitted(chosen: Integers, margin: float) -> list[Disc | None]:
        return fit_discs(grey, sigma, xy[chosen], radius[chosen], margin, _MISFIT_AT_START, _STEPS_MOST)

    found = [[disc] for disc in fitted(np.arange(len(xy)), MARGIN)]
    spoilt = [i for i, (disc,) in enumerate(found) if disc is None or disc.factor >= _SPOILT]
    for i, disc in zip(spoilt, fitted(np.array(spoilt, int), _TIGHT_MARGIN_PX), strict=True):
        found[i].append(disc)
    balls = [[disc for disc in of_place if disc is not None and _is_ball(disc)] for of_place in found]
    shaded = fit_shaded_discs(grey, sigma, xy, radius)
    return [
        best
        for plain, other in zip(balls, shaded, strict=True)
        if (best := _best(plain, other if other is not None and _is_ball(other) else None)) is not None
    ]


def _best(plain: Sequence[Disc], shaded: Disc | None) -> Disc | None:
    """The best plain disc, or else the shaded one; where they contradict each other, by so much it is not known."""
    if not plain:
        return shaded
    best = min(plain, key=lambda disc: disc.factor)
    if shaded is None:
        return best
    off = shaded.xy - best.xy
    if off @ np.linalg.solve(best.covariance + shaded.covariance, off) < _CONTRADICTION:
        return best
    return replace(best, covariance=best.covariance + np.outer(off, off))


def _quality(disc: Disc) -> float:
    return abs(disc.contrast) / max(disc.rms, 1.0)


def _is_ball(disc: Disc) -> bool:
    return (
        _RADII[0] <= disc.radius <= _RADII[1]
        and disc.stretch <= _STRETCH
        and abs(disc.contrast) >= _LEAST_CONTRAST
        and disc.rms <= _MISFIT * abs(disc.contrast)
        and float(disc.sigma.max()) <= _WORST_SIGMA
    )


def _apart(discs: Sequence[Disc]) -> list[Disc]:
    """Best first, without those that lie on a better one (a ball and the plate behind it share a centre)."""
    kept: list[Disc] = []
    for disc in sorted(discs, key=_quality, reverse=True):
        if all(np.hypot(*(disc.xy - other.xy)) > max(disc.radius, other.radius) for other in kept):
            kept.append(disc)
    return kept


def _blobs(grey: GreyImage, sigma: float) -> list[tuple[float, float, float]]:
    """Places and radii of blobs, the most contrast first."""
    limit = _DISC_ANSWER * max(_LEAST_CONTRAST, _NOISE_FACTOR * sigma)
    smooth = [np.asarray(cv2.GaussianBlur(grey, (0, 0), float(scale)), np.float32) for scale in _SCALES]
    strength = [
        np.abs(cv2.Laplacian(image, cv2.CV_32F, scale=float(scale**2)))
        for scale, image in zip(_SCALES, smooth, strict=True)
    ]
    square = np.ones((3, 3), np.uint8)
    largest = [cv2.dilate(layer, square) for layer in strength]
    found = []
    for k, layer in enumerate(strength):
        row, column = np.nonzero((layer >= largest[k]) & (layer > limit))
        value = layer[row, column]
        for other in largest[max(0, k - 1) : k + 2]:
            stays = value >= other[row, column]
            row, column, value = row[stays], column[stays], value[stays]
        for y, x, answer in zip(row.tolist(), column.tolist(), value.tolist(), strict=True):
            if _is_round(smooth[k], y, x):
                found.append((answer, float(x), float(y), float(_SCALES[k] * np.sqrt(2))))
    found.sort(reverse=True)
    return [blob[1:] for blob in found[:_MOST_FITS]]


def _is_round(image: GreyImage, y: int, x: int) -> bool:
    """Whether both curvatures have one sign and similar size."""
    if not (0 < y < image.shape[0] - 1 and 0 < x < image.shape[1] - 1):
        return False
    w = image[y - 1 : y + 2, x - 1 : x + 2].astype(float)
    xx, yy = w[1, 0] - 2 * w[1, 1] + w[1, 2], w[0, 1] - 2 * w[1, 1] + w[2, 1]
    xy = (w[0, 0] + w[2, 2] - w[0, 2] - w[2, 0]) / 4
    determinant = xx * yy - xy * xy
    return bool(determinant > 0 and (xx + yy) ** 2 < (_ROUND + 1) ** 2 / _ROUND * determinant)
