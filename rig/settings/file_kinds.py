"""Says what a file is that is given in place of another one, by its keys: files that people write name no format."""

from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

from rig.errors import BadInputError


class FileKind(StrEnum):
    """Files that people write, in words."""

    RIG = "a rig file"
    SCENARIO = "a scenario of the simulated hill"
    PLAN = "a plan"
    FOREIGN = "a calibration of another program"


_REMEDIES = {
    FileKind.RIG: "name another file",
    FileKind.SCENARIO: "a rig file names it, under [simulation]",
    FileKind.PLAN: "svev plan {path} --simulate NETWORK.json makes a network of it",
    FileKind.FOREIGN: "svev network import {path} balls.csv -o survey.json makes a survey of it and the balls",
}


def kind_of(data: Mapping[str, Any]) -> FileKind | None:
    """What a file is by its keys; None: that cannot be told."""
    cameras = data.get("cameras")
    first = cameras[0] if isinstance(cameras, list) and cameras else None
    keys = set(first) if isinstance(first, Mapping) else set()
    if "backend" in keys:
        return FileKind.RIG
    if "images" in keys:
        return FileKind.PLAN
    if "base" in data or {"X0", "look_at"} & keys:
        return FileKind.SCENARIO
    if any(isinstance(each, Mapping) and {"matrix", "distortions"} <= set(each) for each in data.values()):
        return FileKind.FOREIGN
    return None


def refuse_other(data: Mapping[str, Any], wanted: FileKind | str, path: Path | str) -> None:
    """Refuse a file that is another one of those that people write.

    Args:
        data: content of the file.
        wanted: what it should be, in words.
        path: of the file, for messages.

    Raises:
        BadInputError: it is another one.
    """
    kind = None if "format" in data else kind_of(data)
    if kind is not None and kind != wanted:
        raise BadInputError(f"{path}: is {kind}, and {wanted} is wanted; {_REMEDIES[kind].format(path=path)}")
