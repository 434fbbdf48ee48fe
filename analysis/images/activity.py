"""Finds the stretch of a log in which most moves, the jump, for thumbnails and contact sheets."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from recorder.reading.log_reader import LogReader
from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import StoredTriplet, stored_triplets
from rig.errors import LogDamagedError, UnknownRecordingError
from rig.frame import FrameStatus
from rig.images.picture import measurable

#: Number of pulses whose images are compared, in the whole log and once more in the stretch found there.
_SAMPLES = 240
#: The same for a thumbnail: few are enough, because a flight lasts some tenths of a recording.
_FEW_SAMPLES = 24
_BACKGROUND_SAMPLES = 25
#: Images are compared at this number of rows.
_SMALL_ROWS = 96
#: If fewer pixels change in every sample, nothing moves.
_LEAST_PIXELS = 4
#: A pixel has changed if it differs from the background by so many times the noise, and by so many grey levels.
_NOISE_FACTOR, _LEAST_LEVELS = 6.0, 8.0
#: A sample is lively if its activity exceeds that of calm samples by this part of the liveliest sample's excess.
_LIVELY = 0.25


def liveliest_pulse(log: Path) -> int:
    """The pulse for the thumbnail of a recording: in the middle of the stretch in which most moves.

    Complete pulses are preferred.

    Raises:
        UnknownRecordingError: no camera delivered a frame.
        BadInputError: the log cannot be read.
        LogDamagedError: one of the images that were compared is damaged.
    """
    with RecordingReader(log, skim=True) as reader:
        stored = stored_triplets(reader)
        shown = [triplet for triplet in stored if triplet.tag.complete] or [
            triplet for triplet in stored if any(camera.status is FrameStatus.OK for camera in triplet.tag.cameras)
        ]
        if not shown:
            raise UnknownRecordingError(f"recording {log.stem} has no image: no camera delivered one")
        try:
            return liveliest(reader, shown, 3, _FEW_SAMPLES)[len(shown[:3]) // 2].tag.pulse
        except ValueError as error:
            raise LogDamagedError(f"{log}: an image is damaged ({error}); see which with `svev verify`") from None


def busiest_pulse(log: Path) -> int | None:
    """The pulse in the middle of the stretch in which most moves; None if nothing moves.

    Raises:
        BadInputError: the log cannot be read.
    """
    with RecordingReader(log, skim=True) as reader:
        shown = [triplet for triplet in stored_triplets(reader) if triplet.tag.complete]
        if not shown:
            return None
        samples = [shown[place] for place in _evenly(len(shown), _FEW_SAMPLES)]
        try:
            activity = _activity(reader, samples, _background(reader, samples))
            if _lively_run(activity) == (0, len(activity) - 1):
                return None
            return liveliest(reader, shown, 3, _FEW_SAMPLES)[len(shown[:3]) // 2].tag.pulse
        except ValueError:  # an image is damaged, as `svev verify` says; the recording is shown from its beginning
            return None


def liveliest(
    reader: LogReader, triplets: Sequence[StoredTriplet], count: int, samples: int = _SAMPLES
) -> list[StoredTriplet]:
    """`count` triplets spread evenly over the stretch in which most moves; over all triplets if nothing moves.

    Compares small images of at most `samples` pulses spread over the log, then of as many pulses of the stretch found
    there. A movement that is shorter than the time between two samples may be overlooked.

    Raises:
        ValueError: one of the images that are compared is damaged.
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
    """At most `count` of the indices 0 .. length - 1, evenly spaced, the first and the last among them."""
    return [round(place) for place in np.linspace(0, length - 1, min(length, count))]


def _background(reader: LogReader, samples: Sequence[StoredTriplet]) -> NDArray[np.float32]:
    """The picture without what moves: the median of small images, (rows, columns)."""
    return np.median([_small(sample, reader) for sample in samples], axis=0).astype(np.float32)


def _activity(
    reader: LogReader, samples: Sequence[StoredTriplet], background: NDArray[np.float32]
) -> NDArray[np.float64]:
    """For each sample, how many pixels of its small image differ from the background by more than noise."""
    changed = []
    for sample in samples:
        difference = np.abs(_small(sample, reader) - background)
        for camera in sample.tag.cameras:
            if camera.status is not FrameStatus.OK:  # a black block is no motion
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


def _small(sample: StoredTriplet, reader: LogReader) -> NDArray[np.float32]:
    """The image of a pulse, made small: grey values of eight bits."""
    stored = sample.image(reader)
    rows, columns = stored.shape
    width = max(1, columns * _SMALL_ROWS // rows)
    step = max(1, rows // (4 * _SMALL_ROWS))  # of a large image every so many pixels are enough
    if not sample.tag.pixels.is_mosaic:  # of which every other pixel has another colour
        stored = stored[::step, ::step]
    image = measurable(np.ascontiguousarray(stored), sample.tag.pixels)
    return cv2.resize(image, (width, _SMALL_ROWS), interpolation=cv2.INTER_AREA).astype(np.float32)
