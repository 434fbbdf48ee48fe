"""A folder of images, one for each frame of a camera."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from recorder.importing.grey import decoded
from recorder.importing.picture_dates import PictureDates
from recorder.importing.source import Taken, single_gaps
from recorder.importing.tiff_damage import damage
from recorder.importing.tiff_pages import ENDINGS as TIFF_ENDINGS
from recorder.importing.tiff_tags import page_offsets
from rig.clocks import UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.host.files import read_whole
from rig.images.pixels import Stored

#: Endings of the image files that are read.
ENDINGS: Final = (".png", *TIFF_ENDINGS, ".jpg", ".jpeg", ".bmp")
_MOST_BYTES: Final = 1 << 30
_DIGITS: Final = re.compile(r"(\d+)")


class ImageFolder:
    """The images of a folder, in the order of the numbers in their names; those in folders inside it do not count.

    Where one number of the names counts, it is that of the frame, and a number left out is a lost frame. Otherwise
    frames count from 1.

    Args:
        path: the folder.

    Raises:
        BadInputError: it holds no images, cannot be read, or two images have one number.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            names = sorted((each.name for each in path.iterdir() if _is_image(each)), key=_natural)
        except OSError as error:
            raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from error
        if not names:
            raise BadInputError(f"{path}: holds no images ({', '.join(ENDINGS)}); name a folder of images, or a video")
        numbers, step = _frame_numbers(path, names)
        self._names = dict(zip(numbers, names, strict=True))
        self._numbers = range(numbers[0], numbers[-1] + 1, step)
        first_ones = [_read(path / name) for name in names[:2]]
        whole = next((picture for picture in first_ones if not isinstance(picture, str)), None)
        if whole is None:
            raise BadInputError(f"{path / names[0]} {first_ones[0]}; remove it, or write it again")
        self.size = (int(whole.shape[1]), int(whole.shape[0]))
        self.bits = 8 * whole.itemsize
        endings = Counter(Path(name).suffix.lower().lstrip(".") for name in names)
        self.kind = "folder of " + ", ".join(f"{count} {ending}" for ending, count in endings.items())
        self.first = numbers[0]
        lost = len(self._numbers) - len(names)
        dates = PictureDates(path / names[0], path / names[-1])
        self.date: UtcNs | None = dates.begin
        left_out = (f"numbers left out among its file names: {lost}; these frames are lost",) if lost else ()
        self.remarks = left_out + dates.remarks

    @property
    def expected(self) -> int:
        """Number of frames, those included that are lost."""
        return len(self._numbers)

    def frames(self, first: int) -> Iterator[Taken]:
        """Read the images, from the frame `first` on.

        Raises:
            BadInputError: there is no such frame, images differ in size or bits, or two in a row cannot be read.
        """
        if first not in self._numbers:
            raise BadInputError(
                f"{self.path}: has no frame {first}: its frames are {self._numbers[0]} to {self._numbers[-1]}"
                f"{f' in steps of {self._numbers.step}' if self._numbers.step > 1 else ''}; correct --start"
            )
        return single_gaps(self._taken(number) for number in self._numbers[self._numbers.index(first) :])

    def _taken(self, number: int) -> Taken:
        name = self._names.get(number)
        if name is None:
            return Taken(number, None, FrameStatus.LOST, f"no image in {self.path} has number {number}")
        picture = _read(self.path / name)
        if isinstance(picture, str):
            return Taken(number, None, FrameStatus.DAMAGED, f"{self.path / name} {picture}")
        self._check(name, picture)
        return Taken(number, picture)

    def _check(self, name: str, picture: Stored) -> None:
        rows, columns = picture.shape
        width, height = self.size
        if (columns, rows) != self.size:
            raise BadInputError(
                f"{self.path / name}: is {columns} x {rows} px, the images before it are {width} x {height}: a "
                "camera's images have one size; sort them into folders"
            )
        if 8 * picture.itemsize != self.bits:
            raise BadInputError(
                f"{self.path / name}: has {8 * picture.itemsize} bits, the images before it have {self.bits}: sort "
                "them into folders"
            )


def _is_image(path: Path) -> bool:
    return path.suffix.lower() in ENDINGS and not path.name.startswith(".") and path.is_file()


def _natural(name: str) -> tuple[list[str | int], str]:
    """Key by which names are sorted as people count: `2.png` before `10.png`."""
    parts: list[str | int] = [
        int(part) if place % 2 else part.casefold() for place, part in enumerate(_DIGITS.split(name))
    ]
    return parts, name


def _frame_numbers(path: Path, names: Sequence[str]) -> tuple[list[int], int]:
    """The numbers of the frames, rising, and the usual step between them.

    Raises:
        BadInputError: two images have one number.
    """
    in_order = list(range(1, len(names) + 1))
    parts = [_DIGITS.split(Path(name).stem) for name in names]
    if len({tuple(part[::2]) for part in parts}) > 1 or len(names) == 1:
        return in_order, 1
    columns = list(zip(*(map(int, part[1::2]) for part in parts), strict=True))
    varying = [column for column in columns if len(set(column)) > 1]
    if len(varying) > 1:
        return _counter(varying) or (in_order, 1)
    numbers = list(varying[0]) if varying else [columns[0][0]] * len(names) if columns else []
    for one, two, earlier, later in zip(numbers, numbers[1:], names, names[1:], strict=False):
        if one == two:
            raise BadInputError(f"{path}: {earlier} and {later} have the same number: leave one of them there")
    if not numbers:
        return in_order, 1
    # Names that count something else, e.g. milliseconds, tell nothing of frames that are left out.
    return (numbers, step) if (step := _step(numbers)) else (in_order, 1)


def _counter(columns: Sequence[Sequence[int]]) -> tuple[list[int], int] | None:
    """The numbers that count the frames beside others that change too, such as the time; None: none does, or several.

    Returns:
        The numbers and the usual step between them.
    """
    found = {}
    for numbers in columns:
        if step := _step(numbers):
            found[tuple((each - numbers[0]) // step for each in numbers)] = list(numbers), step
    return next(iter(found.values())) if len(found) == 1 else None


def _step(numbers: Sequence[int]) -> int:
    """The usual step between numbers that count frames, some of which may be left out; 0: they do not."""
    steps = Counter(later - earlier for earlier, later in pairwise(numbers))
    step = min(steps)
    if step <= 0:
        return 0
    regular = 2 * steps[step] >= len(numbers) - 1 and all(each % step == 0 for each in steps)
    few = (numbers[-1] - numbers[0]) // step < 2 * len(numbers)
    return step if regular and few else 0


def _read(path: Path) -> Stored | str:
    """An image without its colours, or why it cannot be read.

    Raises:
        BadInputError: the disk does not give it, or its pixels are of a kind that logs do not hold.
    """
    try:
        data = read_whole(path, _MOST_BYTES, links=True)
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions and the disk") from error
    pages, _ = page_offsets(data)
    if len(pages) > 1:
        raise BadInputError(
            f"{path}: holds {len(pages)} pages: name the file itself as the film, or write each page as a file"
        )
    if pages and (found := damage(data, pages[0])):
        return f"cannot be read as an image: {found}"
    try:
        picture = decoded(np.frombuffer(data, np.uint8))
    except ValueError as error:
        raise BadInputError(f"{path}: {error}; write the images with 8 or 16 bits") from None
    return "cannot be read as an image" if picture is None else picture
