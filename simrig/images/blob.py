"""Images of small bright discs, true in position to a few thousandths of a pixel.

A disc, blurred by the lens and integrated over the area of each pixel, keeps its centre of gravity. The lens is a
Gaussian; a pixel's area acts like one more blur of variance 1/12 px^2. What results is a smooth radial profile, sampled
at the pixels' centres: so wide a curve has no aliasing to speak of.
"""

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_STEP = 0.02  #: px between samples of the profile
_REACH_SIGMA = 4.5  #: the profile ends this many sigmas outside of the disc, below 1e-5
_PIXEL_VARIANCE = 1 / 12


class Blob:
    """The image of a uniform disc.

    Args:
        radius_px: of the disc.
        blur_sigma_px: of the lens.
    """

    def __init__(self, radius_px: float, blur_sigma_px: float) -> None:
        sigma = math.sqrt(blur_sigma_px**2 + _PIXEL_VARIANCE)
        self.reach_px = radius_px + _REACH_SIGMA * sigma
        self._radii = np.arange(0.0, self.reach_px + _STEP, _STEP)
        self._profile = _blurred_disc(self._radii, radius_px, sigma)

    def draw(self, image: NDArray[np.float32], x: float, y: float, grey: float, scale: float = 1.0) -> None:
        """Blend the blob, `scale` times as large, into `image` (h, w) at pixel coordinates (x, y), in place."""
        reach = self.reach_px * scale
        top, left = max(0, math.ceil(y - reach)), max(0, math.ceil(x - reach))
        window = image[top : math.floor(y + reach) + 1, left : math.floor(x + reach) + 1]
        if not window.size or y + reach < 0 or x + reach < 0:
            return
        down = np.arange(top, top + window.shape[0]) - y
        right = np.arange(left, left + window.shape[1]) - x
        radii = np.sqrt(down[:, None] ** 2 + right**2) / scale
        cover = np.interp(radii, self._radii, self._profile, right=0.0).astype(np.float32)
        window += cover * (np.float32(grey) - window)


def _blurred_disc(radii: Array, disc: float, sigma: float) -> Array:
    """Radial profile of a disc convolved with a Gaussian: quadrature over the chords of the disc."""
    nodes, weights = np.polynomial.legendre.leggauss(96)
    u = disc * nodes
    chord = np.array([math.erf(math.sqrt(disc**2 - v**2) / (math.sqrt(2) * sigma)) for v in u])
    line = np.exp(-((radii[:, None] - u) ** 2) / (2 * sigma**2)) / (math.sqrt(2 * math.pi) * sigma)
    return np.asarray(line @ (chord * weights * disc))
