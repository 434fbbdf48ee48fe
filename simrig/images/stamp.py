"""The stamp in a simulated frame: which camera took it at which hill pulse.

It stands in the last 16 pixels of the last line, a byte in each, like the secure image signature of AVT's cameras. So a
test can read from the pixels alone whether a triplet mixes pulses. Bytes: magic "SVEV", camera index, pulse (8,
big-endian), check (lowest 3 bytes of the CRC-32 of the 13 bytes before, big-endian).
"""

import struct
import zlib
from dataclasses import dataclass

import numpy as np

from rig.images.pixels import Stored
from rig.pulse import HillPulse

STAMP_BYTES = 16
_MAGIC = b"SVEV"
_BODY = struct.Struct(">4sBQ")


@dataclass(frozen=True, slots=True)
class Stamp:
    """Content of a stamp.

    Attributes:
        camera: index of the camera in the scenario, 0 for the leftmost.
        pulse: hill pulse, counted from 0.
    """

    camera: int
    pulse: HillPulse


def write(image: Stored, camera: int, pulse: HillPulse) -> None:
    """Stamp `image`, shape (h, w) with w >= 16, in place.

    Raises:
        struct.error: `camera` does not fit into one byte or `pulse` not into eight.
        ValueError: the image is narrower than the stamp.
    """
    body = _BODY.pack(_MAGIC, camera, pulse)
    image[-1, -STAMP_BYTES:] = np.frombuffer(body + _check(body), np.uint8)


def read(image: Stored) -> Stamp | None:
    """The stamp of `image`, shape (h, w); None if it carries none or a broken one."""
    data = image[-1, -STAMP_BYTES:].astype(np.uint8).tobytes()
    body, check = data[: _BODY.size], data[_BODY.size :]
    if check != _check(body) or not body.startswith(_MAGIC):
        return None
    _, camera, pulse = _BODY.unpack(body)
    return Stamp(camera, pulse)


def _check(body: bytes) -> bytes:
    return zlib.crc32(body).to_bytes(4, "big")[1:]
