"""The rig file of a merged log: that of the first log, with the cameras of the second added."""

import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any, Final

_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")


def joined_rig_toml(first: bytes, second: bytes) -> bytes:
    """The text of the first rig file, with the `[[cameras]]` of the second.

    Where that makes no TOML, e.g. because one of them is none, the text of the first alone.
    """
    try:
        tomllib.loads(first.decode())
        cameras = tomllib.loads(second.decode()).get("cameras", [])
        blocks = ["\n".join(["[[cameras]]", *_lines(camera)]) for camera in cameras if isinstance(camera, dict)]
        joined = "\n\n".join([first.decode().rstrip(), "# cameras of the log that this one was merged with", *blocks])
        tomllib.loads(joined)
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, TypeError):
        return first
    return f"{joined}\n".encode()


def _lines(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {_value(value)}" for key, value in table.items()]


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else json.dumps(key)


def _value(value: Any) -> str:
    """A value as TOML: JSON says numbers, truths and strings in the same way.

    Raises:
        TypeError: it is a date, which no rig file has.
    """
    if isinstance(value, Mapping):
        return "{ " + ", ".join(_lines(value)) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    return json.dumps(value)
