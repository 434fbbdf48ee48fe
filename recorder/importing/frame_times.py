"""Tells by the times in a video which frames it lacks: a frame that was dropped leaves a gap.

Cameras, phones and recording programs drop frames when they cannot keep up, and the file then holds neither the frame
nor its place. Counted one by one, all frames after it would be taken for those of the pulse before.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

#: A frame comes at its time to this share of the period, beside the rounding of the file.
_EARLY_OR_LATE: Final = 0.25
#: With that, it can still be told from the next one.
_PERIODS_OFF_MOST: Final = 0.4
#: A step that is shorter than so many usual ones is one.
_ONE: Final = 1.5


def frame_numbers(ticks: NDArray[np.int64]) -> tuple[NDArray[np.int64], float] | None:
    """Numbers of the frames of a video, by their times.

    Args:
        ticks: times of the frames in the order in which they are shown, in units of the file.

    Returns:
        The number of each frame, from 1, and the period in units of the file. None: times do not tell, because a frame
        does not come whole periods after the one before, or because half of the frames or more would be missing.
    """
    steps = np.diff(ticks)
    usual = float(np.median(steps)) if len(steps) else 0.0
    if usual <= 0.0:
        return None
    period = float(steps[steps < _ONE * usual].mean())
    whole = np.rint(steps / period).astype(np.int64)
    reach = min(_EARLY_OR_LATE + 1.0 / period, _PERIODS_OFF_MOST)
    if whole.min() < 1 or np.abs(steps / period - whole).max() > reach or whole.sum() >= 2 * len(ticks):
        return None
    return np.concatenate(([1], 1 + np.cumsum(whole))), period
