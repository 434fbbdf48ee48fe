"""Reads a serialized `foxglove.RawImage` without copying its pixels."""

from dataclasses import dataclass

import numpy as np
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError
from numpy.typing import NDArray

from rig.clocks import UtcNs

_DATA_KEY = RawImage.DATA_FIELD_NUMBER << 3 | 2


@dataclass(frozen=True, slots=True)
class ImageView:
    """An image message.

    Attributes:
        time: time stamp, UTC.
        rows, columns: size in px.
        step: bytes from row to row.
        encoding: e.g. mono8.
        frame_id: name of the coordinate frame.
        pixels_at: where the pixels start in the message.
        pixels: the pixels in place, no copy; as long as the message says, or as long as the view that was given.
    """

    time: UtcNs
    rows: int
    columns: int
    step: int
    encoding: str
    frame_id: str
    pixels_at: int
    pixels: memoryview


def view_image(message: memoryview) -> ImageView:
    """Read an image message.

    Raises:
        ValueError: it is none.
    """
    position, others, pixels_at, pixels = 0, bytearray(), 0, memoryview(b"")
    while position < len(message):
        field = position
        key, position = _varint(message, position)
        length, position = _field_length(message, position, key & 7)
        if key == _DATA_KEY:
            pixels_at, pixels = position, message[position : position + length]
        else:
            others += message[field : position + length]
        position += length
    # All other fields are small: the library reads them.
    try:
        image = RawImage.FromString(bytes(others))
    except DecodeError as error:
        raise ValueError(f"no foxglove.RawImage: {error}") from None
    return ImageView(
        UtcNs(image.timestamp.ToNanoseconds()),
        image.height,
        image.width,
        image.step,
        image.encoding,
        image.frame_id,
        pixels_at,
        pixels,
    )


def pixels(image: ImageView) -> NDArray[np.uint8]:
    """The pixels of a mono8 image in place, (rows, columns).

    Raises:
        ValueError: it is another encoding, has gaps between its rows, or not as many pixels as it says.
    """
    if image.encoding != "mono8" or image.step != image.columns:
        raise ValueError(f'the image is "{image.encoding}" with {image.step} bytes per row, not mono8 without gaps')
    if len(image.pixels) != image.rows * image.columns:
        raise ValueError(f"the image has {len(image.pixels)} pixels instead of {image.rows * image.columns}")
    return np.frombuffer(image.pixels, np.uint8).reshape(image.rows, image.columns)


def _field_length(message: memoryview, position: int, wire_type: int) -> tuple[int, int]:
    """Length of a field's content and where the content starts."""
    match wire_type:
        case 0:
            return _varint(message, position)[1] - position, position
        case 1:
            return 8, position
        case 2:
            return _varint(message, position)
        case 5:
            return 4, position
        case _:
            raise ValueError(f"no foxglove.RawImage: unknown wire type {wire_type}")


def _varint(message: memoryview, position: int) -> tuple[int, int]:
    """Protobuf's variable-length integer at `position`, and the position behind it."""
    number = 0
    for place in range(10):
        if position + place >= len(message):
            break
        byte = message[position + place]
        number |= (byte & 0x7F) << 7 * place
        if byte < 0x80:
            return number, position + place + 1
    raise ValueError("no foxglove.RawImage: it ends in the middle of a number")
