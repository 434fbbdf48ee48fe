"""What stands before the static scene: each image is compared with the static image in the light of its moment.

Clouds and floodlights change gain and offset of a whole image, wind and a slow drift shift it by parts of a pixel. All
four are estimated robustly from a grid of pixels (image = gain * static + offset + shift * gradient), so that neither
light nor shake looks like a movement. The residuals of the grid tell the noise of this very image, as a function of the
grey value (read noise and photons): the noise of the static image may contain changes of the light. What differs by
more than the noise is in front. Pixels that are restless in the static scene (trees in the wind, a walking official)
are less sensitive.
"""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.scene.static_image import GreyImage, StaticImage
from rig.arrays import Floats

_SAMPLES = 8_000  # pixels of the grid
_ROUNDS, _CLIP = 4, 3.0  # of the robust adjustment; sigmas
_SHIFT_SIGMA = 0.07  # px by which a frame may still be off: lenses, rolling air, a turn about the axis
_BINS, _THIN = 12, 17  # of the grey values; of the pixels every so many
_ROUNDING = np.float32(1 / 12)  # variance of whole numbers
_RESTLESS = 2.0  # times the usual noise of its grey value: a pixel that is not static
_FEWEST = 50  # calm pixels of a bin
_MAD_TO_SIGMA = 1.4826
_FRONT = 4.5  # sigmas: 2 of 300 000 pixels by chance
_SMALLEST = 12  # px; 15 radii of the smallest marker that can be measured: a jumper is larger
_THINNEST = 3  # px; nothing real is thinner at its thickest, but a row of pixels that hold a number is
_JOIN = 9  # px: what is nearer to each other belongs together
_MARGIN = 10  # px around what moves
_MOST = 6  # regions of an image, the largest ones


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A part of an image in which something is in front of the static scene.

    Attributes:
        x, y: column and row of its first pixel in the image.
        grey: (rows, columns) grey values.
        behind: (rows, columns) what the static scene shows there in the light of the moment.
        sigma: (rows, columns) noise of the difference.
        noise: (rows, columns) noise of the grey values themselves, whatever the scene behind does.
        front: (rows, columns) which pixels are in front, or may be: those of a restless background.
    """

    x: int
    y: int
    grey: GreyImage
    behind: GreyImage
    sigma: GreyImage
    noise: GreyImage
    front: NDArray[np.bool_]

    @property
    def nbytes(self) -> int:
        """Bytes of memory."""
        return self.grey.nbytes + self.behind.nbytes + self.sigma.nbytes + self.noise.nbytes + self.front.nbytes

    def holds(self, xy: Floats) -> bool:
        """Whether a place of the image, px (2,), lies in it."""
        rows, columns = self.grey.shape
        return bool(self.x <= xy[0] <= self.x + columns - 1 and self.y <= xy[1] <= self.y + rows - 1)


class Background:
    """The static scene of one camera, to compare its images with.

    Args:
        static: of this camera.
    """

    def __init__(self, static: StaticImage) -> None:
        grey = np.ascontiguousarray(static.grey, np.float32)
        self._grey = grey
        self._right = cv2.Sobel(grey, cv2.CV_32F, 1, 0, scale=1 / 8)
        self._down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, scale=1 / 8)
        self._shift = np.float32(_SHIFT_SIGMA**2) * (self._right**2 + self._down**2)
        noise = np.maximum(np.asarray(static.noise, np.float32), np.sqrt(_ROUNDING))
        ratio = noise / _usual(grey, noise)
        self._ratio = np.where(ratio > _RESTLESS, ratio**2, np.float32(1))
        step = max(1, int(np.sqrt(grey.size / _SAMPLES)))
        self._grid = slice(step // 2, None, step), slice(step // 2, None, step)
        sampled = [layer[self._grid].ravel().astype(float) for layer in (grey, self._right, self._down)]
        self._design = np.column_stack((sampled[0], np.ones(len(sampled[0])), *sampled[1:]))
        self._weight = 1 / np.sqrt(noise**2 + self._shift)[self._grid].ravel().astype(float)
        self._calm = (self._ratio == 1)[self._grid].ravel()
        self._bins = np.array_split(np.argsort(sampled[0]), _BINS)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._grey.shape[0], self._grey.shape[1]

    def regions(self, image: NDArray[np.uint8], stamped: tuple[int, int, int] | None = None) -> list[Region]:
        """Where something is in front, the largest region first.

        Args:
            image: (rows, columns) of this camera.
            stamped: row, first column and count of pixels that are no picture.
        """
        moment = self._moment(image)
        grey = image.astype(np.float32)
        difference = cv2.subtract(grey, moment.behind)
        square = np.float32(_FRONT**2) * moment.variance
        front = np.asarray(cv2.compare(cv2.multiply(difference, difference), square, cv2.CMP_GT), np.uint8)
        if stamped is not None:
            front[stamped[0], stamped[1] : stamped[1] + stamped[2]] = 0
        return [self._region(grey, moment, front, box) for box in _boxes(front)]

    def _region(
        self, grey: GreyImage, moment: "_Moment", front: NDArray[np.uint8], box: tuple[int, int, int, int]
    ) -> Region:
        left, top, right, bottom = box
        part = slice(top, bottom), slice(left, right)
        own = grey[part].copy()
        noise = np.sqrt(np.maximum(moment.read + moment.photon * cv2.blur(own, (3, 3)), _ROUNDING))
        restless = self._ratio[part] > 1
        sigma = np.sqrt(moment.variance[part])
        return Region(left, top, own, moment.behind[part].copy(), sigma, noise, (front[part] > 0) | restless)

    def _moment(self, image: NDArray[np.uint8]) -> "_Moment":
        unknown, residuals = self._light(image)
        gain, offset, right, down = unknown.tolist()
        shifted = cv2.addWeighted(self._right, right, self._down, down, offset)
        behind = np.asarray(cv2.scaleAdd(self._grey, gain, shifted), np.float32)
        read, photon = self._noise(self._design @ unknown, residuals)
        variance = np.maximum(behind * photon + read, _ROUNDING) * self._ratio + self._shift
        return _Moment(behind, variance.astype(np.float32), read, photon)

    def _light(self, image: NDArray[np.uint8]) -> tuple[Floats, Floats]:
        """Gain, offset and shift of an image; residuals of the grid, grey values."""
        sample = image[self._grid].ravel().astype(float)
        rows: Floats = self._design * self._weight[:, None]
        values = sample * self._weight
        keep = np.ones(len(values), bool)
        unknown = np.array([1.0, 0.0, 0.0, 0.0])
        for _ in range(_ROUNDS):
            normal = rows[keep].T @ rows[keep]
            normal += np.diag(1e-9 * np.diag(normal) + 1e-12)
            unknown = np.asarray(np.linalg.solve(normal, rows[keep].T @ values[keep]), float)
            v = np.abs(values - rows @ unknown)
            keep = v < _CLIP * max(1e-3, _MAD_TO_SIGMA * float(np.median(v)))
        return unknown, sample - self._design @ unknown

    def _noise(self, grey: Floats, residuals: Floats) -> tuple[np.float32, np.float32]:
        """Variance of a grey value in this image: of reading, and per grey value (photons)."""
        at, level = [], []
        for part in self._bins:
            calm = part[self._calm[part]]
            if len(calm) >= _FEWEST:
                at.append(float(grey[calm].mean()))
                level.append((_MAD_TO_SIGMA * float(np.median(np.abs(residuals[calm])))) ** 2)
        if not at:
            return np.float32(np.median(self._weight) ** -2), np.float32(0)
        slope = max(0.0, float(np.polyfit(at, level, 1)[0])) if np.ptp(at) > 1 else 0.0
        read = max(float(_ROUNDING), float(np.median(np.array(level) - slope * np.array(at))))
        return np.float32(read), np.float32(slope)


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    """The static scene in the light of an image, the variance of differences from it, and the noise model."""

    behind: GreyImage
    variance: GreyImage
    read: np.float32
    photon: np.float32


def _usual(grey: GreyImage, noise: GreyImage) -> GreyImage:
    """The median noise of pixels of such a grey value."""
    values, spread = grey.ravel()[::_THIN], noise.ravel()[::_THIN]
    parts = [part for part in np.array_split(np.argsort(values), _BINS) if len(part)]
    at = [float(values[part].mean()) for part in parts]
    return np.interp(grey, at, [float(np.median(spread[part])) for part in parts]).astype(np.float32)


def _boxes(front: NDArray[np.uint8]) -> list[tuple[int, int, int, int]]:
    """Boxes around what moves: columns and rows of the first and behind the last pixel, the largest first."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(front, connectivity=8)
    large = np.maximum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) >= _SMALLEST
    large &= np.minimum(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) >= _THINNEST
    large[0] = False
    if count < 2 or not large.any():
        return []
    boxes = [(x - _JOIN, y - _JOIN, x + w + _JOIN, y + h + _JOIN, area) for x, y, w, h, area in stats[large].tolist()]
    rows, columns = labels.shape
    grown = sorted(_joined(boxes), key=lambda box: -box[4])[:_MOST]
    spare = _MARGIN - _JOIN
    return [
        (max(0, x - spare), max(0, y - spare), min(columns, right + spare), min(rows, bottom + spare))
        for x, y, right, bottom, _ in grown
    ]


def _joined(boxes: list[tuple[int, int, int, int, int]]) -> list[tuple[int, int, int, int, int]]:
    """Boxes that overlap as one; the last number is the area in front."""
    done: list[tuple[int, int, int, int, int]] = []
    waiting = list(boxes)
    while waiting:
        box = waiting.pop()
        touching = [o for o in (*waiting, *done) if o[0] < box[2] and box[0] < o[2] and o[1] < box[3] and box[1] < o[3]]
        if not touching:
            done.append(box)
            continue
        waiting = [o for o in waiting if o not in touching]
        done = [o for o in done if o not in touching]
        group = [box, *touching]
        low, high = np.min(group, axis=0), np.max(group, axis=0)
        waiting.append((int(low[0]), int(low[1]), int(high[2]), int(high[3]), sum(o[4] for o in group)))
    return done
