"""Reads cameras, poses and points of a network file or a result as one network."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.calibration_file import read_calibration
from photogrammetry.network.file import network_from_json
from photogrammetry.network.model import Network
from photogrammetry.network.strict_text import read_object
from photogrammetry.reports.result_file import FORMAT


def read_oriented(path: Path) -> Network:
    """The cameras, poses and points of a network file or a result (`svev-adjustment/1`).

    Raises:
        BadInputError: neither, or a result that is not to be used.
    """
    data = read_object(path)
    if data.get("format") != FORMAT:
        return network_from_json(data, str(path))
    cameras = {
        name: {
            **{parameter: getattr(each, parameter) for parameter in (*INTERIOR, "r0", "distortion")},
            **({} if each.size is None else {"size": each.size}),
        }
        for name, each in read_calibration(path).items()
    }
    images = {name: _only(each, ("camera", "X0", "R")) for name, each in _table(data, "images").items()}
    points = {name: {"role": "tie", **_only(each, ("X",))} for name, each in _table(data, "points").items()}
    network = {
        "format": "svev-network/1",
        "length_unit": data.get("length_unit") or "unit",
        "image_frame": data.get("image_frame", "pixel"),
        "cameras": cameras,
        "images": images,
        "points": points,
        "observations": [],
        "datum": {"type": "control"},
    }
    return network_from_json(network, str(path))


def _table(data: Mapping[str, Any], key: str) -> dict[str, Any]:
    found = data.get(key)
    return found if isinstance(found, dict) else {}


def _only(entry: Any, keys: tuple[str, ...]) -> dict[str, Any]:
    return {key: entry[key] for key in keys if key in entry} if isinstance(entry, dict) else {}
