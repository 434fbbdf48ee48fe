"""A TIFF file with several pages, one for each frame of a camera."""

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from recorder.importing.grey import grey
from recorder.importing.picture_dates import PictureDates
from recorder.importing.source import Taken
from recorder.importing.tiff_tags import byte_order, page_offsets
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.host.files import open_to_read
from rig.images.pixels import Stored

#: Endings of TIFF files.
ENDINGS: Final = (".tif", ".tiff")
#: The decoder counts bytes with 31 bits.
_MOST_BYTES: Final = (1 << 31) - 1


class TiffPages:
    """The pages of a TIFF file, which count from 1. The file is mapped into memory, not read as a whole.

    Args:
        path: the file.

    Raises:
        BadInputError: it cannot be read, or neither of its first two pages can.
    """

    first = 1

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with open_to_read(path, links=True) as file:
                self._file = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_COPY)
        except (OSError, ValueError) as error:  # ValueError: it is empty
            why = error.strerror if isinstance(error, OSError) else "it is empty"
            raise BadInputError(f"{path}: cannot be read ({why}); check the file and its permissions") from error
        if len(self._file) > _MOST_BYTES:
            raise BadInputError(f"{path}: is larger than 2 GiB: write its pages as files of their own")
        self._offsets, whole = page_offsets(memoryview(self._file))
        first_pages = (self._page(place) for place in range(min(2, len(self._offsets))))
        sample = next((page for page in first_pages if page is not None), None)
        if sample is None:
            raise BadInputError(f"{path}: cannot be read as a TIFF file; copy it again, or write it again")
        self.size = (int(sample.shape[1]), int(sample.shape[0]))
        self.bits = 8 * sample.itemsize
        self.kind = f"TIFF file of {self.expected} pages"
        dates = PictureDates(path, path)
        self.date: UtcNs | None = dates.begin
        cut = () if whole else (f"breaks off after page {self.expected}",)
        self.remarks = cut + dates.remarks

    @property
    def expected(self) -> int:
        """Number of pages."""
        return len(self._offsets)

    def frames(self, first: int) -> Iterator[Taken]:
        """Read the pages, from the page `first` on.

        Raises:
            BadInputError: there is no such page, pages differ in size or bits, or two in a row cannot be read.
        """
        if not 1 <= first <= self.expected:
            raise BadInputError(
                f"{self.path}: has no frame {first}: its pages are frames 1 to {self.expected}; correct --start"
            )
        unreadable = False
        for number in range(first, self.expected + 1):
            page = self._page(number - 1)
            if page is not None:
                self._check(number, page)
                yield Taken(number, page)
            elif unreadable:
                raise BadInputError(
                    f"{self.path}: pages {number - 1} and {number} cannot be read, one after the other; write it again"
                )
            else:
                yield Taken(number, None, FrameStatus.DAMAGED, f"page {number} of {self.path} cannot be read")
            unreadable = page is None

    def _page(self, place: int) -> Stored | None:
        """A page; None if it cannot be read.

        The decoder reads the page that the head of the file names first: in our copy of the head that is this one.

        Raises:
            BadInputError: its pixels are of a kind that logs do not hold.
        """
        self._file[4:8] = struct.pack(f"{byte_order(memoryview(self._file))}I", self._offsets[place])
        try:
            page = cv2.imdecode(np.frombuffer(self._file, np.uint8), cv2.IMREAD_UNCHANGED)
        except cv2.error:
            return None
        if page is None:
            return None
        try:
            return grey(page)
        except ValueError as error:
            raise BadInputError(f"{self.path}: {error}; write the pages with 8 or 16 bits") from None

    def _check(self, number: int, page: Stored) -> None:
        rows, columns = page.shape
        if (columns, rows) != self.size or 8 * page.itemsize != self.bits:
            raise BadInputError(
                f"{self.path}: page {number} is {columns} x {rows} px of {8 * page.itemsize} bits, those before it "
                f"are {self.size[0]} x {self.size[1]} px of {self.bits}: a camera's images have one size; write them "
                "into files of their own"
            )
