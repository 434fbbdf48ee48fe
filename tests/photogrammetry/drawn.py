"""Reads numbers back from drawings, by the ticks of a chart or the scale bar of a drawing to scale."""

import re
from collections.abc import Callable
from xml.etree import ElementTree as ET

import numpy as np

from rig.arrays import Floats

SVG = "{http://www.w3.org/2000/svg}"


def parsed(svg: str) -> ET.Element:
    """The drawing as a tree; fails if it is not well-formed."""
    assert "nan" not in svg
    return ET.fromstring(svg)  # noqa: S314 - our own drawing


def chart_scales(tree: ET.Element) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """Page to value, along x and y, from the ticks that a reader sees."""
    texts = [
        (t.text or "", t.attrib["text-anchor"], float(t.attrib["x"]), float(t.attrib["y"]))
        for t in tree.iter(f"{SVG}text")
    ]
    across = [(x, _value(words)) for words, anchor, x, _ in texts if anchor == "middle" and _is_number(words)]
    up = [(y - 3.5, _value(words)) for words, anchor, _, y in texts if anchor == "end" and _is_number(words)]
    return _line(across), _line(up)


def bar(tree: ET.Element) -> tuple[float, str]:
    """How much one unit of the page is by the scale bar, and the bar's unit."""
    line = next(e for e in tree.iter(f"{SVG}line") if e.attrib["stroke-width"] == "2")
    words = next(t.text or "" for t in tree.iter(f"{SVG}text") if t.attrib["text-anchor"] == "end")
    length, unit = words.split(" ", 1)
    return float(length) / (float(line.attrib["x2"]) - float(line.attrib["x1"])), unit


def polyline(element: ET.Element) -> Floats:
    """Places (n, 2) on the page."""
    return np.array([[float(v) for v in pair.split(",")] for pair in element.attrib["points"].split()])


def _is_number(words: str) -> bool:
    return re.fullmatch(r"[−\d.e-]+", words) is not None  # noqa: RUF001 - a minus sign as printed


def _value(words: str) -> float:
    return float(words.replace("\N{MINUS SIGN}", "-"))


def _line(pairs: list[tuple[float, float]]) -> Callable[[float], float]:
    if not pairs:  # names stand there
        return lambda _: np.nan
    page, value = np.array(pairs).T
    slope, offset = np.polyfit(page, value, 1)
    return lambda place: float(slope * place + offset)
