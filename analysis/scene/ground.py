"""The ground behind a ball: a mean of the pixels around it, weighted by distance (normalized convolution)."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.arrays import Flags, Floats

REACH: Final = 2.2  #: px beyond a ball that are fitted
CLEAR: Final = 1.4  #: px beyond a ball from which on its surroundings are its ground
BLUR: Final = 0.62  #: px, of lens and pixel, to begin with
_GROUND_BLUR = 1.2  # px; standard deviation of the weights


def ground_behind(grey: NDArray[np.floating], around: Flags) -> Floats:
    """Grey values (m, w, w) of the ground.

    Args:
        grey: (m, w, w) of the images.
        around: (m, w, w) which pixels show it.
    """
    pixel = np.arange(grey.shape[-1])
    weight = np.exp(-0.5 * ((pixel[:, None] - pixel) / _GROUND_BLUR) ** 2)
    shown = around * 1.0
    return np.asarray((weight @ (shown * grey) @ weight) / np.maximum(weight @ shown @ weight, 1e-300))
