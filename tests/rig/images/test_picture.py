"""Pictures of stored pixels: what is measured in, what is looked at, what is exported."""

from contextlib import closing

import numpy as np
import pytest

from rig.clocks import HostNs
from rig.frame import FrameStatus
from rig.images.picture import exported, measurable, shown
from rig.images.pixels import MONO8, Pixels, Stored
from rig.pulse import RigPulse
from rig.transport.preview import PreviewSlot

TWELVE = Pixels("mono16", 12)
#: Colours by letter, in the order of OpenCV: blue, green, red.
COLOURS = {"B": 200, "G": 100, "R": 40}


def _mosaic(pattern: str) -> Stored:
    image = np.zeros((16, 24), np.uint8)
    for place, letter in enumerate(pattern):
        image[place // 2 :: 2, place % 2 :: 2] = COLOURS[letter]
    return image


def test_eight_bits_are_not_touched() -> None:
    image = np.arange(12, dtype=np.uint8).reshape(3, 4)
    for picture in (measurable(image, MONO8), shown(image, MONO8, coloured=True), exported(image, MONO8)):
        assert picture.base is image or picture is image


def test_deeper_pixels_are_measured_in_fractions_of_a_grey_level() -> None:
    image = np.array([[0, 1, 16, 4095]], np.uint16)
    assert measurable(image, TWELVE).tolist() == [[0, 1 / 16, 1, 255.9375]]
    assert shown(image, TWELVE).tolist() == [[0, 0, 1, 255]]
    assert exported(image, TWELVE).tolist() == [[0, 16, 256, 65520]]


@pytest.mark.parametrize("pattern", ["RGGB", "GRBG", "GBRG", "BGGR"])
def test_colours_of_a_mosaic_come_back_at_their_place(pattern: str) -> None:
    image, pixels = _mosaic(pattern), Pixels(f"bayer_{pattern.lower()}8")
    coloured = shown(image, pixels, coloured=True)
    assert (coloured == [COLOURS[letter] for letter in "BGR"]).all()
    assert np.array_equal(exported(image, pixels), coloured)
    grey = 0.114 * COLOURS["B"] + 0.587 * COLOURS["G"] + 0.299 * COLOURS["R"]
    assert np.abs(measurable(image, pixels)[2:-2, 2:-2] - grey).max() <= 1
    assert shown(image, pixels).shape == image.shape


def test_the_preview_shows_the_highest_eight_bits() -> None:
    image = np.random.default_rng(2).integers(0, 4096, (6, 8), np.uint16)
    with closing(PreviewSlot.create((6, 8), 1)) as slot:
        slot.write(RigPulse(1), HostNs(1), [FrameStatus.OK], image, HostNs(1), 12)
        read = slot.read()
        assert read is not None
        assert np.array_equal(read.pixels, image >> 4)
        del read
