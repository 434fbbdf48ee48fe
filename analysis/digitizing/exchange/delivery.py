"""Hands an operator's marks to other programs and takes them back: measurements, tables, folders of digitizers."""

import tempfile
from pathlib import Path
from typing import Final

import numpy as np

from analysis.digitizing.desk import Desk
from analysis.digitizing.exchange.formats import exported, imported
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import LINES
from analysis.digitizing.programs.clicked_balls import clicked_network
from analysis.measurements.file import read_measurements, write_measurements
from analysis.measurements.model import Source
from photogrammetry.network.file_writer import laid_out, network_to_json
from rig.api.digitizing import Changed, MarkSource, MarkState
from rig.errors import BadInputError, StateForbidsError
from rig.phrase import phrase

MEASUREMENTS: Final = "measurements.json"
NETWORK: Final = "network.json"
_SOURCES: Final = {Source.BY_HAND: MarkSource.HAND, Source.AUTOMATIC: MarkSource.AUTOMATIC}


def delivered(desk: Desk, operator: str, name: str) -> bytes:
    """A file of an operator's marks.

    Args:
        desk: of the log.
        operator: whose marks.
        name: `measurements.json`, `network.json`, `marks.csv`, `dltdv.zip` or `argus.zip`.

    Raises:
        BadInputError: the marks do not go into such a file.
        StateForbidsError: a network is asked for, and the log has no survey.
    """
    if name == MEASUREMENTS:
        return _measurements(desk, operator)
    marks, system = desk.session(operator).everything(), desk.programs.orienting.system
    if name == NETWORK:
        survey = desk.programs.orienting.survey
        if survey is None:
            text = "a network holds the cameras and points of a survey: name it with --survey"
            raise StateForbidsError(phrase("hand_no_survey", text))
        return laid_out(network_to_json(clicked_network(_sizes(desk), survey, marks))).encode()
    return exported(name, marks, _sizes(desk), _range(desk), system)


def taken_in(desk: Desk, operator: str, name: str, content: bytes) -> Changed:
    """Take marks of a file beside those of an operator, in whose place they come; one undo takes all back.

    Args:
        desk: of the log.
        operator: whose marks they become.
        name: `measurements.json`; of every other name the content says what it is, a table, or points or a packed
            folder of DLTdv or Argus Clicker.
        content: of the file.

    Raises:
        BadInputError: the file is none of these, or belongs to another recording.
    """
    if name == MEASUREMENTS:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, name)
            path.write_bytes(content)
            marks = marks_of(path)
    else:
        marks = imported(content, _sizes(desk), _range(desk), desk.programs.orienting.system)
    strange = next((key for key, _ in marks if key.pulse not in desk.log.times), None)
    if strange is not None:
        first, last = desk.log.pulses[0], desk.log.pulses[-1]
        raise BadInputError(
            phrase(
                "hand_file_pulse",
                "{name}: has pulse {pulse}, and the log goes from {first} to {last}",
                name=name,
                pulse=strange.pulse,
                first=first,
                last=last,
            )
        )
    cameras = desk.log.facts.cameras
    unknown = next((key.camera for key, _ in marks if key.camera not in cameras), None)
    if unknown is not None:
        raise BadInputError(
            phrase(
                "hand_file_camera",
                "{name}: has camera {camera}, and the log has {cameras}",
                name=name,
                camera=unknown,
                cameras=", ".join(cameras),
            )
        )
    return desk.put(operator, marks)


def marks_of(path: Path) -> list[tuple[Key, Entered]]:
    """The marks that a file of measurements holds; what was measured automatically stays marked as such."""
    marks = []
    for jump in read_measurements(path).jumps:
        for pulse in jump.pulses:
            for camera, image in pulse.images.items():
                for name, point in image.points.items():
                    sx, sy = np.sqrt(np.diagonal(point.covariance)).tolist()
                    x, y = point.xy.tolist()
                    entered = Entered(MarkState.MEASURED, (x, y), (sx, sy), _SOURCES[point.source])
                    marks.append((Key(int(pulse.pulse), camera, name), entered))
                for line, side in LINES.items():
                    ski = image.skis.get(side)
                    for vertex in range(0 if ski is None else len(ski.xy)):
                        assert ski is not None  # noqa: S101 - the range is empty otherwise
                        (x, y), sigma = ski.xy[vertex].tolist(), float(ski.sigma[vertex])
                        entered = Entered(MarkState.MEASURED, (x, y), (sigma, sigma), _SOURCES[ski.source])
                        marks.append((Key(int(pulse.pulse), camera, line, vertex), entered))
    return marks


def _measurements(desk: Desk, operator: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / MEASUREMENTS
        write_measurements(desk.programs.measurements(operator), path)
        return path.read_bytes()


def _range(desk: Desk) -> range:
    return range(desk.log.pulses[0], desk.log.pulses[-1] + 1)


def _sizes(desk: Desk) -> dict[str, tuple[int, int]]:
    return {name: camera.size for name, camera in desk.log.facts.cameras.items()}
