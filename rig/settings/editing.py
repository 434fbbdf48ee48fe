"""The text of a rig file as a document in which single keys are changed; comments, order and all else stay."""

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


def as_toml(value: float) -> float:
    """A number as people write it: whole ones without a point."""
    return int(value) if float(value).is_integer() else value
