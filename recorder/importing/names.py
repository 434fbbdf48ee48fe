"""Which film is which camera: names given, those of a rig file, or those of the files."""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings

_PATTERN: Final = next(
    each.pattern for each in CameraSettings.model_fields["name"].metadata if hasattr(each, "pattern")
)
#: A log has at most so many cameras.
_CAMERAS_MAX: Final = 8


def named(sources: Sequence[str], rig: RigSettings | None) -> list[tuple[str, Path]]:
    """The name of the camera and the place of each film, from left to right.

    Args:
        sources: paths, or `NAME=PATH`; a path that is there is never taken for a name and a path.
        rig: gives the names in the order of its cameras, where sources give none.

    Raises:
        BadInputError: there is no such file, a name is none for a camera, stands twice or is not in the rig, or there
            are too many films.
    """
    if not 1 <= len(sources) <= _CAMERAS_MAX:
        raise BadInputError(
            f"{len(sources)} films: a log takes 1 to {_CAMERAS_MAX} cameras; name so many folders or videos"
        )
    found = [_split(source) for source in sources]
    for _, path in found:
        if not path.exists():
            raise BadInputError(f"{path}: no such folder or video; correct the name")
    names = _in_order_of(rig, found) if rig is not None else [given or _from_path(path) for given, path in found]
    for name in names:
        if names.count(name) > 1:
            raise BadInputError(f"two films have the camera name {name}: give each its own, as {name}={found[0][1]}")
    return list(zip(names, (path for _, path in found), strict=True))


def _split(source: str) -> tuple[str, Path]:
    name, equals, path = source.partition("=")
    if not equals or Path(source).exists():
        return "", Path(source)
    if not re.fullmatch(_PATTERN, name):
        raise BadInputError(
            f'"{name}" of {source} is no name for a camera: begin with a letter, then letters, digits, _ and -, at '
            "most 16 together"
        )
    return name, Path(path)


def _in_order_of(rig: RigSettings, found: Sequence[tuple[str, Path]]) -> list[str]:
    """The names of the rig's cameras, as many as there are films, in the rig's order.

    Raises:
        BadInputError: there are more or fewer films, or they are named otherwise, or in another order.
    """
    cameras = [camera.name for camera in rig.cameras]
    if len(cameras) != len(found):
        raise BadInputError(
            f"the rig file has the cameras {', '.join(cameras)}, and {len(found)} films are given: give one for each, "
            "from left to right"
        )
    for (given, path), camera in zip(found, cameras, strict=True):
        if given and given != camera:
            raise BadInputError(
                f"{path} is named {given}, and at its place the rig file has {camera}: give the films in the order of "
                f"the rig file, {', '.join(cameras)}"
            )
    return cameras


def _from_path(path: Path) -> str:
    """A camera's name from that of a file or folder.

    Raises:
        BadInputError: nothing of it can be one.
    """
    own = path.resolve().name if path.is_dir() else path.stem
    name = re.sub(r"[^A-Za-z0-9_-]+", "_", own).strip("_-")
    name = name if name[:1].isalpha() else f"K{name}"
    name = name[:16]
    if not re.fullmatch(_PATTERN, name):
        raise BadInputError(f"{path}: its name makes no camera's name; give one, as K1={path}")
    return name
