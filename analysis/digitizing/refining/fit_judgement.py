"""What all refinements of a click share: how far off it may be, the noise there, and when a fit is refused."""

from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.scene.static_image import spatial_noise
from rig.arrays import Floats
from rig.errors import NoFitError
from rig.images.picture import Grey
from rig.phrase import Phrase, phrase

REFUSED_P: Final = 1e-4  #: probability of a worse fit, or of so much contrast by noise, at which a fit is refused
NEAR_PX: Final = 4.0  #: a click may be so far off
TRIED: Final = 6  #: starts of a fit
MODEL: Final = 0.03  #: of the contrast: residuals that a model itself leaves
_TRIALS = 100  # fits of which one by chance may be good: places and sizes that a search tries
_NOISE_REACH = 40.0  # px around a click in which the noise of the image is estimated


#: Why a fit is refused.
NOISE: Final = phrase("hand_fit_noise", "the contrast is that of noise")


def poor(ratio: float) -> Phrase:
    """Why a fit is refused whose residuals are so many times those of noise and model."""
    return phrase(
        "hand_fit_poor",
        "the fit is poor, its residuals are {ratio:.1f} times those of noise and model",
        ratio=ratio,
    )


def inside(image: Grey, xy: Floats) -> Floats:
    """A place (2,) px, if it lies in an image.

    Raises:
        NoFitError: it does not.
    """
    xy = np.asarray(xy, float)
    if not (np.isfinite(xy).all() and (xy >= 0).all() and (xy <= np.array(image.shape[::-1]) - 1).all()):
        raise NoFitError(phrase("hand_outside", "the place lies outside the image; click inside it"))
    return xy


def noise_around(image: Grey, xy: Floats) -> float:
    """Standard deviation of the grey values around a place, without what lies in them."""
    return spatial_noise(part_around(image, xy, _NOISE_REACH)[0])


def part_around(image: Grey, xy: Floats, reach: float) -> tuple[Grey, Floats]:
    """The part of an image within `reach` px of a place, and where it begins, (2,) px."""
    low = np.maximum(np.rint(xy - reach), 0).astype(int)
    high = np.rint(xy + reach).astype(int) + 1
    return image[low[1] : high[1], low[0] : high[0]], low.astype(float)


def is_significant(gain: float, unknowns: int) -> bool:
    """Whether a model explains more of the image than it would of noise, at the best of some trials."""
    return bool(gain > chdtri(unknowns, REFUSED_P / _TRIALS))


def is_poor(square: float, redundancy: float) -> bool:
    """Whether squared residuals over their variance are larger than chance allows."""
    return bool(square > chdtri(max(redundancy, 1.0), REFUSED_P))
