import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.pulse import HillPulse
from simrig.images import stamp


@given(st.integers(0, 255), st.integers(0, 2**64 - 1))
def test_what_is_written_is_read(camera: int, pulse: int) -> None:
    image = np.full((3, 40), 77, np.uint8)
    stamp.write(image, camera, HillPulse(pulse))
    assert stamp.read(image) == stamp.Stamp(camera, HillPulse(pulse))
    assert (image[:-1] == 77).all()
    assert (image[-1, :-16] == 77).all()


@given(st.integers(0, 15), st.integers(1, 255))
def test_one_changed_pixel_breaks_the_stamp(place: int, change: int) -> None:
    image = np.zeros((2, 16), np.uint8)
    stamp.write(image, 1, HillPulse(123_456))
    image[-1, place] ^= change
    assert stamp.read(image) is None


def test_an_image_without_stamp_has_none() -> None:
    assert stamp.read(np.zeros((480, 640), np.uint8)) is None


def test_a_block_of_a_triplet_is_stamped_in_place() -> None:
    triplet = np.zeros((4, 60), np.uint8)
    stamp.write(triplet[:, 20:40], 1, HillPulse(9))
    assert stamp.read(triplet[:, 20:40]) == stamp.Stamp(1, HillPulse(9))
    assert stamp.read(triplet[:, :20]) is None


@pytest.mark.parametrize(("camera", "pulse"), [(256, 0), (-1, 0), (0, -1), (0, 2**64)])
def test_what_does_not_fit_is_refused(camera: int, pulse: int) -> None:
    with pytest.raises(struct.error):
        stamp.write(np.zeros((2, 16), np.uint8), camera, HillPulse(pulse))


def test_a_narrow_image_is_refused() -> None:
    with pytest.raises(ValueError, match="broadcast"):
        stamp.write(np.zeros((2, 15), np.uint8), 0, HillPulse(0))
