"""Pixels as cameras send them become the numbers that they stand for."""

import numpy as np
import pytest

from recorder.live.unpacking import unpacker
from rig.images.pixels import FORMATS
from rig.settings.camera import CameraSettings, Region
from simrig.images.packing import Packing

#: Pixels and their bytes, by the layouts in PFNC 2.4 (p: section 6.2) and GigE Vision 2.0 (Packed: section 27).
BY_HAND = [
    ("Mono10", [0x2A5, 0x1C3, 0x3FF, 0x001], "a502 c301 ff03 0100"),
    ("Mono12", [0xABC, 0xDEF], "bc0a ef0d"),
    ("Mono16", [0x1234, 0xFEDC], "3412 dcfe"),
    ("Mono10Packed", [0x2A5, 0x1C3], "a9 31 70"),
    ("Mono12Packed", [0xABC, 0xDEF], "ab fc de"),
    ("Mono10p", [0x2A5, 0x1C3, 0x3FF, 0x001], "a5 0e f7 7f 00"),
    ("Mono12p", [0xABC, 0xDEF], "bc fa de"),
]


def _unpacked(name: str, data: bytes, shape: tuple[int, int]) -> list[list[int]]:
    """The numbers in a block that is part of a wider image, as the assembler asks for them."""
    region = Region(width=shape[1], height=shape[0])
    camera = CameraSettings(name="K1", backend="aravis", address="10.0.0.1", pixel_format=name, region=region)
    image = np.full((shape[0], shape[1] + 6), 7, np.uint16)
    unpacker(camera)(np.frombuffer(data, np.uint8), image[:, 3:-3])
    assert (image[:, :3] == 7).all()
    assert (image[:, -3:] == 7).all()
    found: list[list[int]] = image[:, 3:-3].tolist()
    return found


@pytest.mark.parametrize(("name", "pixels", "data"), BY_HAND, ids=lambda value: value if isinstance(value, str) else "")
def test_a_line_by_hand(name: str, pixels: list[int], data: str) -> None:
    assert _unpacked(name, bytes.fromhex(data), (1, len(pixels))) == [pixels]


@pytest.mark.parametrize("name", [name for name, *_ in BY_HAND])
def test_frames_of_many_strips_and_of_single_lines(name: str) -> None:
    packing, rng = Packing(name), np.random.default_rng(5)
    for shape in ((123, 640), (3, 16_384), (1, 4)):
        frame = rng.integers(0, 1 << FORMATS[name].pixels.bits, shape, np.uint16)
        data = np.zeros(FORMATS[name].frame_bytes(shape[1], shape[0]), np.uint8)
        packing.pack(frame, data)
        assert _unpacked(name, data.tobytes(), shape) == frame.tolist()
