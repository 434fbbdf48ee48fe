"""Reads TOML files strictly: an unknown, missing or impossible key is an error that names file, key and remedy."""

import codecs
import difflib
import errno
import reprlib
import tomllib
import unicodedata
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic_core import ErrorDetails

from rig.errors import BadInputError
from rig.host.files import TEXT_MAX, UntrustedFileError, read_whole

Model = TypeVar("Model", bound=BaseModel)

_RIG_FILE: Final = "rig file"
_MOST_BYTES: Final = 1_000_000
_DEEPEST: Final = 20
_LONGEST_TEXT: Final = 4096  # as long as a path may be
#: Categories of characters that are not seen, or change how others are seen: controls, formats, half characters, ends.
_UNSEEN: Final = frozenset({"Cc", "Cf", "Cs", "Zl", "Zp"})
_LAYOUT: Final = frozenset("\n\t")
_SHORT: Final = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxlong = _SHORT.maxother = 60
_SHORT.maxlevel = 2


class StrictModel(BaseModel):
    """Base of models that are read from files: unknown keys are errors, instances are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


def read_text(path: Path, format_name: str, existing: str, most_bytes: int = TEXT_MAX) -> str:
    """Read a text file (UTF-8, with or without the mark of byte order that programs on Windows put before it).

    Args:
        path: of the file.
        format_name: what the message for a binary file asks for, for instance "TOML".
        existing: what the message for a missing file asks for.
        most_bytes: a larger file is refused.

    Raises:
        BadInputError: missing, unreadable, too large, no regular file or not UTF-8.
    """
    data = read_bytes(path, format_name, existing, most_bytes)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise BadInputError(f"{path}: is text in UTF-16; save it as UTF-8") from None
        raise BadInputError(f"{path}: is no text file in UTF-8; save it so, or name a {format_name} file") from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def read_bytes(path: Path, format_name: str, existing: str, most_bytes: int = TEXT_MAX) -> bytes:
    """Read a file whole.

    Args:
        path: of the file.
        format_name: what the message for another kind of file asks for, for instance "TOML".
        existing: what the message for a missing file asks for.
        most_bytes: a larger file is refused.

    Raises:
        BadInputError: missing, unreadable, too large or no regular file.
    """
    try:
        return read_whole(path, most_bytes, links=True)
    except FileNotFoundError:
        raise BadInputError(f"{path}: no such file; name {existing}") from None
    except UntrustedFileError as error:
        if error.errno == errno.EISDIR:
            raise BadInputError(f"{path}: is a directory; name the file in it") from None
        if error.errno == errno.EFBIG:
            text = f"{path}: {error.strerror}, which no {format_name} file of svev is; name another file"
            raise BadInputError(text) from None
        raise BadInputError(f"{path}: {error.strerror}; name a {format_name} file") from None
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None


def read_toml(path: Path, *, kind: str = _RIG_FILE, most_bytes: int = _MOST_BYTES) -> dict[str, Any]:
    """Read a TOML file.

    Args:
        path: of the file.
        kind: what the file should be, for messages.
        most_bytes: a larger file is refused.

    Raises:
        BadInputError: the file is missing, unreadable, not UTF-8, too large or not TOML, and then the message names
            line and column; or a text in it is too long or holds a character that cannot be seen.
    """
    existing = "an existing one, e.g. config/rigs/sim.toml" if kind == _RIG_FILE else f"an existing {kind}"
    text = read_text(path, "TOML", existing, most_bytes)
    if text.lstrip().startswith("{"):
        raise BadInputError(f"{path}: is JSON, and a {kind} is TOML; name another file")
    try:
        data = tomllib.loads(text)
    except RecursionError:
        raise BadInputError(f"{path}: not valid TOML: nested too deeply; correct it there") from None
    except ValueError as error:  # TOMLDecodeError, or a number with too many digits
        raise BadInputError(f"{path}: not valid TOML: {error}; correct it there") from None
    _check_texts(data, path)
    return data


def _check_texts(data: dict[str, Any], source: Path) -> None:
    """Refuse texts and keys that are too long, or would do something to a terminal or a path instead of being read.

    Raises:
        BadInputError: there is one; the message names its key.
    """
    left: list[tuple[str, Any]] = [("", data)]
    while left:
        place, value = left.pop()
        if isinstance(value, dict | list):
            parts = value.items() if isinstance(value, dict) else enumerate(value, start=1)
            if place.count(".") > _DEEPEST:
                raise BadInputError(f"{source}: not valid TOML: nested too deeply; correct it there")
            for key, each in parts:
                name = f"{place}.{key}".lstrip(".")
                left += [(name, each), (name, str(key))]
        elif isinstance(value, str) and len(value) > _LONGEST_TEXT:
            raise BadInputError(f'{source}: key "{_shown(place)[1:-1]}" has {len(value)} characters; shorten it')
        elif isinstance(value, str) and (unseen := next(filter(_cannot_be_seen, value), None)) is not None:
            raise BadInputError(
                f'{source}: key "{_shown(place)[1:-1]}" holds the character {unseen!r}, which cannot be seen; remove it'
            )


def _cannot_be_seen(character: str) -> bool:
    return unicodedata.category(character) in _UNSEEN and character not in _LAYOUT


@dataclass(frozen=True, slots=True)
class Fault:
    """One thing that is wrong in a file.

    Attributes:
        place: keys that lead to it, from the outermost one.
        words: the key, what is wrong, what to do.
    """

    place: tuple[int | str, ...]
    words: str


def examine(model: type[Model], data: dict[str, Any]) -> tuple[Model | None, tuple[Fault, ...]]:
    """Make a model of `data`, or say everything that is wrong.

    Args:
        model: class of the model.
        data: content of the file.

    Returns:
        The model, None if something is wrong; and what is wrong.
    """
    try:
        return model.model_validate(data), ()
    except ValidationError as error:
        errors = _misspelt_first(error.errors(include_url=False))
        return None, tuple(Fault(each["loc"], _word(model, each)) for each in errors)


def _misspelt_first(errors: list[ErrorDetails]) -> list[ErrorDetails]:
    """The errors, those first that are one mistake: a required key that is missing since it is written otherwise.

    Its absence is told by the unknown key alone, with the right spelling.
    """
    missing = {each["loc"] for each in errors if each["type"] == "missing"}
    first: list[ErrorDetails] = []
    told: set[tuple[int | str, ...]] = set()
    for each in errors:
        if each["type"] != "extra_forbidden":
            continue
        *table, key = each["loc"]
        lacking = [str(loc[-1]) for loc in missing - told if loc[:-1] == tuple(table)]
        if close := difflib.get_close_matches(str(key), lacking, n=1):
            first.append(each)
            told.add((*table, close[0]))
    return [*first, *(each for each in errors if each not in first and each["loc"] not in told)]


def validate(model: type[Model], data: dict[str, Any], source: Path | str) -> Model:
    """Make a model of `data`.

    Args:
        model: class of the model.
        data: content of the file.
        source: the file, for the error message.

    Raises:
        BadInputError: a key is wrong; the message names the first one, what to do, and how many more are wrong.
    """
    made, faults = examine(model, data)
    if made is None:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise BadInputError(f"{source}: {faults[0].words}{more}")
    return made


def _word(model: type[BaseModel], error: ErrorDetails) -> str:
    """One error in words: the key, what is wrong, what to do."""
    parts, known = _walk(model, error["loc"])
    place = ".".join(parts)
    match error["type"]:
        case "extra_forbidden":
            close = difflib.get_close_matches(str(error["loc"][-1]), known, n=1)
            remedy = f'did you mean "{close[0]}"?' if close else f"known keys here: {', '.join(known)}"
            return f'unknown key "{place}"; {remedy}'
        case "union_tag_invalid":
            key, there = error["ctx"]["discriminator"].strip("'"), error["ctx"]["expected_tags"].replace("'", '"')
            return f'key "{place}.{key}" = {_shown(error["ctx"]["tag"])}: there is {there}; correct it'
        case "missing":
            return f'key "{place}" is missing; add it'
        case "value_error":
            where = f'"{place}": ' if place else ""
            return where + str(error.get("ctx", {}).get("error", error["msg"]))
        case "too_long" | "too_short" as kind:
            there = error["ctx"]["actual_length"]
            most = kind == "too_long"
            wanted = f"{error['ctx']['max_length' if most else 'min_length']} {'at most' if most else 'at least'}"
            numbers = isinstance(error["input"], list) and all(isinstance(each, int | float) for each in error["input"])
            remedy = "correct it, decimals are written with a point" if most and numbers else "correct it"
            return f'key "{place}" = {_shown(error["input"])}: {there} values, {wanted}; {remedy}'
        case _:
            what = f"{error['msg'][0].lower()}{error['msg'][1:]}"
            return f'key "{place}" = {_shown(error["input"])}: {what}; correct it'


def _shown(value: object) -> str:
    """A wrong value in an error message, cut where it is long."""
    try:
        return _SHORT.repr(value)
    except ValueError:  # Python writes no integers of more than 4300 digits
        return "a number of many digits"


def _value_of(node: dict[str, Any], key: str) -> Any:
    """Schema of the value of a key in a table with fixed or with free keys."""
    return node.get("properties", {}).get(key, node.get("additionalProperties"))


def _walk(model: type[BaseModel], location: tuple[int | str, ...]) -> tuple[list[str], list[str]]:
    """Follow the location of an error through the model's schema.

    Returns:
        The keys as they stand in the file, items counted from 1, and the known keys of the table in which the last one
        stands. Where a key of a table decides about its others, pydantic puts the key's value into the location; it is
        left out here.
    """
    schema = _schema(model)
    node: dict[str, Any] = schema
    beside = node
    shown: list[str] = []
    for part in location:
        kinds = node.get("discriminator", {}).get("mapping", {})
        if part in kinds:
            node = beside = _referred(schema, {"$ref": kinds[part]})
            continue
        shown.append(str(part + 1) if isinstance(part, int) else part)
        beside = node
        inside = node.get("items") if isinstance(part, int) else _value_of(node, part)
        node = _referred(schema, inside if isinstance(inside, dict) else {})
    return shown, sorted(beside.get("properties", {}))


@cache
def _schema(model: type[BaseModel]) -> dict[str, Any]:
    """The schema of a model; not to be changed."""
    return model.model_json_schema()


def _referred(schema: dict[str, Any], node: dict[str, Any]) -> dict[str, Any]:
    """The definition to which a node of a schema refers, or the node itself."""
    for choice in node.get("anyOf", []):
        if "$ref" in choice:
            node = choice
    return schema["$defs"][node["$ref"].rsplit("/", 1)[1]] if "$ref" in node else node
