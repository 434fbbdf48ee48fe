"""The directories of tags of a TIFF file (revision 6.0, section 2): one for each page.

EXIF (Exif 2.32, CIPA DC-008), which says when a picture was taken, is such a file too, inside JPEG and PNG files.
"""

import re
import struct
from collections.abc import Mapping
from datetime import datetime
from typing import Final

import cv2
import numpy as np
from cv2 import IMAGE_METADATA_EXIF

#: Bytes of an image file, in memory or in a map of the file.
Data = bytes | memoryview
_DATE_TIME, _EXIF = 0x0132, 0x8769
_ORIGINAL, _DIGITIZED, _SUB_SECONDS, _OFFSET = 0x9003, 0x9004, 0x9291, 0x9011
_TEXT, _LONG = 2, 4  # types of values that are read
#: Size of an entry of a directory: tag, type, number of values, and the value or its place.
ENTRY_BYTES: Final = 12
_ORDERS: Final = {b"II*\0": "<", b"MM\0*": ">"}


def byte_order(data: Data) -> str | None:
    """How numbers of more than a byte stand in a TIFF file, for `struct`; None: it is none."""
    return _ORDERS.get(bytes(data[:4]))


def page_offsets(data: Data) -> tuple[list[int], bool]:
    """Where the directories of the pages of a TIFF file begin, and whether their chain is whole."""
    order, found = byte_order(data), dict[int, None]()
    if order is None:
        return [], False
    try:
        (at,) = struct.unpack_from(f"{order}I", data, 4)
        while at and at not in found:
            (count,) = struct.unpack_from(f"{order}H", data, at)
            (after,) = struct.unpack_from(f"{order}I", data, at + 2 + ENTRY_BYTES * count)
            found[at], at = None, after
    except struct.error:
        return list(found), False
    return list(found), at == 0


def taken_at(data: Data) -> datetime | None:
    """When the picture in an image file was taken; None: it does not say.

    Args:
        data: the file.

    Returns:
        With its time zone, if the camera knew that.
    """
    if byte_order(data) is None:
        data = _exif(data)
    try:
        return _date(data)
    except (struct.error, ValueError):  # a directory that points out of the file, or a date that is none
        return None


def _exif(data: Data) -> bytes:
    """The block of EXIF in a JPEG or PNG file; empty: there is none."""
    try:
        flags = cv2.IMREAD_REDUCED_GRAYSCALE_8
        _, kinds, blocks = cv2.imdecodeWithMetadata(np.frombuffer(data, np.uint8), flags=flags)
    except cv2.error:
        return b""
    found = [block for kind, block in zip(kinds, blocks, strict=True) if kind == IMAGE_METADATA_EXIF]
    return bytes(np.asarray(found[0], np.uint8)).removeprefix(b"Exif\0\0") if found else b""


def _date(data: Data) -> datetime | None:
    if (order := byte_order(data)) is None:
        return None
    tags = _directory(data, order, struct.unpack_from(f"{order}I", data, 4)[0])
    if isinstance(at := tags.get(_EXIF), int):
        tags = {**tags, **_directory(data, order, at)}
    text = next((found for tag in (_ORIGINAL, _DIGITIZED, _DATE_TIME) if (found := tags.get(tag))), None)
    if not isinstance(text, str):
        return None
    moment = datetime.strptime(text, "%Y:%m:%d %H:%M:%S")
    parts, offset = tags.get(_SUB_SECONDS), tags.get(_OFFSET)
    if isinstance(parts, str) and parts.isascii() and parts.isdigit():
        moment = moment.replace(microsecond=int(f"{parts:0<6}"[:6]))
    if isinstance(offset, str) and re.fullmatch(r"[+-]\d\d:\d\d", offset):
        moment = datetime.fromisoformat(f"{moment.isoformat()}{offset}")
    return moment


def _directory(data: Data, order: str, at: int) -> Mapping[int, str | int]:
    """The texts and whole numbers of a directory, by tag.

    Raises:
        struct.error: it lies outside the file.
    """
    (count,) = struct.unpack_from(f"{order}H", data, at)
    tags: dict[int, str | int] = {}
    for place in range(at + 2, at + 2 + ENTRY_BYTES * count, ENTRY_BYTES):
        tag, kind, size, value = struct.unpack_from(f"{order}HHII", data, place)
        if kind == _LONG and size == 1:
            tags[tag] = value
        elif kind == _TEXT:
            begin = value if size > 4 else place + 8
            tags[tag] = bytes(data[begin : begin + size]).split(b"\0")[0].decode("ascii", "replace").strip()
    return tags
