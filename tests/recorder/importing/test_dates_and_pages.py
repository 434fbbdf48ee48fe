"""When pictures were taken is told, and never taken for a rate; a TIFF file of pages is a film."""

import struct
from pathlib import Path

import cv2
import numpy as np
import pytest

from recorder.importing.films import ImportOrder
from recorder.importing.image_folder import ImageFolder
from recorder.importing.run import Import
from recorder.importing.tiff_pages import TiffPages
from recorder.importing.tiff_tags import taken_at
from rig.errors import BadInputError
from rig.frame import FrameStatus
from tests.recorder.importing.films import SIZE, picture, write_folder

AT = b"2009:02:14 12:30:00\0"


def _exif(order: str, *, offset: bytes = b"", parts: bytes = b"") -> bytes:
    """A block of EXIF: a directory that points to another one, whose texts stand after it."""
    entries = [(0x9003, AT), *((0x9291, parts) for _ in parts[:1]), *((0x9011, offset) for _ in offset[:1])]
    head = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(f"{order}I", 8)
    first = struct.pack(f"{order}HHHIII", 1, 0x8769, 4, 1, 26, 0)
    texts = 26 + 2 + 12 * len(entries) + 4
    body = struct.pack(f"{order}H", len(entries))
    tail = b""
    for tag, text in entries:
        inline = text.ljust(4, b"\0") if len(text) <= 4 else struct.pack(f"{order}I", texts + len(tail))
        body += struct.pack(f"{order}HHI", tag, 2, len(text)) + inline
        tail += text if len(text) > 4 else b""
    return head + first + body + b"\0\0\0\0" + tail


def _jpeg(path: Path, number: int, exif: bytes) -> None:
    done, data = cv2.imencodeWithMetadata(
        ".jpg", picture(number), [cv2.IMAGE_METADATA_EXIF], [np.frombuffer(exif, np.uint8)]
    )
    assert done
    path.write_bytes(data.tobytes())


@pytest.mark.parametrize("order", ["<", ">"])
def test_the_time_of_a_picture_is_read(order: str, tmp_path: Path) -> None:
    block = _exif(order, parts=b"25\0", offset=b"+01:00\0")
    _jpeg(tmp_path / "1.jpg", 1, block)
    moment = taken_at((tmp_path / "1.jpg").read_bytes())
    assert moment is not None
    assert moment.isoformat() == "2009-02-14T12:30:00.250000+01:00"
    for end in range(len(block)):  # cut anywhere, it is read or not, and nothing breaks
        taken_at(block[:end])


def test_pictures_of_an_unknown_time_zone_say_when_and_give_no_date(tmp_path: Path) -> None:
    folder = tmp_path / "K1"
    folder.mkdir()
    for number in range(3):
        _jpeg(folder / f"{number}.jpg", number, _exif("<"))
    film = ImageFolder(folder)
    assert film.date is None
    (said,) = film.remarks
    assert said.startswith("its first picture says that it was taken 2009-02-14 12:30:00, its last one 2009-02-14")
    assert said.endswith("in a time zone that it does not say: the log's date stays unknown; give --date")
    report = Import(ImportOrder([("K1", folder)], 50.0, tmp_path / "old.mcap")).run()
    assert report.fields["rate_hz"] == "50.0"
    assert report.fields["date"].startswith("unknown")
    assert any("says that it was taken 2009-02-14 12:30:00" in finding for finding in report.findings)


def test_pictures_that_know_their_time_zone_date_the_log(tmp_path: Path) -> None:
    folder = tmp_path / "K1"
    folder.mkdir()
    for number in range(3):
        _jpeg(folder / f"{number}.jpg", number, _exif(">", offset=b"+01:00\0"))
    report = Import(ImportOrder([("K1", folder)], 50.0, tmp_path / "old.mcap")).run()
    assert report.fields["date"] == "2009-02-14 11:30:00 UTC by K1"


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
def test_pages_of_a_tiff_file_are_frames(kind: type, tmp_path: Path) -> None:
    pages = [picture(number, kind=kind) for number in range(1, 36)]
    cv2.imwritemulti(str(tmp_path / "K1.tif"), pages)
    film = TiffPages(tmp_path / "K1.tif")
    assert (film.expected, film.size, film.bits) == (35, SIZE, 8 * np.dtype(kind).itemsize)
    taken = list(film.frames(3))
    assert [each.number for each in taken] == list(range(3, 36))
    assert all(np.array_equal(each.pixels, pages[each.number - 1]) for each in taken if each.pixels is not None)
    with pytest.raises(BadInputError, match="has no frame 36: its pages are frames 1 to 35"):
        next(film.frames(36))
    report = Import(ImportOrder([("K1", tmp_path / "K1.tif")], 50.0, tmp_path / "old.mcap")).run()
    assert report.ledger.pulses == 35


def test_a_page_that_cannot_be_read_is_damaged_and_another_size_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "K1.tif"
    cv2.imwritemulti(str(path), [picture(number) for number in range(3)])
    data = bytearray(path.read_bytes())
    (directory,) = struct.unpack_from("<I", data, 4)
    for place in range(struct.unpack_from("<H", data, directory)[0]):
        at = directory + 2 + 12 * place
        if struct.unpack_from("<H", data, at)[0] == 258:  # so many bits no grey value has
            struct.pack_into("<I", data, at + 8, 7)
    path.write_bytes(data)
    statuses = [each.status for each in TiffPages(path).frames(1)]
    assert statuses == [FrameStatus.DAMAGED, FrameStatus.OK, FrameStatus.OK]
    cv2.imwritemulti(str(path), [picture(number) for number in range(5)])
    path.write_bytes(path.read_bytes()[:-5000])
    film = TiffPages(path)
    assert film.remarks == ("breaks off after page 3",)
    assert [each.status for each in film.frames(1)] == [FrameStatus.OK] * 3
    cv2.imwritemulti(str(path), [picture(1), picture(2, (32, 48))])
    with pytest.raises(BadInputError, match="page 2 is 32 x 48 px of 8 bits, those before it are 64 x 48 px of 8"):
        list(TiffPages(path).frames(1))


def test_a_folder_of_files_with_several_pages_is_refused(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "K1", [1], "{}.png")
    cv2.imwritemulti(str(folder / "2.tif"), [picture(2), picture(3)])
    with pytest.raises(BadInputError, match=r"2\.tif: holds 2 pages: name the file itself as the film"):
        list(ImageFolder(folder).frames(1))
