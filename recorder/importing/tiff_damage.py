"""Finds damage of TIFF pages that OpenCV reads over without a word.

OpenCV decodes pages of at most 8 bits by libtiff's functions for showing pictures, which go on after an error and leave
the rest black or wrong. So the places of the strips are checked here, and compressed pages are decoded once more by
Pillow, which stops at the first error of the same library. TIFF has no checksums: a wrong byte among uncompressed grey
values cannot be seen.
"""

import math
import struct
from io import BytesIO
from typing import Final

from PIL import Image, UnidentifiedImageError

from recorder.importing.tiff_tags import ENTRY_BYTES, Data, byte_order

_WIDTH, _ROWS, _BITS, _COMPRESSION, _SAMPLES, _ROWS_PER_STRIP, _PLANES = 256, 257, 258, 259, 277, 278, 284
_TILE_WIDTH, _TILE_ROWS = 322, 323
_STRIPS: Final = (273, 279)  # offsets and byte counts
_TILES: Final = (324, 325)
#: Photometric interpretation, order of bits, predictor, colour map, meaning of further samples, format of samples.
_OF_PIXELS: Final = (262, 266, 317, 320, 338, 339)
_OF_DECODING: Final = frozenset(
    (_WIDTH, _ROWS, _BITS, _COMPRESSION, _SAMPLES, _ROWS_PER_STRIP, _PLANES, _TILE_WIDTH, _TILE_ROWS, *_OF_PIXELS)
)
_SHORT, _LONG = 3, 4
_FORMATS: Final = {_SHORT: "H", _LONG: "I"}  # types of whole numbers
_HEAD: Final = 8  # bytes of the head of a file
_COMPRESSED: Final = (5, 8, 32773, 32946)  # LZW, deflate, PackBits, deflate by its old number
_LENIENT_BITS: Final = 8  # of a grey value, and fewer: what OpenCV decodes by the functions that go on

_Numbers = dict[int, tuple[int, ...]]


def damage(data: Data, directory: int) -> str:
    """What is damaged in a page of a TIFF file, in words; empty: nothing that can be seen.

    Args:
        data: the file.
        directory: where the page's directory begins.
    """
    try:
        numbers = _numbers(data, directory)
    except struct.error:
        return "its directory points out of the file"
    if found := _of_places(numbers, len(data)):
        return found
    lenient = max(numbers.get(_BITS, ()), default=1) <= _LENIENT_BITS
    compressed = _one(numbers, _COMPRESSION, 1) in _COMPRESSED
    counted = all(numbers.get(_tags_of_parts(numbers)[1], (0,)))  # else the decoder finds out how many bytes there are
    return _of_compressed(data, numbers) if lenient and compressed and counted else ""


def _of_compressed(data: Data, numbers: _Numbers) -> str:
    try:
        image = Image.open(BytesIO(_page_alone(data, numbers)), formats=("TIFF",))
    except (UnidentifiedImageError, Image.DecompressionBombError):  # a kind that Pillow does not know
        return ""
    try:
        image.load()
    except OSError:
        return "its compressed pixels are damaged"
    return ""


def _page_alone(data: Data, numbers: _Numbers) -> bytes:
    """A TIFF file of this page alone, with the tags that its decoding needs and no others."""
    order = byte_order(data)
    tags = _tags_of_parts(numbers)
    spans = zip(numbers[tags[0]], numbers[tags[1]], strict=False)
    parts = [bytes(data[offset : offset + count]) for offset, count in spans]
    kept = {tag: values for tag, values in numbers.items() if tag in _OF_DECODING}
    kept |= {tag: tuple(map(len, parts)) for tag in tags}  # of the offsets: as many, for the length of the directory
    begin = _HEAD + len(_directory(kept, order))
    kept[tags[0]] = tuple(begin + sum(map(len, parts[:place])) for place in range(len(parts)))
    return b"".join((bytes(data[:4]), struct.pack(f"{order}I", _HEAD), _directory(kept, order), *parts))


def _directory(numbers: _Numbers, order: str | None) -> bytes:
    """A directory behind the head of a file, the last one of it, and the values that do not fit into its entries."""
    entries, values = b"", b""
    behind = _HEAD + 2 + ENTRY_BYTES * len(numbers) + 4
    for tag, each in sorted(numbers.items()):
        kind = _LONG if tag in (*_STRIPS, *_TILES) or max(each, default=0) >> 16 else _SHORT
        packed = struct.pack(f"{order}{len(each)}{_FORMATS[kind]}", *each)
        inline = len(packed) <= 4
        entries += struct.pack(f"{order}HHI", tag, kind, len(each))
        entries += packed.ljust(4, b"\0") if inline else struct.pack(f"{order}I", behind + len(values))
        values += b"" if inline else packed
    return struct.pack(f"{order}H", len(numbers)) + entries + bytes(4) + values


def _of_places(numbers: _Numbers, size: int) -> str:
    tags = _tags_of_parts(numbers)
    noun = "tile" if tags is _TILES else "strip"
    offsets = numbers.get(tags[0], ())
    counts = numbers.get(tags[1], (0,) * len(offsets))  # old programs leave them out: the decoder knows how many
    wanted = _parts(numbers, tiles=tags is _TILES)
    if len(offsets) < wanted or len(counts) < wanted:
        return f"it names {min(len(offsets), len(counts))} of its {wanted} {noun}s"
    for number, (offset, count) in enumerate(zip(offsets, counts, strict=False), start=1):
        if not _HEAD <= offset < size or offset + count > size:
            return f"{noun} {number} of {wanted} lies outside of the file"
    if len(set(offsets)) < len(offsets):
        return f"two of its {wanted} {noun}s are at one place"
    return ""


def _tags_of_parts(numbers: _Numbers) -> tuple[int, int]:
    return _TILES if _TILES[0] in numbers else _STRIPS


def _parts(numbers: _Numbers, *, tiles: bool) -> int:
    """Number of strips or tiles of a page."""
    width, rows = _one(numbers, _WIDTH, 1), _one(numbers, _ROWS, 1)
    planes = _one(numbers, _SAMPLES, 1) if _one(numbers, _PLANES, 1) == 2 else 1
    high = _one(numbers, _TILE_ROWS if tiles else _ROWS_PER_STRIP, rows)
    across = math.ceil(width / max(1, _one(numbers, _TILE_WIDTH, width))) if tiles else 1
    return planes * across * math.ceil(rows / max(1, high))


def _one(numbers: _Numbers, tag: int, otherwise: int) -> int:
    return next(iter(numbers.get(tag, ())), otherwise)


def _numbers(data: Data, at: int) -> _Numbers:
    """The whole numbers of a directory, by tag.

    Raises:
        struct.error: they, or it, lie outside the file.
    """
    order = byte_order(data)
    (count,) = struct.unpack_from(f"{order}H", data, at)
    found: _Numbers = {}
    for place in range(at + 2, at + 2 + ENTRY_BYTES * count, ENTRY_BYTES):
        tag, kind, many = struct.unpack_from(f"{order}HHI", data, place)
        if kind in _FORMATS:
            values = f"{order}{many}{_FORMATS[kind]}"
            inline = struct.calcsize(values) <= 4
            begin = place + 8 if inline else struct.unpack_from(f"{order}I", data, place + 8)[0]
            found[tag] = struct.unpack_from(values, data, begin)
    return found
