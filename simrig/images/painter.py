"""Puts images of the hill, or of a test pattern, into the frames of a simulated camera on either bus."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from rig.images.pixels import FORMATS, Stored
from rig.pulse import HillPulse
from simrig.images import stamp
from simrig.images.packing import Packing
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario

Image = NDArray[np.uint8]


class _TestPattern:
    """A grey ramp that moves with the pulse. It costs nothing: for tests of everything but the picture."""

    def __init__(self, width: int, height: int, bits: int) -> None:
        self._ramp = np.add.outer(np.arange(height), np.arange(width)).astype(np.uint8)
        self._more_bits = bits - 8

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """See `CameraView`."""
        if out.dtype == np.uint8:
            np.add(self._ramp, np.uint8(pulse % 256), out=out)
        else:
            level = (self._ramp + np.uint8(pulse % 256)).astype(np.uint16)
            out[...] = level << self._more_bits | level >> 8 - self._more_bits  # white is white, and all bits are used


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
        self._source_of = partial(_source, scenario, camera, sensor, rate_hz, test_pattern)
        self._source = self._source_of(8)
        self._sensor = (sensor[1], sensor[0])
        self._deep: _Deep | None = None
        self._camera = camera if scenario.stamp else None
        self._scratch: Image = np.zeros((sensor[1], sensor[0]), np.uint8)
        self._images = [np.empty_like(self._scratch) for _ in range(prerendered)]
        for pulse, image in enumerate(self._images):
            self._source.render_into(image, HillPulse(pulse))

    def prepare(self, frames: Iterable[Image], rows: slice, columns: slice, pixel_format: str = "Mono8") -> None:
        """Fill frame memory with the prerendered images, if there are any; only of Mono8 there can be."""
        if pixel_format != "Mono8":
            self._deep = self._made(pixel_format)
            return
        for frame, image in zip(frames, cycle(self._images), strict=False):
            part = image[rows, columns]
            frame.reshape(part.shape)[...] = part

    def paint(self, out: Image, rows: slice, columns: slice, pulse: HillPulse, pixel_format: str = "Mono8") -> None:
        """Draw hill pulse `pulse` into a frame.

        Args:
            out: the frame's bytes as they are sent, of any shape.
            rows: rows of the sensor that the frame holds.
            columns: columns of the sensor that the frame holds.
            pulse: the hill pulse.
            pixel_format: how its pixels are sent.
        """
        if pixel_format != "Mono8":
            self._paint_deep(out, rows, columns, pulse, pixel_format)
            return
        out = out.reshape(rows.stop - rows.start, columns.stop - columns.start)
        if not self._images:
            if out.shape == self._scratch.shape:
                self._source.render_into(out, pulse)
            else:
                self._source.render_into(self._scratch, pulse)
                out[...] = self._scratch[rows, columns]
        if self._camera is not None:
            stamp.write(out, self._camera, pulse)

    def _paint_deep(self, out: Image, rows: slice, columns: slice, pulse: HillPulse, pixel_format: str) -> None:
        deep = self._deep
        if deep is None or deep.pixel_format != pixel_format:
            deep = self._deep = self._made(pixel_format)
        deep.source.render_into(deep.scratch, pulse)
        part = deep.scratch[rows, columns]
        if self._camera is not None:
            stamp.write(part, self._camera, pulse)
        deep.packing.pack(part, out)

    def _made(self, pixel_format: str) -> "_Deep":
        pixels = FORMATS[pixel_format].pixels
        scratch = np.zeros(self._sensor, pixels.dtype)
        return _Deep(pixel_format, self._source_of(pixels.bits), scratch, Packing(pixel_format))


@dataclass(frozen=True, slots=True)
class _Deep:
    """What draws frames that are packed, or behind colour filters.

    Attributes:
        pixel_format: of these frames.
        source: draws the whole sensor.
        scratch: the sensor's image.
        packing: makes bytes of it.
    """

    pixel_format: str
    source: CameraView | _TestPattern
    scratch: Stored
    packing: Packing


def _source(
    scenario: Scenario, camera: int, sensor: tuple[int, int], rate_hz: float, test_pattern: bool, bits: int
) -> CameraView | _TestPattern:
    if test_pattern:
        return _TestPattern(*sensor, bits)
    return CameraView(scenario, camera, *sensor, rate_hz, bits)
