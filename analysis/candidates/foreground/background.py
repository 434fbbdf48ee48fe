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
from scipy.special import gammainc

from analysis.candidates.median import median
from analysis.scene.static_image import GreyImage, StaticImage
from rig.arrays import Floats, Integers
from rig.images.picture import Grey

_SAMPLES = 8_000  # pixels of the grid
_ROUNDS, _CLIP = 3, 3.0  # of the robust adjustment, before one of all pixels; sigmas
_FEW = 4  # of the pixels of the grid every so many are enough for those rounds
_SHIFT_SIGMA = 0.07  # px by which a frame may still be off: lenses, rolling air, a turn about the axis
_BINS, _THIN = 12, 17  # of the grey values; of the pixels every so many
_ROUNDING = np.float32(1 / 12)  # variance of whole numbers
_RESTLESS = 2.0  # times the usual noise of its grey value: a pixel that is not static
_FEWEST = 50  # calm pixels of a bin
_MAD_TO_SIGMA = 1.4826
_STRIP = 32 << 10  # pixels that are compared at a time
_FRONT = 4.5  # sigmas: 2 of 300 000 pixels by chance
_SMALLEST = 12  # px; 15 radii of the smallest marker that can be measured: a jumper is larger
_SPECK = 8  # pixels of the border of the smallest marker that can be measured
_REACH = 0.7  # lengths of the largest visible part of a body: its other parts are nearer than this
_DARKEST = 0.1  # least gain: below it, an image does not show the static scene
_COINCIDENCE = 0.1  # probability of so many chance specks around a body; below it, the specks belong to the body
_THINNEST = 3  # px, least thickness of a thing; a row of pixels with the camera's signature is thinner
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

    def around(self, xy: Floats, reach: float) -> "Region":
        """The part of it within `reach` px of a place (2,) of the image, in columns and rows; perhaps empty."""
        low = np.maximum(np.floor(xy - reach).astype(int) - (self.x, self.y), 0)
        high = np.maximum(np.ceil(xy + reach).astype(int) + 1 - (self.x, self.y), low)
        part = slice(low[1], high[1]), slice(low[0], high[0])
        x, y = self.x + int(low[0]), self.y + int(low[1])
        grey, behind, sigma, noise = (layer[part] for layer in (self.grey, self.behind, self.sigma, self.noise))
        return Region(x, y, grey, behind, sigma, noise, self.front[part])

    def holds(self, xy: Floats) -> bool:
        """Whether a place of the image, px (2,), lies in it."""
        rows, columns = self.grey.shape
        return bool(self.x <= xy[0] <= self.x + columns - 1 and self.y <= xy[1] <= self.y + rows - 1)

    def copy_into(self, grey: Floats, noise: Floats, first: Integers) -> None:
        """Copy what lies in a window whose first pixel is `first` (2,), x and y in the image."""
        rows, columns = self.grey.shape
        x, y = int(first[0]) - self.x, int(first[1]) - self.y
        own = slice(max(0, y), min(rows, y + len(grey))), slice(max(0, x), min(columns, x + grey.shape[1]))
        there = slice(own[0].start - y, own[0].stop - y), slice(own[1].start - x, own[1].stop - x)
        grey[there], noise[there] = self.grey[own], self.noise[own]

    def copy_over(self, other: "Region") -> None:
        """Copy what lies in another region into it."""
        rows, columns = self.grey.shape
        low = np.maximum((self.x, self.y), (other.x, other.y))
        high = np.minimum((self.x + columns, self.y + rows), np.add((other.x, other.y), other.grey.shape[::-1]))
        if (low >= high).any():
            return
        (own, there) = (
            (slice(low[1] - of.y, high[1] - of.y), slice(low[0] - of.x, high[0] - of.x)) for of in (self, other)
        )
        for name in ("grey", "behind", "sigma", "noise", "front"):
            getattr(other, name)[there] = getattr(self, name)[own]


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
        self._variance = np.float32(np.median(noise) ** 2)
        self._ratio = np.where(ratio > _RESTLESS, ratio**2, np.float32(1))
        step = max(1, int(np.sqrt(grey.size / _SAMPLES)))
        self._grid = slice(step // 2, None, step), slice(step // 2, None, step)
        sampled = [layer[self._grid].ravel() for layer in (grey, self._right, self._down)]
        calm, order = self._ratio[self._grid].ravel() == 1, np.argsort(sampled[0])
        self._order = np.concatenate((order[calm[order]], order[~calm[order]]))  # calm ones first, bin by bin
        self._in_bin: int = max(1, int(calm.sum()) // _BINS)
        sampled = [layer[self._order] for layer in sampled]
        self._design = np.stack((sampled[0], np.ones_like(sampled[0]), *sampled[1:]))
        self._weight = 1 / np.sqrt(noise**2 + self._shift)[self._grid].ravel()[self._order]
        self._weighted = self._design * self._weight
        self._few = np.ascontiguousarray(self._weighted[:, ::_FEW])
        self._strip = max(1, _STRIP // grey.shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._grey.shape[0], self._grey.shape[1]

    def regions(
        self,
        image: Grey,
        stamped: tuple[int, int, int] | None = None,
        within: tuple[int, int, int, int] | None = None,
    ) -> list[Region]:
        """Where something is in front, the largest region first.

        Args:
            image: (rows, columns) of this camera.
            stamped: row, first column and count of pixels that are no picture.
            within: column and row of the first and behind the last pixel that is looked at; the whole image if left
                out.
        """
        moment = self._moment(image)
        front = np.zeros(image.shape, np.uint8)
        left, first, right, last = within or (0, 0, image.shape[1], len(image))
        for top in range(first, last, self._strip):  # what is computed at a time stays in the processor's cache
            part = slice(top, min(last, top + self._strip)), slice(left, right)
            behind, variance = self._expected(part, moment)
            difference = cv2.subtract(image[part].astype(np.float32), behind)
            variance *= np.float32(_FRONT**2)
            np.greater(cv2.multiply(difference, difference), variance, out=front[part].view(np.bool_))
        if stamped is not None:
            front[stamped[0], stamped[1] : stamped[1] + stamped[2]] = 0
        looked_at = (left, first, right, last)
        return [self._region(image, moment, front, box) for box in _boxes(front, looked_at)]

    def still(self, low: Integers, high: Integers) -> Region | None:
        """A part of the static scene itself, as `part` gives it where nothing is in front."""
        box = self._inside(low, high)
        if box is None:
            return None
        part = slice(box[1], box[3]), slice(box[0], box[2])
        grey, sigma = self._grey[part], np.sqrt(self._variance * self._ratio[part] + self._shift[part])
        return Region(box[0], box[1], grey.copy(), grey.copy(), sigma, sigma.copy(), np.zeros(grey.shape, bool))

    def relit(self, image: Grey) -> tuple[GreyImage, GreyImage, Floats]:
        """An image in the light of the static scene, and that scene where the image shows it.

        Args:
            image: (rows, columns) of this camera.

        Returns:
            Both, and the shift of the image.
        """
        moment = self._moment(image)
        grey = (image.astype(np.float32) - np.float32(moment.offset)) / np.float32(moment.light)
        right, down = moment.shift
        shifted = cv2.addWeighted(self._right, -right, self._down, -down, 0.0)
        return grey, np.asarray(cv2.add(self._grey, shifted), np.float32), moment.shift

    def shift(self, image: Grey) -> Floats:
        """The shift (2,), px, of an image against the static scene."""
        return self._moment(image).shift

    def part(self, image: Grey, low: Integers, high: Integers) -> Region | None:
        """A part of an image, whether anything is in front there or not.

        Args:
            image: (rows, columns) of this camera.
            low: first column and row, perhaps outside of the image.
            high: column and row behind the last ones.

        Returns:
            What of it lies in the image; None if nothing does.
        """
        box = self._inside(low, high)
        if box is None:
            return None
        moment = self._moment(image)
        front = np.zeros(image.shape, np.uint8)
        where = slice(box[1], box[3]), slice(box[0], box[2])
        behind, variance = self._expected(where, moment)
        front[where] = (image[where].astype(np.float32) - behind) ** 2 > variance * np.float32(_FRONT**2)
        return self._region(image, moment, front, box)

    def _inside(self, low: Integers, high: Integers) -> tuple[int, int, int, int] | None:
        left, top = np.maximum(low, 0).tolist()
        right, bottom = np.minimum(high, self.shape[::-1]).tolist()
        return (left, top, right, bottom) if right - left > 1 and bottom - top > 1 else None

    def _region(
        self, image: Grey, moment: "_Moment", front: NDArray[np.uint8], box: tuple[int, int, int, int]
    ) -> Region:
        left, top, right, bottom = box
        part = slice(top, bottom), slice(left, right)
        own = image[part].astype(np.float32)
        noise = np.sqrt(np.maximum(moment.read + moment.photon * cv2.blur(own, (3, 3)), _ROUNDING))
        restless = self._ratio[part] > 1
        behind, variance = self._expected(part, moment)
        return Region(left, top, own, behind, np.sqrt(variance), noise, (front[part] > 0) | restless)

    def _expected(self, part: tuple[slice, slice], moment: "_Moment") -> tuple[GreyImage, GreyImage]:
        """What the static scene shows in a part of an image, and the variance of differences from it."""
        shifted = cv2.addWeighted(self._right[part], moment.right, self._down[part], moment.down, moment.offset)
        behind = np.asarray(cv2.scaleAdd(self._grey[part], moment.gain, shifted), np.float32)
        variance = behind * moment.photon
        variance += moment.read
        np.maximum(variance, _ROUNDING, out=variance)
        variance *= self._ratio[part]
        variance += self._shift[part]
        return behind, variance

    def _moment(self, image: Grey) -> "_Moment":
        """Light, shift and noise of an image (robust adjustment of the grid)."""
        sample = image[self._grid].ravel()[self._order].astype(np.float32)
        values = sample * self._weight
        few = values[::_FEW]
        unknown, limit = np.array([1.0, 0.0, 0.0, 0.0]), np.inf
        keep = np.ones(len(few), np.float32)
        for _ in range(_ROUNDS):
            unknown = _solved(self._few, few, keep)
            v = np.abs(few - unknown @ self._few)
            limit = _CLIP * max(1e-3, _MAD_TO_SIGMA * median(v))
            keep = (v < limit).astype(np.float32)
        near = np.abs(values - unknown @ self._weighted) < limit
        unknown = _solved(self._weighted, values, near.astype(np.float32))
        grey = unknown @ self._design
        gain, offset, right, down = unknown.tolist()
        return _Moment(gain, offset, right, down, *self._noise(grey, np.abs(sample - grey)))

    def _noise(self, grey: GreyImage, off: GreyImage) -> tuple[np.float32, np.float32]:
        """Variance of a grey value in this image: of reading, and per grey value (photons)."""
        if self._in_bin < _FEWEST:
            return np.float32(np.median(self._weight) ** -2), np.float32(0)
        of_bins = slice(_BINS * self._in_bin)
        at = grey[of_bins].reshape(_BINS, -1).mean(axis=1)
        middle = self._in_bin // 2
        level = np.partition(off[of_bins].reshape(_BINS, -1), middle, axis=1)[:, middle]
        level = (_MAD_TO_SIGMA * level) ** 2
        from_mean = at - at.mean()
        slope = max(0.0, float(from_mean @ level / (from_mean @ from_mean))) if np.ptp(at) > 1 else 0.0
        read = max(float(_ROUNDING), median(level - slope * at))
        return np.float32(read), np.float32(slope)


def _solved(rows: GreyImage, values: GreyImage, keep: GreyImage) -> GreyImage:
    """Unknowns (4,) of weighted equations, rows (4, n) and values (n,), of which some are kept."""
    kept = rows * keep
    normal = (kept @ rows.T).astype(float)
    normal += np.diag(1e-9 * np.diag(normal) + 1e-12)
    return np.linalg.solve(normal, kept @ values).astype(np.float32)


@dataclass(frozen=True, slots=True, eq=False)
class _Moment:
    """An image beside the static scene: gain, offset, factors of its slopes, variance of reading and per grey value."""

    gain: float
    offset: float
    right: float
    down: float
    read: np.float32
    photon: np.float32

    @property
    def light(self) -> float:
        """The gain, or what it is at least where something of the scene is seen."""
        return max(self.gain, _DARKEST)

    @property
    def shift(self) -> Floats:
        """The shift (2,), px, of the image against the static scene."""
        return -np.array((self.right, self.down)) / self.light


def _usual(grey: GreyImage, noise: GreyImage) -> GreyImage:
    """The median noise of pixels of such a grey value."""
    values, spread = grey.ravel()[::_THIN], noise.ravel()[::_THIN]
    parts = [part for part in np.array_split(np.argsort(values), _BINS) if len(part)]
    at = [float(values[part].mean()) for part in parts]
    return np.interp(grey, at, [float(np.median(spread[part])) for part in parts]).astype(np.float32)


def _boxes(front: NDArray[np.uint8], within: tuple[int, int, int, int]) -> list[tuple[int, int, int, int]]:
    """Boxes around what moves in a part of an image, the largest first; a box is as `within` of `regions`."""
    left, top, right, bottom = within
    # Outer borders take a fifth of the time of labels: these need four bytes for each pixel, anew for each image.
    borders, _ = cv2.findContours(front[top:bottom, left:right], cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    boxes, specks = [], []
    for u, v, w, h in (cv2.boundingRect(border) for border in borders if len(border) >= _SPECK):
        x, y = u + left, v + top
        wide = x - _JOIN, y - _JOIN, x + w + _JOIN, y + h + _JOIN
        if max(w, h) >= _SMALLEST and min(w, h) >= _THINNEST:
            boxes.append((*wide, cv2.countNonZero(front[y : y + h, x : x + w])))
        else:
            specks.append(wide)
    looked_at = (right - left) * (bottom - top)
    boxes = [_with_specks(box, specks, looked_at) for box in boxes]
    rows, columns = front.shape
    grown = sorted(_joined(boxes), key=lambda box: -box[4])[:_MOST]
    spare = _MARGIN - _JOIN
    return [
        (max(0, x - spare), max(0, y - spare), min(columns, behind + spare), min(rows, below + spare))
        for x, y, behind, below, _ in grown
    ]


def _with_specks(
    box: tuple[int, int, int, int, int], specks: list[tuple[int, int, int, int]], looked_at: int
) -> tuple[int, int, int, int, int]:
    """A box with the specks about it: of a body as dark as what is behind it only the markers may stand out.

    No part of a body is farther from the largest one than this is long, or nearly. Where it snows, specks are
    everywhere: they belong to a body only if so many are hardly there by chance. `looked_at` is how many pixels were
    looked at.
    """
    reach = int(_REACH * max(box[2] - box[0], box[3] - box[1]))
    low, high = (box[0] - reach, box[1] - reach), (box[2] + reach, box[3] + reach)
    near = [of for of in specks if of[0] > low[0] and of[1] > low[1] and of[2] < high[0] and of[3] < high[1]]
    expected = (len(specks) - len(near) + 1) * min(1.0, (high[0] - low[0]) * (high[1] - low[1]) / looked_at)
    if not near or gammainc(len(near), expected) > _COINCIDENCE:  # so many or more, by the Poisson distribution
        return box
    x, y, behind, below = zip(box[:4], *near, strict=True)
    return min(x), min(y), max(behind), max(below), box[4]


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
