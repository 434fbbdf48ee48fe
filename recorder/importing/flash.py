"""Finds a flash that all cameras saw: it says which frames were taken at the same time, to less than one frame."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

#: From the median absolute deviation to the standard deviation of a normal distribution.
_TO_SIGMA: Final = 1.4826
#: A flash is a rise of the mean brightness by more than so many standard deviations of its changes, ...
_SIGMAS: Final = 10.0
#: ... and by more than this share of white: the noise of a mean over all pixels is far below one grey value.
_RISE_LEAST: Final = 1e-3
#: Another rise that is more than this share of the largest one may be the flash as well.
_RIVAL: Final = 0.5


def flashes(brightness: NDArray[np.float64]) -> list[int]:
    """Where a film becomes brighter all at once.

    The changes from frame to frame are compared with their own spread, which is taken from their median: it is that of
    a quiet film, whatever a flash or a jumper does in a few frames. Rises in frames that follow each other are one: a
    flash may begin while the shutter is open.

    Args:
        brightness: (n,) mean of each frame, as a share of white; NaN where there is none.

    Returns:
        Places of the first frames of the flashes in `brightness`: none, the one flash, or all rises that may be it.
    """
    there = np.flatnonzero(np.isfinite(brightness))
    if len(there) < 3:
        return []
    rises = np.diff(brightness[there])
    spread = _TO_SIGMA * float(np.median(np.abs(rises - np.median(rises))))
    limit = max(_SIGMAS * spread, _RISE_LEAST)
    beyond = np.flatnonzero(rises > limit)
    groups = np.split(beyond, np.flatnonzero(np.diff(beyond) > 1) + 1) if len(beyond) else []
    heights = [float(rises[group].sum()) for group in groups]
    return [
        int(there[group[0] + 1])
        for group, height in zip(groups, heights, strict=True)
        if height > _RIVAL * max(heights)
    ]
