"""A TIFF file with several pages, one for each frame of a camera."""

import mmap
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from recorder.importing.grey import decoded
from recorder.importing.picture_dates import PictureDates
from recorder.importing.source import Taken, single_gaps
from recorder.importing.tiff_damage import damage
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
        pages = [self._page(place) for place in range(min(2, self.expected))]
        sample = next((page for page in pages if not isinstance(page, str)), None)
        if sample is None:
            why = f" (page 1: {pages[0]})" if pages else ""
            raise BadInputError(f"{path}: cannot be read as a TIFF file{why}; copy it again, or write it again")
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
        return single_gaps(self._taken(number) for number in range(first, self.expected + 1))

    def _taken(self, number: int) -> Taken:
        page = self._page(number - 1)
        if isinstance(page, str):
            return Taken(number, None, FrameStatus.DAMAGED, f"{self.path}: page {number} cannot be read: {page}")
        self._check(number, page)
        return Taken(number, page)

    def _page(self, place: int) -> Stored | str:
        """A page, or why it cannot be read.

        The decoder reads the page that the head of the file names first: in our copy of the head that is this one.

        Raises:
            BadInputError: its pixels are of a kind that logs do not hold.
        """
        if found := damage(memoryview(self._file), self._offsets[place]):
            return found
        self._file[4:8] = struct.pack(f"{byte_order(memoryview(self._file))}I", self._offsets[place])
        try:
            page = decoded(np.frombuffer(self._file, np.uint8))
        except ValueError as error:
            raise BadInputError(f"{self.path}: {error}; write the pages with 8 or 16 bits") from None
        return "OpenCV does not understand it" if page is None else page

    def _check(self, number: int, page: Stored) -> None:
        rows, columns = page.shape
        if (columns, rows) != self.size or 8 * page.itemsize != self.bits:
            raise BadInputError(
                f"{self.path}: page {number} is {columns} x {rows} px of {8 * page.itemsize} bits, those before it "
                f"are {self.size[0]} x {self.size[1]} px of {self.bits}: a camera's images have one size; write them "
                "into files of their own"
            )
