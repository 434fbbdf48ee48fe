"""Reads YAML, JSON or OpenCV's XML as tables, lists, numbers, truth values and text; no key twice, nothing guessed.

A number is one in YAML only as programs write it: `0317` is the number 317, `1_000`, `.nan` and what stands in quotes
are text. OpenCV's first line (`%YAML:1.0`) is none of YAML's, and its tags (`!!opencv-matrix`) say nothing more.
In its XML an element is a key, elements called `_` are a list, and words between blanks are one too.
"""

import re
from pathlib import Path
from typing import Any, Final
from xml.etree import ElementTree as ET

import yaml

from photogrammetry.exchange.part import is_written_number
from photogrammetry.network.strict_text import read_json
from rig.errors import BadInputError
from rig.settings.strict_toml import read_text

_OPENCV_HEAD: Final = "%YAML:"
_WORDS: Final = {"true": True, "false": False}
_XML_ROOT: Final = "opencv_storage"
_XML_ITEM: Final = "_"
_XML_WORDS: Final = re.compile(r'"[^"]*"|\S+')


def read_values(path: Path, kind: str) -> dict[str, Any]:
    """Read the table that a YAML, JSON or XML file (by its ending) holds.

    Args:
        path: of the file.
        kind: what the file should be, for messages.

    Raises:
        BadInputError: missing, unreadable, not of its format, no table, or a key twice.
    """
    if path.suffix.lower() == ".json":
        return read_json(path, kind)
    if path.suffix.lower() == ".xml":
        return _read_xml(path, kind)
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
    return word if node.style is not None else _bare(word)  # a style: in quotes


def _bare(word: str) -> float | bool | str:
    """What a word without quotes says."""
    return float(word) if is_written_number(word) else _WORDS.get(word.lower(), word)


def _read_xml(path: Path, kind: str) -> dict[str, Any]:
    text = read_text(path, "XML", f"an existing {kind}")
    if "<!DOCTYPE" in text:  # its entities may be endless
        raise BadInputError(f"{path}: has a document type, which OpenCV writes none of; remove <!DOCTYPE ...>")
    try:
        root = ET.fromstring(text)  # noqa: S314 - without a document type there is nothing to attack with
        value = _xml_value(root, path)
    except (ET.ParseError, RecursionError) as error:
        raise BadInputError(f"{path}: not valid XML: {error}; correct it there") from None
    if root.tag != _XML_ROOT or not isinstance(value, dict):
        raise BadInputError(f"{path}: is no table of keys in <{_XML_ROOT}>; name a {kind}")
    return value


def _xml_value(element: ET.Element, path: Path) -> Any:
    """What an element of OpenCV's XML holds.

    Raises:
        BadInputError: a key stands twice, or text beside elements.
    """
    inside = list(element)
    if not inside:
        words = [each[1:-1] if each[0] == '"' else _bare(each) for each in _XML_WORDS.findall(element.text or "")]
        return words[0] if len(words) == 1 else words
    if any((text or "").strip() for text in (element.text, *(each.tail for each in inside))):
        raise BadInputError(f"{path}: text beside other elements in <{element.tag}>; correct it there")
    if all(each.tag == _XML_ITEM for each in inside):
        return [_xml_value(each, path) for each in inside]
    table: dict[str, Any] = {}
    for each in inside:
        if each.tag in table:
            raise BadInputError(f'{path}: key "{each.tag}" stands twice; remove one')
        table[each.tag] = _xml_value(each, path)
    return table
