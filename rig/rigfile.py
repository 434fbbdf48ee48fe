"""Reads a rig file; every error names file, key and remedy."""

import difflib
import json
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from rig.errors import BadInputError
from rig.settings import RigSettings

Model = TypeVar("Model", bound=BaseModel)

#: Rig files and scenarios that travel with the program, in the checkout and in the installed package alike.
CONFIG = Path(__file__).resolve().parent.parent / "config"


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises:
        BadInputError: missing, unreadable, not UTF-8 or not TOML; the message names line and column.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise BadInputError(f"{path}: no such file; name an existing one, e.g. config/rigs/sim.toml") from None
    except IsADirectoryError:
        raise BadInputError(f"{path}: is a directory; name the file in it") from None
    except UnicodeDecodeError:
        raise BadInputError(f"{path}: is no text file; name a TOML file") from None
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
    except tomllib.TOMLDecodeError as error:
        raise BadInputError(f"{path}: not valid TOML: {error}; correct it there") from None


def validate(model: type[Model], data: dict[str, Any], source: Path | str) -> Model:
    """Check `data` against `model`; `source` is named in the message.

    Raises:
        BadInputError: one line with the first wrong key and what to do, and how many more there are.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        errors = error.errors(include_url=False)
        more = f" (and {len(errors) - 1} more)" if len(errors) > 1 else ""
        raise BadInputError(f"{source}: {_word(model, errors[0])}{more}") from None


def load_rig(path: Path) -> RigSettings:
    """Read and check a rig file; a scenario path in it is made absolute.

    Raises:
        BadInputError: the file is missing, broken or says something that is no rig.
    """
    rig = validate(RigSettings, read_toml(path), path)
    if rig.simulation is None:
        return rig
    scenario = (path.parent / rig.simulation.scenario).resolve()
    return rig.model_copy(update={"simulation": rig.simulation.model_copy(update={"scenario": scenario})})


def rig_schema() -> str:
    """JSON schema of the rig file."""
    return json.dumps(RigSettings.model_json_schema(), indent=2) + "\n"


def _word(model: type[BaseModel], error: ErrorDetails) -> str:
    """One finding in words: key, what is wrong, what to do."""
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
    """Known keys of the table that the last key of `location` stands in."""
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
