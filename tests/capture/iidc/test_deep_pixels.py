"""Cameras on FireWire with pixels of 10 to 16 bits: formats, depth, order of bytes, place of the significant bits."""

import re
from contextlib import closing
from typing import Any

import numpy as np
import pytest

from capture.iidc.camera import IidcCamera
from capture.iidc.pixels import copier
from rig.errors import CameraError
from simrig.firewire.camera.geometry import Deep
from simrig.images import stamp
from tests.capture.iidc.emulated import camera_ring, emulated_bus, settings
from tests.capture.iidc.test_iidc_camera import RATE_HZ, collect, running
from tests.capture.whole import whole_frames

REGION = {"x": 100, "y": 60, "width": 400, "height": 300}


@pytest.mark.parametrize(
    ("pixel_format", "deep", "region", "told"),
    [
        ("Mono10", Deep(), {}, "640 x 480 Mono10, 2572 bandwidth units"),
        ("Mono12", Deep(12, at_top=False, signed_bytes="high"), {}, "640 x 480 Mono12, 2572"),
        ("Mono12", Deep(12, signed_bytes="low"), REGION, "400 x 300 Mono12 from 100, 60, "),
        ("Mono16", Deep(16, at_top=False), REGION, "400 x 300 Mono16 from 100, 60, "),
    ],
)
def test_pixels_come_as_the_sensor_counted_them(
    pixel_format: str, deep: Deep, region: dict[str, int], told: str
) -> None:
    camera = settings(pixel_format=pixel_format, region=region)
    shape = camera.region.height, camera.region.width
    with emulated_bus(deep=deep, test_pattern=True), running(camera) as (made, ring):
        assert told in made.description
        arrivals = whole_frames(collect(made, ring, 3))
        image = ring.frame(arrivals[-1].slot).view("<u2").reshape(shape).copy()
        pulse = stamp.read(image)
    assert pulse is not None
    assert {(a.stamped.row, a.stamped.count) for a in arrivals if a.stamped} == {(shape[0] - 1, 12)}
    ids = [arrival.frame_id for arrival in arrivals]
    assert ids == list(range(ids[0], ids[0] + 3)), "the signature is read"
    left, top = (100, 60) if region else (196, 149)
    ramp = np.add.outer(np.arange(top, top + shape[0]), np.arange(left, left + shape[1])) + pulse.pulse
    more = camera.format.pixels.bits - 8
    expected = ramp % 256 << more | ramp % 256 >> 8 - more
    assert np.array_equal(image[:-1], expected[:-1])


@pytest.mark.parametrize(
    ("deep", "asked", "right"),
    [(Deep(10), "Mono12", "Mono10"), (Deep(12), "Mono16", "Mono12"), (Deep(12), "Mono10", "Mono12")],
)
def test_another_number_of_bits_is_refused_with_the_right_one(deep: Deep, asked: str, right: str) -> None:
    camera = settings(pixel_format=asked)
    text = f'camera K1 sends pixels of {deep.depth} significant bits, not {asked}: set pixel_format = "{right}"'
    with emulated_bus(deep=deep), camera_ring(camera) as ring, pytest.raises(CameraError, match=re.escape(text)):
        IidcCamera(camera, ring, RATE_HZ)


def test_8_bits_are_sent_again_after_16() -> None:
    deep, plain = settings(pixel_format="Mono10", region=REGION), settings(region=REGION)
    with emulated_bus(test_pattern=True):
        with running(deep) as (made, ring):
            collect(made, ring, 1)
        with camera_ring(plain) as ring, closing(IidcCamera(plain, ring, RATE_HZ)) as made:
            made.start()
            slot = whole_frames(collect(made, ring, 2))[-1].slot
            assert stamp.read(ring.frame(slot).reshape(300, 400)) is not None


def _copied(copy: Any, values: list[int]) -> list[int]:
    """What becomes of pixels, the last line of four aside."""
    sent = np.array([*values, 0xFFFF, 0xFFFF, 0xFFFF, 0xFFFF], ">u2")
    out = np.zeros(sent.nbytes, np.uint8)
    copy(sent.ctypes.data, out)
    return [int(value) for value in out.view("<u2")[:-4]]


@pytest.mark.parametrize("believed", [False, True])
@pytest.mark.parametrize("at_top", [False, True])
def test_the_pixels_show_where_the_significant_bits_are(believed: bool, at_top: bool) -> None:
    """A dark frame shows nothing, then the maker's way is believed. What a frame has shown stays."""
    copy = copier(settings(pixel_format="Mono12", region={"width": 4, "height": 3}), at_top=believed)
    dark, picture = [16, 32, 48, 4080, 0, 0, 16, 16], [7, 0, 256, 257, 4095, 1, 2, 3]
    assert _copied(copy, dark) == [value >> 4 if believed else value for value in dark]
    assert _copied(copy, [value << 4 if at_top else value for value in picture]) == picture
    assert _copied(copy, dark) == [value >> 4 if at_top else value for value in dark]
