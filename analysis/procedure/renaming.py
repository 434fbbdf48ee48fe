"""Writes the files of a result anew that name the jumper, when his name was corrected; nothing is measured again."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.measurements.file import read_measurements
from analysis.report.coach import write_report
from analysis.report.kinogram.earlier import NAME as KINOGRAM
from analysis.report.kinogram.earlier import EarlierJump
from analysis.report.kinogram.folder import write_kinograms
from analysis.result import file as result_file
from analysis.result.model import Quantity
from analysis.result.naming import CAMERAS
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.network.file import network_from_json
from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Image, ImageFrame, ImageObservations, Network
from photogrammetry.network.strict_text import read_json
from rig.errors import StorageError

_REPORT: Final = "report.html"
_POSE: Final = 6


def write_renamed(
    folder: Path,
    log: Path,
    out: Path,
    corrected: Mapping[str, str],
    *,
    earlier: Sequence[EarlierJump],
) -> None:
    """Write the files that say whose jump it is (`analysis.result.naming.bears_names`), with the corrected session.

    Args:
        folder: of the result.
        log: that was measured.
        out: folder to write to, made if it does not exist.
        corrected: fields of the session that are others now.
        earlier: other measured jumps of the athlete, for the marks of the kinogram.

    Raises:
        BadInputError: a file of the result, or the log cannot be read; an older svev has no `CAMERAS`.
        StorageError: the disk refuses.
    """
    result = result_file.read(folder)
    result = replace(result, session={**result.session, **corrected})
    measurements, system = read_measurements(folder / "measurements.json"), read_cameras(folder / CAMERAS)
    across = _perpendicular(folder / KINOGRAM)
    try:
        out.mkdir(parents=True, exist_ok=True)
        content = read_json(folder / result_file.NAME, "result") | {"session": dict(result.session)}
        result_file.write_json(content, out / result_file.NAME)
        write_kinograms(result, measurements, system, log, out, perpendicular=across, earlier=earlier)
    except OSError as error:
        raise StorageError(f"{out}: cannot be written ({error.strerror}); make room") from error
    write_report(result, measurements, system, log, out / _REPORT, perpendicular=across)


def write_cameras(system: CameraSystem, path: Path) -> None:
    """Write oriented cameras, interior orientation and pose, as a `svev-network/1` file without points.

    Raises:
        OSError: the disk refuses.
    """
    placed = list(system.cameras.values())
    images = tuple(Image(each.name, i, each.position, each.rotation, estimate=False) for i, each in enumerate(placed))
    cameras = tuple(replace(each.camera, estimate=(), sigma={}) for each in placed)
    none = np.zeros(0, np.intp)
    nothing = ImageObservations(none, none, np.zeros((0, 2)), np.zeros((0, 2)), none)
    write_network(Network(cameras, images, (), nothing, length_unit="m", image_frame=ImageFrame.PIXEL), path)


def read_cameras(path: Path) -> CameraSystem:
    """The cameras of such a file; how uncertain they are it does not say.

    Raises:
        BadInputError: it is missing, or holds something else.
    """
    network = network_from_json(read_json(path, "file of cameras"), str(path))
    placed: dict[str, PlacedCamera] = {}
    for image in network.images:
        camera = network.cameras[image.camera]
        columns = np.arange(_POSE) + _POSE * len(placed)
        position, rotation = np.asarray(image.position, float), np.asarray(image.rotation, float)
        placed[camera.name] = PlacedCamera(camera, position, rotation, np.zeros(0, np.intp), columns)
    return CameraSystem(placed, np.zeros((_POSE * len(placed),) * 2))


def _perpendicular(kinogram: Path) -> dict[int, Quantity]:
    """By number of the jump its velocity perpendicular to the table, which stands in the kinogram only."""
    if not kinogram.exists():  # no jump has a pulse
        return {}
    found: dict[int, Any] = {
        jump["number"]: jump["figures"]["perpendicular"] for jump in json.loads(kinogram.read_bytes())["jumps"]
    }
    return {number: Quantity(each["value"], each["sigma"]) for number, each in found.items() if each is not None}
