"""The folder of the pictures of one calibration: `FOLDER/pictures/K1/001.png`, the same number for one pulse."""

import re
from pathlib import Path
from typing import Final

#: In the folder of the recordings.
CALIBRATIONS: Final = "calibrations"
PICTURES: Final = "pictures"
RESULT: Final = "calibration.json"
#: More pictures tell nothing new, and take minutes to adjust.
MOST: Final = 24
_NAME: Final = re.compile(r"\d{3,}\.png")


def picture_path(pictures: Path, camera: str, number: int) -> Path:
    """Where a picture of a camera is kept."""
    return pictures / camera / f"{number:03d}.png"


def kept_pictures(pictures: Path) -> list[Path]:
    """All pictures that are kept, in the order in which they were taken."""
    found = [path for path in pictures.glob("*/*.png") if _NAME.fullmatch(path.name)]
    return sorted(found, key=lambda path: (_number(path), path.parent.name))


def numbers(pictures: Path) -> list[int]:
    """The numbers of the pulses of which pictures are kept."""
    return sorted({_number(path) for path in kept_pictures(pictures)})


def next_number(pictures: Path) -> int:
    """The number of the next pulse of which pictures are kept."""
    return max(numbers(pictures), default=0) + 1


def remove_last(pictures: Path) -> bool:
    """Remove the pictures that were taken last, of all cameras; False: there are none.

    Raises:
        OSError: the disk refuses.
    """
    taken = numbers(pictures)
    for path in kept_pictures(pictures):
        if _number(path) == taken[-1]:
            path.unlink()
    return bool(taken)


def _number(path: Path) -> int:
    return int(path.stem)
