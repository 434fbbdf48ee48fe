"""Figures and marks that help to focus and expose a camera, from one of its images of eight bits.

Of a mosaic (Bayer), focus is measured in the mean of each cell of two by two pixels, in which the pattern of its
colours cancels exactly; brightness is that of the single pixels, because each colour clips by itself.
"""

import math
from dataclasses import dataclass
from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

Image: TypeAlias = NDArray[np.uint8]

_LEVELS: Final = 256
_WHITE: Final = _LEVELS - 1
#: Images are smoothed by this much before gradients are taken, so that the noise of single pixels counts less, px.
_FINE: Final = 1.0
#: An edge is compared with itself at this smoothing, px.
_COARSE: Final = 2.0
#: An edge counts as sharp if the lens spreads it by less than this, px (standard deviation of a Gaussian).
_SHARP: Final = 1.0
#: Noise alone marks one pixel in so many.
_FALSE_ONE_IN: Final = 1e6
#: A level of eight bits is rounded by this standard deviation: no image has less noise.
_ROUNDING: Final = 1 / math.sqrt(12)


@dataclass(frozen=True, slots=True)
class Exposure:
    """How bright an image is.

    Attributes:
        mean: mean brightness, share of white.
        clipped, black: shares of the pixels that are white and black.
        histogram: number of pixels in equal steps from black to white.
    """

    mean: float
    clipped: float
    black: float
    histogram: tuple[int, ...]


def focus(image: Image, *, mosaic: bool) -> float:
    """How sharp an image is: root mean square of its gradient over its mean, per pixel.

    Gradients of a smoothed image (Tenenbaum's measure). The mean in the denominator makes it independent of exposure.

    Args:
        image: (rows, columns), as the camera sent it.
        mosaic: whether its pixels have colours.
    """
    grey = _grey(image, mosaic=mosaic)
    mean = float(grey.mean())
    if mean == 0.0:
        return 0.0
    return math.sqrt(float(np.mean(np.square(_gradient(grey, _FINE))))) / mean / (2 if mosaic else 1)


def exposure(image: Image, bins: int) -> Exposure:
    """How bright an image is.

    Args:
        image: (rows, columns), as the camera sent it.
        bins: of the histogram; a divisor of 256.
    """
    counts = np.bincount(image.ravel(), minlength=_LEVELS)
    return Exposure(
        mean=float(counts @ np.arange(_LEVELS)) / image.size / _WHITE,
        clipped=int(counts[_WHITE]) / image.size,
        black=int(counts[0]) / image.size,
        histogram=tuple(int(count) for count in counts.reshape(bins, -1).sum(axis=1)),
    )


def sharp(image: Image, *, mosaic: bool) -> NDArray[np.bool_]:
    """Where an image is in focus (peaking), at its full size.

    An edge that the lens spreads by s px has, smoothed by a further t px, a gradient proportional to
    1 / sqrt(s^2 + t^2). The ratio of its gradients at two smoothings therefore says how far it is spread, whatever its
    contrast. Marked is what is spread by less than a pixel and is no noise.

    Args:
        image: (rows, columns), as the camera sent it.
        mosaic: whether its pixels have colours; then a pixel of the above is a cell of two by two.
    """
    grey = _grey(image, mosaic=mosaic)
    fine, coarse = _gradient(grey, _FINE), _gradient(grey, _COARSE)
    least = math.sqrt((_SHARP**2 + _COARSE**2) / (_SHARP**2 + _FINE**2))
    marked = (fine > least * coarse) & (fine > _noise(fine))
    # The ridge of an edge is a pixel wide; on a phone it has to be seen.
    thick = cv2.dilate(marked.astype(np.uint8), np.ones((3, 3), np.uint8))
    rows, columns = image.shape
    return np.asarray(cv2.resize(thick, (columns, rows), interpolation=cv2.INTER_NEAREST), np.bool_)


def _noise(gradient: NDArray[np.float32]) -> float:
    """What a gradient of noise alone exceeds once in `_FALSE_ONE_IN` pixels.

    Without structure the length of a gradient has a Rayleigh distribution: its median is sigma sqrt(2 ln 2), and it
    exceeds sigma sqrt(2 ln n) once in n. Most of an image is no edge, so the median knows little of edges.
    """
    # Smoothing by t px leaves, of white noise of sigma s, a derivative of sigma s / (sqrt(8 pi) t^2).
    rounding = _ROUNDING / (math.sqrt(8 * math.pi) * _FINE**2)
    sigma = max(float(np.median(gradient)) / math.sqrt(2 * math.log(2)), rounding)
    return sigma * math.sqrt(2 * math.log(_FALSE_ONE_IN))


def _grey(image: Image, *, mosaic: bool) -> NDArray[np.float32]:
    grey = image.astype(np.float32)
    if not mosaic:
        return grey
    rows, columns = (size // 2 for size in image.shape)
    return np.asarray(grey[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2).mean(axis=(1, 3)), np.float32)


def _gradient(grey: NDArray[np.float32], smoothing: float) -> NDArray[np.float32]:
    """Length of the gradient of a smoothed image, levels per pixel, by central differences."""
    smooth: NDArray[Any] = cv2.GaussianBlur(grey, (0, 0), smoothing, borderType=cv2.BORDER_REPLICATE)
    difference = np.array([[-0.5, 0.0, 0.5]], np.float32)
    across = cv2.filter2D(smooth, cv2.CV_32F, difference, borderType=cv2.BORDER_REPLICATE)
    down = cv2.filter2D(smooth, cv2.CV_32F, difference.T, borderType=cv2.BORDER_REPLICATE)
    return np.asarray(cv2.magnitude(across, down), np.float32)
