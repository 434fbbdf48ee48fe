"""Encodes our own types as JSON, decodes and checks them, and makes their JSON schemas.

For logs, ZeroMQ, and messages between our processes. Values of `rig.clocks.DecimalNs` are strings of decimal digits,
because JavaScript would round numbers.
"""

import os
from pathlib import Path
from typing import Any, Final

import msgspec
from pydantic import BaseModel

from rig.clocks import DecimalNs

#: Under this key stand the bytes of a path that is no UTF-8.
_BYTES: Final = "path_bytes"
_DECIMAL: Final = {"type": "string", "pattern": "^-?[0-9]+$"}
_DIGITS_MAX: Final = 20  #: of a 64-bit number


def _to_plain(value: object) -> object:
    """Convert a value that msgspec cannot encode into one that it can."""
    if isinstance(value, DecimalNs):
        return str(value)
    if isinstance(value, Path):
        return _path_to_plain(value)
    if isinstance(value, BaseModel):
        return value.model_dump(mode="json", exclude_unset=True)
    raise NotImplementedError(f"{type(value).__name__} has no form in JSON")


def _path_to_plain(path: Path) -> str | dict[str, str]:
    """A path as its text; one that is no UTF-8, which JSON cannot hold, as its bytes in hexadecimal."""
    name = os.fsencode(path)
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return {_BYTES: name.hex()}


def _path_from_plain(value: Any) -> Path:
    if isinstance(value, dict) and isinstance(value.get(_BYTES), str):
        return Path(os.fsdecode(bytes.fromhex(value[_BYTES])))
    return Path(value)


def _from_plain(kind: type, value: Any) -> object:
    """The inverse of `_to_plain`."""
    if issubclass(kind, DecimalNs):
        digits = value.removeprefix("-") if isinstance(value, str) else ""
        if not (digits.isascii() and digits.isdigit() and len(digits) <= _DIGITS_MAX):
            raise ValueError("a time must be a string of at most 20 decimal digits")
        return kind(value)
    if issubclass(kind, Path):
        return _path_from_plain(value)
    if issubclass(kind, BaseModel):
        return kind.model_validate(value)
    raise NotImplementedError(f"{kind.__name__} has no form in JSON")


_ENCODER: Final = msgspec.json.Encoder(enc_hook=_to_plain)


def encode(value: object) -> bytes:
    """A value as JSON in UTF-8."""
    return _ENCODER.encode(value)


def to_builtins(value: object) -> Any:
    """A value converted to the types of JSON: dictionaries, lists, strings and numbers."""
    return msgspec.json.decode(encode(value))


def decoder(kind: Any) -> msgspec.json.Decoder[Any]:
    """A decoder for one type, or for a union of tagged types; it raises msgspec.MsgspecError for anything else."""
    return msgspec.json.Decoder(kind, dec_hook=_from_plain)


def schema(kind: type[msgspec.Struct], title: str) -> dict[str, object]:
    """The JSON schema of a type, without references: each is replaced by the definition that it refers to."""
    whole = msgspec.json.schema(kind, schema_hook=lambda _: _DECIMAL)
    definitions = whole.pop("$defs")

    def resolved(part: Any) -> Any:
        if isinstance(part, list):
            return [resolved(each) for each in part]
        if not isinstance(part, dict):
            return part
        if "$ref" in part:
            more = {key: value for key, value in part.items() if key != "$ref"}
            return resolved(definitions[part["$ref"].rsplit("/", 1)[1]] | more)
        found = {key: resolved(value) for key, value in part.items() if key not in {"title", "default"}}
        if "properties" in found:  # a field with a default value is written all the same
            written = (key for key, field in part["properties"].items() if "default" in field)
            found["required"] = [*found.get("required", []), *written]
        return found

    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": title, **resolved(whole)}
