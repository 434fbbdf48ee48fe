"""The folder of the pictures of one calibration: `FOLDER/pictures/K1/001.png`, the same number for one pulse."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from rig.api.calibrating import CalibratingOrder
from rig.errors import StorageError
from rig.settings.camera import Region

#: In the folder of the recordings.
CALIBRATIONS: Final = "calibrations"
PICTURES: Final = "pictures"
RESULT: Final = "calibration.json"
#: More pictures tell nothing new, and take minutes to adjust.
MOST: Final = 24
_NAME: Final = re.compile(r"\d{3,}\.png")


@dataclass(frozen=True, slots=True)
class PictureSet:
    """The pictures that belong together.

    Attributes:
        folder: in which they are, and what is computed from them.
        order: what was printed.
        regions: of the cameras, by name: pictures of others are of another size.
    """

    folder: Path
    order: CalibratingOrder
    regions: Mapping[str, Region]

    @property
    def pictures(self) -> Path:
        """The folder of the pictures."""
        return self.folder / PICTURES

    @property
    def layout(self) -> dict[str, float]:
        """As `analysis.targets.pattern.Layout` takes it."""
        order = self.order
        return {
            "columns": order.columns, "rows": order.rows, "board_mm": order.square_mm, "single_mm": order.target_mm,
        }  # fmt: skip


def new_folder(directory: Path) -> Path:
    """Make the folder of another calibration in the folder of the recordings.

    Raises:
        StorageError: the disk refuses.
    """
    name = f"{datetime.now(UTC):%Y%m%d-%H%M%S}"
    folder, number = directory / CALIBRATIONS / name, 1
    while folder.exists():
        number += 1
        folder = folder.with_name(f"{name}-{number}")
    try:
        (folder / PICTURES).mkdir(parents=True)
    except OSError as error:
        raise StorageError(f"{folder}: cannot be made ({error.strerror}); look at the disk") from error
    return folder


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
