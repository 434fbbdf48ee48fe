"""Decodes image files into grey values."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from recorder.importing.grey import grey
from rig.images.pixels import Stored


def decoded(data: NDArray[np.uint8]) -> Stored | None:
    """The grey values of an image file; None if it cannot be read.

    Args:
        data: the file, (bytes,).

    Raises:
        ValueError: its pixels are of a kind that logs do not hold; the text says which.
    """
    try:
        picture: NDArray[Any] | None = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    except cv2.error:
        return None
    return None if picture is None else grey(picture)
