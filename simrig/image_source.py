"""Where a simulated camera's pixels come from."""

from collections.abc import Iterable
from itertools import cycle
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from simrig.images import stamp

Image = NDArray[np.uint8]


class ImageSource(Protocol):
    """What the whole sensor sees."""

    def render_into(self, out: Image, pulse: int) -> None:
        """Render hill pulse `pulse` into `out`, shape (sensor height, sensor width)."""


class TestPattern:
    """A grey ramp that moves with the pulse: costs nothing, for tests of everything but the picture."""

    __test__ = False  # pytest: this is no test class

    def __init__(self, width: int, height: int) -> None:
        self._ramp = np.add.outer(np.arange(height), np.arange(width)).astype(np.uint8)

    def render_into(self, out: Image, pulse: int) -> None:
        """See `ImageSource`."""
        np.add(self._ramp, np.uint8(pulse % 256), out=out)


class Painter:
    """Puts the part of the sensor that is read out into frames. Exposure time and gain do not change the picture.

    Args:
        source: what the sensor sees.
        sensor: its width and height.
        camera: index of the camera for the stamp; None: frames carry no stamp.
        prerendered: so many images are rendered once, and frames only get a new stamp; 0: every frame is rendered.
    """

    def __init__(self, source: ImageSource, sensor: tuple[int, int], camera: int | None, prerendered: int = 0) -> None:
        self._source, self._camera = source, camera
        self._scratch: Image = np.zeros((sensor[1], sensor[0]), np.uint8)
        self._images = [np.empty_like(self._scratch) for _ in range(prerendered)]
        for pulse, image in enumerate(self._images):
            source.render_into(image, pulse)

    def prepare(self, frames: Iterable[Image], rows: slice, columns: slice) -> None:
        """Fill the frames that will be painted with the images rendered once, if there are any."""
        for frame, image in zip(frames, cycle(self._images), strict=False):
            frame[...] = image[rows, columns]

    def paint(self, out: Image, rows: slice, columns: slice, pulse: int) -> None:
        """Put hill pulse `pulse` into a frame.

        Args:
            out: the frame, shape (height, width).
            rows: of the sensor.
            columns: of the sensor.
            pulse: which one.
        """
        if not self._images:
            if out.shape == self._scratch.shape:
                self._source.render_into(out, pulse)
            else:
                self._source.render_into(self._scratch, pulse)
                out[...] = self._scratch[rows, columns]
        if self._camera is not None:
            stamp.write(out, self._camera, pulse)
