"""Reads one object from a JSON or TOML file, strictly; every error names the file and the remedy."""

import json
from pathlib import Path
from typing import Any, Final

from rig.errors import BadInputError
from rig.host.files import TEXT_MAX
from rig.settings.strict_toml import read_text, read_toml

_DIGITS: Final = 30  # of a whole number, at most


def read_object(path: Path, kind: str = "network file") -> dict[str, Any]:
    """Read one object: TOML from a file that is called so, else JSON.

    Args:
        path: of the file.
        kind: what the file should be, for messages.

    Raises:
        BadInputError: missing, unreadable, or no object of its format.
    """
    if path.suffix.lower() == ".toml":
        return read_toml(path, kind=kind, most_bytes=TEXT_MAX)
    return read_json(path, kind)


def read_json(path: Path, kind: str = "network file") -> dict[str, Any]:
    """Read one JSON object, strictly: no key twice, no NaN or Infinity.

    Args:
        path: of the file.
        kind: what the file should be, for messages.

    Raises:
        BadInputError: missing, unreadable, not UTF-8, not JSON, not an object.
    """
    text = read_text(path, "JSON", f"an existing {kind}")
    if not text.strip():
        raise BadInputError(f"{path}: is empty; name an existing {kind}")
    try:
        data = json.loads(
            text,
            object_pairs_hook=_no_key_twice,
            parse_constant=_no_constant,
            parse_int=_whole_number,
        )
        json.dumps(data, ensure_ascii=False).encode("utf-8")  # refuses escapes of half a surrogate pair
    except UnicodeEncodeError as error:
        raise BadInputError(f"{path}: half a character ({error.object[error.start]!r}); write it whole") from None
    except (json.JSONDecodeError, RecursionError) as error:
        raise BadInputError(f"{path}: not valid JSON: {error}; correct it there") from None
    except _RefusedError as error:
        raise BadInputError(f"{path}: {error}") from None
    if not isinstance(data, dict):
        raise BadInputError(f"{path}: is no JSON object; a {kind} starts with {{")
    return data


class _RefusedError(Exception):
    """Valid JSON that a network file must not contain."""


def _no_key_twice(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    if len(table) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise _RefusedError(f'key "{twice}" stands twice in one object; remove or rename one')
    return table


def _no_constant(text: str) -> float:
    raise _RefusedError(f"{text} is no number; write a finite one or null")


def _whole_number(text: str) -> int:
    if len(text) > _DIGITS:
        raise _RefusedError(f"{text[:_DIGITS]}... has too many digits; write it as a decimal number")
    return int(text)
