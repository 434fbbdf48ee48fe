"""Where a simulated camera's pixels come from."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from simrig.gige.frame_store import FrameStore, Slot
from simrig.gige.gvsp import FrameFormat
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
    """Puts the sensor's region of interest into frame slots. Exposure time and gain do not change the picture.

    Args:
        source: what the sensor sees.
        sensor: its width and height.
        camera: index of the camera for the stamp; None: frames carry no stamp.
        prerendered: so many images are rendered once, and frames only get a new stamp; 0: every frame is rendered.
    """

    def __init__(self, source: ImageSource, sensor: tuple[int, int], camera: int | None, prerendered: int) -> None:
        self._source, self._camera = source, camera
        self._sensor = sensor
        self._scratch: Image = np.zeros((sensor[1], sensor[0]), np.uint8)
        self._images = [np.empty_like(self._scratch) for _ in range(prerendered)]
        for pulse, image in enumerate(self._images):
            source.render_into(image, pulse)

    def prepare(self, store: FrameStore) -> None:
        """Fill the slots of a new store with the images rendered once, if there are any."""
        rows, columns = _region(store.format)
        for index, slot in enumerate(store.slots if self._images else ()):
            slot.image[...] = self._images[index % len(self._images)][rows, columns]

    def paint(self, frame: FrameFormat, slot: Slot, pulse: int) -> None:
        """Put hill pulse `pulse` into a slot."""
        if not self._images:
            if (frame.width, frame.height) == self._sensor:
                self._source.render_into(slot.image, pulse)
            else:
                rows, columns = _region(frame)
                self._source.render_into(self._scratch, pulse)
                slot.image[...] = self._scratch[rows, columns]
        if self._camera is not None:
            stamp.write(slot.image, self._camera, pulse)


def _region(frame: FrameFormat) -> tuple[slice, slice]:
    return (
        slice(frame.offset_y, frame.offset_y + frame.height),
        slice(frame.offset_x, frame.offset_x + frame.width),
    )
