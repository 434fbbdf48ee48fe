"""The text of a rig file as a document in which single keys are changed; comments, order and all else stay."""

from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from rig.errors import BadInputError


def editable(text: str) -> tomlkit.TOMLDocument:
    """The document of a rig file's text.

    Raises:
        BadInputError: the text is not TOML.
    """
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise BadInputError(f"the rig file is not valid TOML any more: {error}; correct it there") from None


def camera_table(document: tomlkit.TOMLDocument, name: str) -> dict[str, Any]:
    """The table of a camera in the document of a rig file; what is changed in it is changed in the document.

    Raises:
        BadInputError: there is no such camera.
    """
    cameras = document.get("cameras", [])
    camera = next((each for each in cameras if each.get("name") == name), None) if isinstance(cameras, list) else None
    if not isinstance(camera, dict):
        raise BadInputError(f"the rig file has no camera {name} any more: start the service again")
    return camera


def as_toml(value: float) -> float:
    """A number as people write it: whole ones without a point."""
    return int(value) if float(value).is_integer() else value
