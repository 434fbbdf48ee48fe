"""Writes `svev-network/1` files."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.file import REWEIGHT
from photogrammetry.network.model import AXES, Camera, Image, ImageFrame, Network, Point
from rig.arrays import Floats

_DIGITS = 12  # of pixel coordinates: hides the rounding errors of the change of frames, 1e-13 px


def write_network(network: Network, path: Path) -> None:
    """Write a network file, in the network's image frame; each camera, image, point and observation on its own line."""
    path.write_text(laid_out(network_to_json(network)), encoding="utf-8")


def laid_out(data: Mapping[str, Any]) -> str:
    """A JSON object as text: the entries of its lists and tables each on a line, for people who read or edit it."""
    return "{\n" + ",\n".join(f"  {json.dumps(key)}: {_entries(value)}" for key, value in data.items()) + "\n}\n"


def _entries(value: Any) -> str:
    """One value of the file's object; lists and tables of entries have several lines."""
    if isinstance(value, dict) and value and all(isinstance(entry, dict) for entry in value.values()):
        lines = [f"    {json.dumps(name)}: {json.dumps(entry)}" for name, entry in value.items()]
        return "{\n" + ",\n".join(lines) + "\n  }"
    if isinstance(value, list) and value:
        return "[\n" + ",\n".join(f"    {json.dumps(entry)}" for entry in value) + "\n  ]"
    return json.dumps(value)


def metric_to_pixel(xy: Floats, size: Floats) -> Floats:
    """Metric frame to pixel frame, the inverse of `photogrammetry.network.file.pixel_to_metric`."""
    return xy * (1.0, -1.0) + (np.asarray(size) - 1.0) / 2.0


def network_to_json(network: Network) -> dict[str, Any]:
    """The file's object, in the network's image frame."""
    names = [point.name for point in network.points]
    reweight = {value: key for key, value in REWEIGHT.items()}[network.reweight]
    datum: dict[str, Any] = {"type": network.datum.type.value}
    if network.datum.points is not None:
        datum["points"] = [names[i] for i in network.datum.points]
    return {
        "format": "svev-network/1",
        "length_unit": network.length_unit,
        **({} if network.ball_radius_m is None else {"ball_radius_m": network.ball_radius_m}),
        "image_frame": network.image_frame.value,
        "sigma0": network.sigma0,
        "cameras": {camera.name: _camera_to_json(camera) for camera in network.cameras},
        "images": {image.name: _image_to_json(image, network) for image in network.images},
        "points": {point.name: _point_to_json(point) for point in network.points},
        "observations": _observations_to_json(network),
        "distances": [
            {"from": names[d.start], "to": names[d.end], "value": d.value, "sigma": d.sigma} for d in network.distances
        ],
        "differences": [
            {"from": names[d.start], "to": names[d.end], "axis": AXES[d.axis], "value": d.value, "sigma": d.sigma}
            for d in network.differences
        ],
        "datum": datum,
        **({} if reweight is False else {"reweight": reweight}),
    }


def _camera_to_json(camera: Camera) -> dict[str, Any]:
    return {
        **({} if camera.size is None else {"size": list(camera.size)}),
        **dict(zip(INTERIOR, camera.interior.tolist(), strict=True)),
        "r0": camera.balance,
        "distortion": camera.distortion.value,
        "estimate": list(camera.estimate),
        **({"sigma": dict(camera.sigma)} if camera.sigma else {}),
    }


def _image_to_json(image: Image, network: Network) -> dict[str, Any]:
    sigma = {"X0": image.sigma_position, "angles": image.sigma_angles}
    given = {key: value.tolist() for key, value in sigma.items() if value is not None}
    return {
        "camera": network.cameras[image.camera].name,
        "X0": None if image.position is None else image.position.tolist(),
        "R": None if image.rotation is None else image.rotation.tolist(),
        "estimate": image.estimate,
        **({"sigma": given} if given else {}),
    }


def _point_to_json(point: Point) -> dict[str, Any]:
    return {
        "role": point.role.value,
        "X": None if point.xyz is None else point.xyz.tolist(),
        **({} if point.sigma is None else {"sigma": point.sigma.tolist()}),
    }


def _observations_to_json(network: Network) -> list[list[Any]]:
    observed = network.observations
    xy = observed.xy
    if network.image_frame is ImageFrame.PIXEL and len(xy):
        sizes = [network.cameras[network.images[i].camera].size for i in observed.image]
        xy = np.round(metric_to_pixel(xy, np.array(sizes, dtype=float)), _DIGITS)
    rows: list[list[Any]] = []
    for i in range(len(xy)):
        sigma = observed.sigma[i].tolist()
        group = observed.groups[observed.group[i]]
        row = [network.images[observed.image[i]].name, network.points[observed.point[i]].name, *xy[i].tolist()]
        row += sigma[:1] if sigma[0] == sigma[1] else sigma
        rows.append(row if group == "image" else [*row, group])
    return rows
