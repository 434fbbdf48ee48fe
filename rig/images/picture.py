"""Pictures made of stored pixels: grey values to measure in, and eight bits to look at."""

from typing import Any, Final, TypeAlias

import cv2
import numpy as np
from numpy.typing import NDArray

from rig.images.pixels import Pixels, Stored

#: Grey values in levels of eight bits, (rows, columns): uint8, or float32 where a level is divided.
Grey: TypeAlias = NDArray[np.uint8] | NDArray[np.float32]

#: OpenCV's conversions of mosaics, bilinear: to grey, and to blue, green, red.
_MOSAICS: Final = {
    "bayer_rggb8": (cv2.COLOR_BayerRGGB2GRAY, cv2.COLOR_BayerRGGB2BGR),
    "bayer_grbg8": (cv2.COLOR_BayerGRBG2GRAY, cv2.COLOR_BayerGRBG2BGR),
    "bayer_gbrg8": (cv2.COLOR_BayerGBRG2GRAY, cv2.COLOR_BayerGBRG2BGR),
    "bayer_bggr8": (cv2.COLOR_BayerBGGR2GRAY, cv2.COLOR_BayerBGGR2BGR),
}


def measurable(image: Stored, pixels: Pixels) -> Grey:
    """Grey values to measure in: the image itself if it is mono8.

    Args:
        image: (rows, columns), as stored.
        pixels: how it holds its pixels.
    """
    if pixels.is_mosaic:
        return _eight(cv2.cvtColor(np.ascontiguousarray(image), _MOSAICS[pixels.encoding][0]))
    if pixels.bits > 8:
        return np.asarray(np.multiply(image, np.float32(1 / pixels.scale), dtype=np.float32), np.float32)
    return _eight(image)


def shown(image: Stored, pixels: Pixels, *, coloured: bool = False) -> NDArray[np.uint8]:
    """Eight bits to look at: the image itself if it is mono8.

    Args:
        image: (rows, columns), as stored.
        pixels: how it holds its pixels.
        coloured: make blue, green, red of a mosaic, (rows, columns, 3); otherwise it becomes grey.
    """
    if pixels.is_mosaic:
        return _eight(cv2.cvtColor(np.ascontiguousarray(image), _MOSAICS[pixels.encoding][int(coloured)]))
    if pixels.bits > 8:
        return (image >> (pixels.bits - 8)).astype(np.uint8)
    return _eight(image)


def exported(image: Stored, pixels: Pixels) -> Stored:
    """What goes into files that lose nothing: mono16 fills all 16 bits, of a mosaic blue, green, red are made.

    Args:
        image: (rows, columns), as stored.
        pixels: how it holds its pixels.
    """
    if pixels.bits > 8:
        return np.left_shift(image, 16 - pixels.bits, dtype=np.uint16)
    return shown(image, pixels, coloured=True)


def _eight(image: NDArray[Any]) -> NDArray[np.uint8]:
    return np.asarray(image, np.uint8)
