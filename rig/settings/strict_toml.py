"""Reads TOML files strictly: an unknown, missing or impossible key is an error that names file, key and remedy."""

import difflib
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from rig.errors import BadInputError

Model = TypeVar("Model", bound=BaseModel)


class StrictModel(BaseModel):
    """Base of models that are read from files: unknown keys are errors, instances are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def read_text(path: Path, format_name: str, existing: str) -> str:
    """Read a text file (UTF-8).

    Args:
        path: of the file.
        format_name: what the message for a binary file asks for, for instance "TOML".
        existing: what the message for a missing file asks for.

    Raises:
        BadInputError: missing, unreadable or not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise BadInputError(f"{path}: no such file; name {existing}") from None
    except IsADirectoryError:
        raise BadInputError(f"{path}: is a directory; name the file in it") from None
    except UnicodeDecodeError:
        raise BadInputError(f"{path}: is no text file; name a {format_name} file") from None
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        BadInputError: the file is missing, unreadable, not UTF-8 or not TOML; the message names line and column.
    """
    try:
        return tomllib.loads(read_text(path, "TOML", "an existing one, e.g. config/rigs/sim.toml"))
    except tomllib.TOMLDecodeError as error:
        raise BadInputError(f"{path}: not valid TOML: {error}; correct it there") from None


def validate(model: type[Model], data: dict[str, Any], source: Path | str) -> Model:
    """Make a model of `data`.

    Args:
        model: class of the model.
        data: content of the file.
        source: the file, for the error message.

    Raises:
        BadInputError: a key is wrong; the message names the first one, what to do, and how many more are wrong.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise BadInputError(f"{source}: {_word(model, errors[0])}{more}") from None


def _word(model: type[BaseModel], error: ErrorDetails) -> str:
    """One error in words: the key, what is wrong, what to do."""
    place = ".".join(str(part + 1) if isinstance(part, int) else part for part in error["loc"])
    match error["type"]:
        case "extra_forbidden":
            known = _keys_beside(model, error["loc"])
            close = difflib.get_close_matches(str(error["loc"][-1]), known, n=1)
            remedy = f'did you mean "{close[0]}"?' if close else f"known keys here: {', '.join(known)}"
            return f'unknown key "{place}"; {remedy}'
        case "missing":
            return f'key "{place}" is missing; add it'
        case "value_error":
            where = f'"{place}": ' if place else ""
            return where + str(error.get("ctx", {}).get("error", error["msg"]))
        case _:
            return f'key "{place}" = {error["input"]!r}: {error["msg"][0].lower()}{error["msg"][1:]}; correct it'


def _keys_beside(model: type[BaseModel], location: tuple[int | str, ...]) -> list[str]:
    """Known keys of the table in which the last key of `location` stands."""
    schema = model.model_json_schema()
    node: dict[str, Any] = schema
    for part in location[:-1]:
        node = node.get("items", {}) if isinstance(part, int) else node.get("properties", {}).get(part, {})
        for choice in node.get("anyOf", []):
            if "$ref" in choice:
                node = choice
        if "$ref" in node:
            node = schema["$defs"][node["$ref"].rsplit("/", 1)[1]]
    return sorted(node.get("properties", {}))
