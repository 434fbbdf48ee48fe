"""Finds the pulses of a log in which something moves: the jump."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from recorder.log_items import Chunk
from recorder.log_reader import LogReader, tag_of
from recorder.raw_image import pixels, view_image
from rig.frame import FrameStatus
from rig.tag import TripletTag
from rig.topics import TAG, TRIPLET

_SAMPLES = 240
_BACKGROUND_SAMPLES = 25
_SMALL_ROWS = 96
_LEAST_PIXELS = 4
#: A pixel has changed if it differs from the background by this many times the noise, and grey levels.
_NOISE_FACTOR, _LEAST_LEVELS = 6.0, 8.0
#: A sample shows something if its activity lies above this part of the way from calm to the liveliest.
_LIVELY = 0.25


@dataclass(frozen=True, slots=True)
class StoredTriplet:
    """Where a triplet's image message stands in the file."""

    tag: TripletTag
    offset: int
    length: int

    def image(self, reader: LogReader) -> NDArray[np.uint8]:
        """The pixels, (rows, columns), valid until anything else is read."""
        return pixels(view_image(reader.read(self.offset, self.length)))


def stored_triplets(reader: LogReader) -> list[StoredTriplet]:
    """All pulses of a log that have an image; reads no pixels."""
    found = []
    for item in reader.items(only=(TAG.name,)):
        if isinstance(item, Chunk) and not item.flaw:
            tags = {m.sequence: tag for m in item.messages if (tag := tag_of(m)) is not None}
            found += [
                StoredTriplet(tags[m.sequence], m.offset, m.length)
                for m in item.messages
                if m.topic == TRIPLET.name and m.sequence in tags
            ]
    return found


def liveliest(
    reader: LogReader, triplets: Sequence[StoredTriplet], count: int, samples: int = _SAMPLES
) -> list[StoredTriplet]:
    """`count` triplets spread evenly over the stretch in which most moves; over all of them if nothing does.

    Looks at small images of at most `samples` pulses spread over the log, then at as many of the stretch that it has
    found: what moves for a shorter time than lies between two of them may be overlooked.
    """
    places = _evenly(len(triplets), samples)
    if len(places) <= count:
        return [triplets[place] for place in places]
    background = _background(reader, [triplets[place] for place in _evenly(len(triplets), _BACKGROUND_SAMPLES)])
    first, last = _lively_run(_activity(reader, [triplets[place] for place in places], background))
    begin, end = places[max(0, first - 1)], places[min(len(places) - 1, last + 1)]
    closer = [begin + place for place in _evenly(end - begin + 1, samples)]
    first, last = _lively_run(_activity(reader, [triplets[place] for place in closer], background))
    begin, end = closer[first], closer[last]
    missing = max(0, count - (end - begin + 1))
    begin = max(0, min(begin - missing // 2, len(triplets) - count))
    end = max(end, begin + count - 1)
    return [triplets[begin + place] for place in _evenly(end - begin + 1, count)]


def _evenly(length: int, count: int) -> list[int]:
    """At most `count` of the places 0 .. length - 1, evenly spaced, the first and the last among them."""
    return [round(place) for place in np.linspace(0, length - 1, min(length, count))]


def _background(reader: LogReader, samples: Sequence[StoredTriplet]) -> NDArray[np.float32]:
    """What stands still: the median of small images."""
    return np.median([_small(sample.image(reader)) for sample in samples], axis=0).astype(np.float32)


def _activity(
    reader: LogReader, samples: Sequence[StoredTriplet], background: NDArray[np.float32]
) -> NDArray[np.float64]:
    """For each sample, how many pixels of its small image differ from the background by more than noise."""
    changed = []
    for sample in samples:
        difference = np.abs(_small(sample.image(reader)) - background)
        for camera in sample.tag.cameras:
            if camera.status is not FrameStatus.OK:  # black is no motion
                scale = background.shape[1] / sample.tag.shape[1]
                difference[:, int(camera.columns[0] * scale) : int(np.ceil(camera.columns[1] * scale))] = 0
        limit = max(_LEAST_LEVELS, _NOISE_FACTOR * float(np.median(difference)))
        changed.append(float(np.count_nonzero(difference > limit)))
    return np.array(changed)


def _lively_run(activity: NDArray[np.float64]) -> tuple[int, int]:
    """First and last sample of the run with the most activity in sum; all samples if none stands out."""
    calm = float(np.median(activity)) if np.median(activity) < activity.max() / 2 else float(activity.min())
    top = float(activity.max())
    if top < _LEAST_PIXELS or top < 2 * calm:
        return 0, len(activity) - 1
    lively = np.flatnonzero(activity > calm + _LIVELY * (top - calm))
    runs = np.split(lively, np.flatnonzero(np.diff(lively) > 2) + 1)
    best = max(runs, key=lambda run: float(activity[run].sum()))
    return int(best[0]), int(best[-1])


def _small(image: NDArray[np.uint8]) -> NDArray[np.float32]:
    rows, columns = image.shape
    width = max(1, columns * _SMALL_ROWS // rows)
    step = max(1, rows // (4 * _SMALL_ROWS))  # of a large image every so many pixels are enough
    image = np.ascontiguousarray(image[::step, ::step])
    return cv2.resize(image, (width, _SMALL_ROWS), interpolation=cv2.INTER_AREA).astype(np.float32)
