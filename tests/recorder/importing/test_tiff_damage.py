"""A TIFF page that OpenCV reads wrongly without a word is damaged, and it is said what is wrong with it."""

import struct
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from recorder.importing.image_folder import ImageFolder
from recorder.importing.tiff_pages import TiffPages
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from tests.recorder.importing.films import SIZE, picture, write_folder

LZW, DEFLATE, PACK_BITS = 5, 8, 32773
STRIPS = 3


def _written(pages: list[Stored], compression: int) -> bytearray:
    how = [cv2.IMWRITE_TIFF_COMPRESSION, compression, cv2.IMWRITE_TIFF_ROWSPERSTRIP, SIZE[1] // STRIPS]
    done, data = cv2.imencodemulti(".tif", pages, how)
    assert done
    return bytearray(data.tobytes())


def _strips(data: bytearray) -> tuple[tuple[int, ...], tuple[int, ...], dict[int, int]]:
    """Places and byte counts of the strips of the first page, and where its tags stand."""
    (directory,) = struct.unpack_from("<I", data, 4)
    (count,) = struct.unpack_from("<H", data, directory)
    tags = {struct.unpack_from("<H", data, at)[0]: at for at in range(directory + 2, directory + 2 + 12 * count, 12)}
    places, counts = (_numbers(data, tags[tag]) for tag in (273, 279))
    return places, counts, tags


def _numbers(data: bytearray, at: int) -> tuple[int, ...]:
    _, kind, many = struct.unpack_from("<HHI", data, at)
    values = f"<{many}{'H' if kind == 3 else 'I'}"
    begin = at + 8 if struct.calcsize(values) <= 4 else struct.unpack_from("<I", data, at + 8)[0]
    return struct.unpack_from(values, data, begin)


def _smooth(number: int) -> Stored:
    rows, columns = np.mgrid[: SIZE[1], : SIZE[0]]
    return np.asarray((3 * columns + 5 * rows + number) % 251, np.uint8)


@pytest.mark.parametrize("compression", [LZW, DEFLATE])
def test_a_compressed_page_with_wrong_bytes_is_damaged(compression: int, tmp_path: Path) -> None:
    data = _written([_smooth(number) for number in range(3)], compression)
    places, counts, _ = _strips(data)
    middle = places[1] + counts[1] // 2
    data[middle : middle + 16] = bytes(16)
    read = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert read is not None
    assert not np.array_equal(read, _smooth(0))  # the decoder itself says nothing
    path = tmp_path / "K1.tif"
    path.write_bytes(data)
    taken = list(TiffPages(path).frames(1))
    assert [each.status for each in taken] == [FrameStatus.DAMAGED, FrameStatus.OK, FrameStatus.OK]
    assert taken[0].why == f"{path}: page 1 cannot be read: its compressed pixels are damaged"
    for each in taken[1:]:
        assert each.pixels is not None
        assert np.array_equal(each.pixels, _smooth(each.number - 1))


@pytest.mark.parametrize("compression", [1, LZW, DEFLATE, PACK_BITS])
@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_whole_pages_of_every_compression_are_read(compression: int, kind: type, tmp_path: Path) -> None:
    pages = [picture(number, kind=kind) for number in range(3)]
    (tmp_path / "K1.tif").write_bytes(_written(pages, compression))
    taken = list(TiffPages(tmp_path / "K1.tif").frames(1))
    for each, page in zip(taken, pages, strict=True):
        assert each.pixels is not None
        assert np.array_equal(each.pixels, page)


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize(
    ("offset", "says"),
    [
        (0, "strip 2 of 3 lies outside of the file"),
        (4, "strip 2 of 3 lies outside of the file"),
        (1 << 30, "strip 2 of 3 lies outside of the file"),
        (None, "two of its 3 strips are at one place"),
    ],
)
def test_a_strip_that_is_not_where_the_file_says_is_damage(
    offset: int | None, says: str, kind: type, tmp_path: Path
) -> None:
    data = _written([picture(number, kind=kind) for number in range(2)], 1)
    places, _, tags = _strips(data)
    (array,) = struct.unpack_from("<I", data, tags[273] + 8)
    struct.pack_into("<I", data, array + 4, places[0] if offset is None else offset)
    path = tmp_path / "K1.tif"
    path.write_bytes(data)
    first, second = TiffPages(path).frames(1)
    assert (first.status, first.why) == (FrameStatus.DAMAGED, f"{path}: page 1 cannot be read: {says}")
    assert second.status is FrameStatus.OK


def test_a_page_with_too_few_strips_is_damaged(tmp_path: Path) -> None:
    data = _written([picture(1, kind=np.uint16)], 1)
    _, _, tags = _strips(data)
    for tag in (273, 279):
        struct.pack_into("<I", data, tags[tag] + 4, 2)
    (tmp_path / "K1.tif").write_bytes(data)
    with pytest.raises(BadInputError, match=r"as a TIFF file \(page 1: it names 2 of its 3 strips\); copy it again"):
        TiffPages(tmp_path / "K1.tif")


def test_a_file_that_breaks_off_in_its_pixels_is_named(tmp_path: Path) -> None:
    """Programs that write the directory first leave such files when the disk is full."""
    folder = write_folder(tmp_path / "K1", [1, 3], "{}.tif")
    entries = [(256, 4, 64), (257, 4, 48), (258, 3, 8), (259, 3, 1), (262, 3, 1), (273, 4, 200), (278, 4, 48)]
    entries.append((279, 4, 64 * 48))
    directory = struct.pack("<H", len(entries)) + b"".join(
        struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in entries
    )
    data = (b"II*\0" + struct.pack("<I", 8) + directory + bytes(4)).ljust(200, b"\0") + picture(2).tobytes()
    (folder / "2.tif").write_bytes(data)
    assert [each.status for each in ImageFolder(folder).frames(1)] == [FrameStatus.OK] * 3
    (folder / "2.tif").write_bytes(data[:-100])
    taken = list(ImageFolder(folder).frames(1))
    assert [each.status for each in taken] == [FrameStatus.OK, FrameStatus.DAMAGED, FrameStatus.OK]
    assert taken[1].why == f"{folder / '2.tif'} cannot be read as an image: strip 1 of 1 lies outside of the file"


def test_any_cut_and_any_bytes_are_refused_or_read(tmp_path: Path) -> None:
    whole = _written([_smooth(number) for number in range(2)], LZW)
    draw = np.random.default_rng(5)
    path = tmp_path / "K1.tif"
    for _ in range(150):
        data = bytearray(whole)
        begin = int(draw.integers(0, len(data)))
        data[begin : begin + 8] = draw.bytes(min(8, len(data) - begin))
        path.write_bytes(data[: int(draw.integers(0, len(data)))] if draw.random() < 0.3 else data)
        with suppress(BadInputError):
            list(TiffPages(path).frames(1))
