"""Puts images of the hill, or of a test pattern, into the frames of a simulated camera on either bus."""

from collections.abc import Iterable
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from rig.pulse import HillPulse
from simrig.images import stamp
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario

Image = NDArray[np.uint8]


class _TestPattern:
    """A grey ramp that moves with the pulse. It costs nothing: for tests of everything but the picture."""

    def __init__(self, width: int, height: int) -> None:
        self._ramp = np.add.outer(np.arange(height), np.arange(width)).astype(np.uint8)

    def render_into(self, out: Image, pulse: HillPulse) -> None:
        """See `CameraView`."""
        np.add(self._ramp, np.uint8(pulse % 256), out=out)


class Painter:
    """One camera's images, of which a frame holds the part of the sensor that is read out.

    Exposure time and gain that the camera is set to do not change the picture: the scenario decides both.

    Args:
        scenario: what there is to see.
        camera: index of the camera in it.
        sensor: width and height of the whole sensor, px.
        rate_hz: rate of the hill's pulses.
        test_pattern: show a plain pattern instead of the hill.
        prerendered: number of images that are rendered once, so that frames only get a new stamp; 0: render each frame.
    """

    def __init__(
        self, scenario: Scenario, camera: int, sensor: tuple[int, int], rate_hz: float, *, test_pattern: bool,
        prerendered: int = 0,
    ) -> None:  # fmt: skip
        self._source = _TestPattern(*sensor) if test_pattern else CameraView(scenario, camera, *sensor, rate_hz)
        self._camera = camera if scenario.stamp else None
        self._scratch: Image = np.zeros((sensor[1], sensor[0]), np.uint8)
        self._images = [np.empty_like(self._scratch) for _ in range(prerendered)]
        for pulse, image in enumerate(self._images):
            self._source.render_into(image, HillPulse(pulse))

    def prepare(self, frames: Iterable[Image], rows: slice, columns: slice) -> None:
        """Fill frame memory with the prerendered images, if there are any."""
        for frame, image in zip(frames, cycle(self._images), strict=False):
            frame[...] = image[rows, columns]

    def paint(self, out: Image, rows: slice, columns: slice, pulse: HillPulse) -> None:
        """Draw hill pulse `pulse` into a frame.

        Args:
            out: the frame, shape (height, width).
            rows: rows of the sensor that the frame holds.
            columns: columns of the sensor that the frame holds.
            pulse: the hill pulse.
        """
        if not self._images:
            if out.shape == self._scratch.shape:
                self._source.render_into(out, pulse)
            else:
                self._source.render_into(self._scratch, pulse)
                out[...] = self._scratch[rows, columns]
        if self._camera is not None:
            stamp.write(out, self._camera, pulse)
