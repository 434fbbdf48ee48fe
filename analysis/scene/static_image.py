"""What each camera of a log sees when nothing moves: a robust mean of frames spread over the recording, with noise.

The frames of a camera that go in are distinct exposures: a frame that repeats another one (a replayed log, a camera
that hangs) says nothing new, and would make the noise look smaller than it is. Per pixel the median and the median
absolute deviation (MAD) tell what moved through it; the mean of the frames that agree with the median is the static
image. Its noise follows a model of read noise and photon noise, variance = a + b grey, fitted to all pixels. A pixel
that scatters by far more (a tree in the wind) keeps its own variance.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recorder.reading.log_reader import LogReader
from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import StoredTriplet, stored_triplets
from rig.arrays import Floats
from rig.errors import LogDamagedError
from rig.frame import FrameStatus
from rig.images.picture import Grey, measurable
from rig.phrase import phrase

GreyImage = NDArray[np.float32]

FRAMES = 31  #: of each camera, at most
_MEMORY = 256 << 20  # bytes for the frames of all cameras together
_FRAMES_LEAST = 7  # frames of each camera even if they need more memory than that
_SAME = 0.9  # share of equal pixels from which two frames are one exposure
_PROBES = 4096  # pixels that are compared for that
_MAD_TO_SIGMA = 1.4826
#: The MAD of few normal values is too small: factors for 2 to 9 values (Croux and Rousseeuw 1992), then n / (n - 0.8).
_SMALL_SAMPLE = (1.196, 1.495, 1.363, 1.206, 1.200, 1.140, 1.129, 1.107)
_CLIP = 4.0  # sigmas from the median at which a frame is left out of a pixel's mean
_BINS = 24  # of the grey values, for the noise model
_AGREEING = 0.6  # share of the frames that agrees with the median; with fewer all of them make the noise
_RESTLESS = 4.0  # times the model's variance: from there on a pixel keeps its own
_ROUNDING = 1 / 12  # variance of grey values that are whole numbers
_STRIP = 16 << 10  # pixels that are sorted at a time
_LAPLACIAN = 6.0  # root of the square sum of the elements of the kernel that measures noise in a single image


@dataclass(frozen=True, slots=True, eq=False)
class StaticImage:
    """The static image of one camera.

    Attributes:
        camera: its name.
        grey: (rows, columns) grey values.
        noise: (rows, columns) standard deviation of a single frame's grey value.
        frames: number of distinct frames that went in.
    """

    camera: str
    grey: GreyImage
    noise: GreyImage
    frames: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height, px."""
        return self.grey.shape[1], self.grey.shape[0]

    @property
    def sigma(self) -> GreyImage:
        """(rows, columns) standard deviation of `grey`."""
        return self.noise / np.float32(np.sqrt(self.frames))


def static_images(log: Path, pulses: range | None = None, frames: int = FRAMES) -> dict[str, StaticImage]:
    """The static image of every camera that delivered a frame.

    Args:
        log: the log; of a damaged one, the part that can be read.
        pulses: only these; all if left out.
        frames: of each camera, at most; fewer of large images, so that memory stays bounded.

    Returns:
        By camera name, left to right. Blocks that are not `ok` are left out.

    Raises:
        BadInputError: no such log.
        LogDamagedError: no camera has a frame there, or an image is damaged.
    """
    with RecordingReader(log) as reader:
        stored = [t for t in stored_triplets(reader) if pulses is None or t.tag.pulse in pulses]
        if not stored:
            raise LogDamagedError(
                phrase(
                    "log_no_image",
                    "{log}: holds no image that could be measured; look at it with `svev verify`",
                    log=str(log),
                )
            )
        rows, columns = stored[0].tag.shape
        pixel = 4 if stored[0].tag.pixels.bits > 8 else 1  # bytes
        count = max(_FRAMES_LEAST, min(frames, _MEMORY // (rows * columns * pixel)))
        wanted = _spread(stored, count)
        blocks: dict[str, list[Grey]] = {name: [] for name in wanted}
        for place in sorted(set().union(*wanted.values())):
            image = _image(stored[place], reader, log)
            for camera in stored[place].tag.cameras:
                if place in wanted.get(camera.name, ()):
                    blocks[camera.name].append(image[camera.part].copy())
    return {name: static_image(name, blocks.pop(name)) for name in wanted}


def static_image(camera: str, frames: Sequence[Grey]) -> StaticImage:
    """The static image of frames (rows, columns) of one camera, at least one.

    Args:
        camera: its name.
        frames: all of one size.
    """
    distinct = np.stack(_distinct(frames))
    n = len(distinct)
    if n < 3:
        grey = distinct.mean(axis=0, dtype=np.float32)
        return StaticImage(camera, grey, np.full_like(grey, spatial_noise(distinct[0])), n)
    twice = _twice_median(distinct)
    median = np.asarray(twice / np.float32(2), np.float32)
    twice_off = [cv2.absdiff(frame.astype(twice.dtype) * 2, twice) for frame in distinct]
    deviation = np.stack(twice_off).astype(twice.dtype, copy=False)  # twice what it is
    factor = _SMALL_SAMPLE[n - 2] if n < 10 else n / (n - 0.8)
    mad = np.asarray(np.float32(_MAD_TO_SIGMA * factor / 4) * _twice_median(deviation), np.float32)
    limit = _CLIP * np.maximum(_model(median, mad**2, quantile=None), np.float32(1.0))
    agrees = (deviation <= np.minimum(2 * limit, 2 * 255).astype(twice.dtype)).view(np.uint8)
    count, grey, variance = (np.zeros(median.shape, np.float32) for _ in range(3))
    for frame, counts in zip(distinct, agrees, strict=True):
        cv2.accumulate(counts, count)
        cv2.accumulate(frame, grey, counts)
    count[count < 2] = np.nan  # nothing agrees with the median: the median stands
    grey /= count
    grey = np.where(np.isnan(grey), median, grey)
    for frame, counts in zip(distinct, agrees, strict=True):
        cv2.accumulateSquare(cv2.subtract(frame, grey, dtype=cv2.CV_32F), variance, counts)
    variance /= count - 1
    variance = np.where(np.isfinite(variance), variance, mad**2)
    model = _model(grey, variance, quantile=n - 1) ** 2
    own = np.maximum(variance, mad**2)
    torn = ~(count > _AGREEING * n)
    if torn.any():
        own[torn] = ((deviation[:, torn] / np.float32(2)) ** 2).mean(axis=0)
    noise = np.sqrt(np.where(own > _RESTLESS * model, own, model))
    return StaticImage(camera, grey, noise.astype(np.float32), n)


def _twice_median(values: NDArray[Any]) -> NDArray[Any]:
    """Twice the medians of values (n, rows, columns) over the first axis: uint16 of whole numbers, else float32.

    All pixels of a strip, which stays in the processor's cache, are sorted at once by one network of comparisons.
    """
    n, rows, columns = values.shape
    flat = values.reshape(n, -1)
    whole = np.issubdtype(values.dtype, np.integer)
    twice = np.empty(rows * columns, np.uint16 if whole else np.float32)
    for first in range(0, rows * columns, _STRIP):
        part = slice(first, first + _STRIP)
        sorted_ = [row.copy() for row in flat[:, part]]
        spare = np.empty_like(sorted_[0])
        for low, high in _network(n):
            np.minimum(sorted_[low], sorted_[high], out=spare)
            np.maximum(sorted_[low], sorted_[high], out=sorted_[high])
            sorted_[low], spare = spare, sorted_[low]
        np.add(sorted_[(n - 1) // 2], sorted_[n // 2], out=twice[part], dtype=twice.dtype)
    return twice.reshape(rows, columns)


@cache
def _network(n: int) -> list[tuple[int, int]]:
    """Comparisons that sort n values: Batcher's odd-even merge sort (Knuth, vol. 3, 5.2.2, algorithm M)."""
    found = []
    p = 1
    while p < n:
        k = p
        while k >= 1:
            for j in range(k % p, n - k, 2 * k):
                places = range(j, j + min(k, n - j - k))
                found += [(i, i + k) for i in places if i // (2 * p) == (i + k) // (2 * p)]
            k //= 2
        p *= 2
    return found


def _spread(stored: Sequence[StoredTriplet], count: int) -> dict[str, set[int]]:
    """Per camera the places of up to `count` of its frames, spread evenly over those that are there."""
    there: dict[str, list[int]] = {}
    for place, triplet in enumerate(stored):
        for camera in triplet.tag.cameras:
            if camera.status is FrameStatus.OK:
                there.setdefault(camera.name, []).append(place)
    evenly = {name: np.linspace(0, len(places) - 1, min(len(places), count)) for name, places in there.items()}
    order = [camera.name for camera in stored[0].tag.cameras if camera.name in there]
    return {name: {there[name][round(float(i))] for i in evenly[name]} for name in order}


def _image(triplet: StoredTriplet, reader: LogReader, log: Path) -> Grey:
    try:
        return measurable(triplet.image(reader), triplet.tag.pixels)
    except ValueError as error:
        raise LogDamagedError(
            phrase(
                "log_image_damaged",
                "{log}: the image of pulse {pulse} is damaged ({why}); see which are with `svev verify`",
                log=str(log),
                pulse=int(triplet.tag.pulse),
                why=str(error),
            )
        ) from None


def _distinct(frames: Sequence[Grey]) -> list[Grey]:
    """The frames without those that repeat an earlier one, whatever moves in a small part of them."""
    step = max(1, frames[0].size // _PROBES)
    kept: list[Grey] = []
    probes: list[Grey] = []
    for frame in frames:
        probe = frame.ravel()[::step]
        if not any(np.mean(probe == other) > _SAME for other in probes):
            kept.append(frame)
            probes.append(probe)
    return kept


def _model(grey: GreyImage, variance: GreyImage, *, quantile: int | None) -> GreyImage:
    """Standard deviation of a frame by the model a + b grey, per pixel.

    Args:
        grey: grey values.
        variance: of each pixel.
        quantile: degrees of freedom of the variances, of which the median is taken; None: the mean of most.
    """
    values, spread = grey.ravel(), variance.ravel()
    order = np.argsort(values, kind="stable")
    parts = [part for part in np.array_split(order, _BINS) if len(part)]
    at = np.array([np.median(values[part]) for part in parts], float)
    if quantile is None:
        level = np.array([np.mean(np.minimum(spread[p], np.quantile(spread[p], 0.9))) for p in parts], float)
    else:
        level = np.array([np.median(spread[p]) for p in parts], float) / (1 - 2 / (9 * quantile)) ** 3
    a, b = _line(at, level)
    return np.asarray(np.sqrt(np.maximum(a + b * grey, _ROUNDING)), np.float32)


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """Offset and slope of the line through bins, neither negative where it matters; robust (Theil and Sen)."""
    dx, dy = np.subtract.outer(x, x), np.subtract.outer(y, y)
    apart = dx > 1.0
    slope = max(0.0, float(np.median(dy[apart] / dx[apart]))) if apart.any() else 0.0
    return float(np.median(y - slope * x)), slope


def spatial_noise(frame: Grey) -> float:
    """Noise of a single image: MAD after a filter that no plane and no straight edge along an axis passes."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    filtered = cv2.filter2D(frame.astype(np.float32), -1, kernel)
    return max(float(np.median(np.abs(filtered))) * _MAD_TO_SIGMA / _LAPLACIAN, float(np.sqrt(_ROUNDING)))
