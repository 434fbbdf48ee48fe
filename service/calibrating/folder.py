"""The folder of one calibration: `pictures/K1/001.png` (one number for one pulse), and `set.json`: what they show."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from pydantic import TypeAdapter, ValidationError

from rig.api.calibrating import CalibratingOrder
from rig.errors import StorageError
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.phrase import phrase
from rig.settings.camera import Region

#: In the folder of the recordings.
CALIBRATIONS: Final = "calibrations"
PICTURES: Final = "pictures"
RESULT: Final = "calibration.json"
_SET: Final = "set.json"
#: More pictures tell nothing new, and take minutes to adjust.
MOST_PICTURES: Final = 24
_NAME: Final = re.compile(r"\d{3,}\.png")


#: What `set.json` holds: what was printed, and the regions of the cameras.
_PRINTED: Final = TypeAdapter(tuple[CalibratingOrder, dict[str, Region]])


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


def new_set(directory: Path, order: CalibratingOrder, regions: Mapping[str, Region]) -> PictureSet:
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
        replace_file(folder / _SET, _PRINTED.dump_json((order, dict(regions)), indent=2), links=False)
    except OSError as error:
        raise StorageError(
            phrase(
                "calibrating_no_folder",
                "{folder}: cannot be made ({why}); look at the disk",
                folder=str(folder),
                why=str(error.strerror),
            )
        ) from error
    return PictureSet(folder, order, regions)


def last_set(directory: Path, in_use: Path | None) -> PictureSet | None:
    """The pictures that were begun last, by this service or one before it; None: there are none that go on.

    Args:
        directory: folder of the recordings.
        in_use: the calibration that the rig file names: no picture is added to those that it comes of.
    """
    last = max((directory / CALIBRATIONS).glob(f"*/{_SET}"), default=None)
    if last is None or (in_use is not None and in_use.resolve().parent == last.resolve().parent):
        return None
    try:
        order, regions = _PRINTED.validate_json(read_whole(last, TEXT_MAX, links=False))
    except (OSError, ValidationError):  # nobody knows what these pictures are of: another set is begun
        return None
    return PictureSet(last.parent, order, regions)


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
