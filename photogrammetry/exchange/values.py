"""Reads YAML or JSON as tables, lists, numbers, truth values and text; no key twice, nothing guessed.

A number is one in YAML only as programs write it: `0317` is the number 317, `1_000`, `.nan` and what stands in quotes
are text. OpenCV's first line (`%YAML:1.0`) is none of YAML's, and its tags (`!!opencv-matrix`) say nothing more.
"""

from pathlib import Path
from typing import Any, Final

import yaml

from photogrammetry.exchange.part import is_written_number
from photogrammetry.network.strict_text import read_json
from rig.errors import BadInputError
from rig.settings.strict_toml import read_text

_OPENCV_HEAD: Final = "%YAML:"
_WORDS: Final = {"true": True, "false": False}


def read_values(path: Path, kind: str) -> dict[str, Any]:
    """Read the table that a YAML or JSON file (by its ending) holds.

    Args:
        path: of the file.
        kind: what the file should be, for messages.

    Raises:
        BadInputError: missing, unreadable, not of its format, no table, or a key twice.
    """
    if path.suffix.lower() == ".json":
        return read_json(path, kind)
    text = read_text(path, "YAML", f"an existing {kind}")
    try:
        node = yaml.compose(text.partition("\n")[2] if text.startswith(_OPENCV_HEAD) else text, Loader=yaml.BaseLoader)
        value = None if node is None else _value(node, path, set())
    except yaml.MarkedYAMLError as error:
        line = "" if error.problem_mark is None else f" in line {error.problem_mark.line + 1}"
        raise BadInputError(f"{path}: not valid YAML: {error.problem}{line}; correct it there") from None
    except (yaml.YAMLError, RecursionError) as error:
        what = str(error).replace("\n", " ")
        raise BadInputError(f"{path}: not valid YAML: {what}; correct it there") from None
    if not isinstance(value, dict):
        raise BadInputError(f"{path}: is no table of keys; name a {kind}")
    return value


def _value(node: yaml.Node, path: Path, seen: set[int]) -> Any:
    """What a node of YAML holds.

    Raises:
        BadInputError: a key stands twice, or a node refers to another.
    """
    place = f"{path}: line {node.start_mark.line + 1}"
    if id(node) in seen:
        raise BadInputError(f"{place}: refers to another place (*); write its value here")
    seen.add(id(node))
    if isinstance(node, yaml.SequenceNode):
        return [_value(each, path, seen) for each in node.value]
    if isinstance(node, yaml.MappingNode):
        table: dict[str, Any] = {}
        for key_node, value_node in node.value:
            key = str(key_node.value)
            if key in table:
                raise BadInputError(
                    f'{path}: line {key_node.start_mark.line + 1}: key "{key}" stands twice; remove one'
                )
            table[key] = _value(value_node, path, seen)
        return table
    word = str(node.value)
    if node.style is not None:  # in quotes
        return word
    return float(word) if is_written_number(word) else _WORDS.get(word.lower(), word)
