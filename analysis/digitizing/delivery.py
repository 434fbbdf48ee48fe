"""Hands an operator's marks to other programs and takes them back: measurements, tables, folders of digitizers."""

import tempfile
import zipfile
from collections.abc import Callable, Mapping
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np

from analysis.digitizing.desk import Desk
from analysis.digitizing.exchange.argus import argus_files, read_argus
from analysis.digitizing.exchange.csv_file import csv_of, read_csv
from analysis.digitizing.exchange.dltdv import dltdv_files, read_dltdv
from analysis.digitizing.journal import Entered, Key
from analysis.digitizing.things import LINES
from analysis.measurements.file import read_measurements, write_measurements
from analysis.measurements.model import Source
from rig.api.digitizing import Changed, MarkSource, MarkState
from rig.errors import BadInputError

MEASUREMENTS: Final = "measurements.json"
DLTDV: Final = "dltdv.zip"
_ARGUS_MARK: Final = b"_cam_1_x"
#: All files of a folder of DLTdv together; ours have some hundred kB.
_UNPACKED_MAX: Final = 64 << 20
_SOURCES: Final = {Source.BY_HAND: MarkSource.HAND, Source.AUTOMATIC: MarkSource.AUTOMATIC}


def delivered(desk: Desk, operator: str, name: str) -> bytes:
    """A file of an operator's marks.

    Args:
        desk: of the log.
        operator: whose marks.
        name: `measurements.json`, `marks.csv`, `dltdv.zip` or `argus.zip`.

    Raises:
        BadInputError: the marks do not go into such a file.
    """
    return _WRITERS[name](desk, operator)


def taken_in(desk: Desk, operator: str, name: str, content: bytes) -> Changed:
    """Take marks of a file beside those of an operator, in whose place they come; one undo takes all back.

    Args:
        desk: of the log.
        operator: whose marks they become.
        name: `measurements.json`, `marks.csv` (also of Argus Clicker), or `dltdv.zip`.
        content: of the file.

    Raises:
        BadInputError: the file is none of these, or belongs to another recording.
    """
    with tempfile.TemporaryDirectory() as folder:
        marks = _read(desk, Path(folder), name, content)
    strange = next((key for key, _ in marks if key.pulse not in desk.log.times), None)
    if strange is not None:
        first, last = desk.log.pulses[0], desk.log.pulses[-1]
        raise BadInputError(f"{name}: has pulse {strange.pulse}, and the log goes from {first} to {last}")
    cameras = desk.log.facts.cameras
    unknown = next((key.camera for key, _ in marks if key.camera not in cameras), None)
    if unknown is not None:
        raise BadInputError(f"{name}: has camera {unknown}, and the log has {', '.join(cameras)}")
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


def _read(desk: Desk, folder: Path, name: str, content: bytes) -> list[tuple[Key, Entered]]:
    path = folder / name
    cameras, pulses = list(desk.log.facts.cameras), _range(desk)
    if name == DLTDV:
        _unpack(content, folder)
        found = next(iter(sorted(folder.glob("*xypts.csv"))), None)
        if found is None:
            raise BadInputError(f"{name}: holds no ...xypts.csv; pack the folder that DLTdv saved")
        return read_dltdv(found, cameras, pulses, desk.orienting.system)
    path.write_bytes(content)
    if name == MEASUREMENTS:
        return marks_of(path)
    if _ARGUS_MARK in content[:4096]:
        return read_argus(path, cameras, pulses, sizes=_sizes(desk))
    return read_csv(path)


def _unpack(content: bytes, folder: Path) -> None:
    """Take the tables out of an archive; names of folders in it do not matter.

    Raises:
        BadInputError: it is no archive, or too large.
    """
    try:
        with zipfile.ZipFile(BytesIO(content)) as archive:
            tables = [each for each in archive.infolist() if each.filename.endswith((".csv", ".tsv"))]
            if sum(each.file_size for each in tables) > _UNPACKED_MAX:
                raise BadInputError(f"{DLTDV}: holds more than {_UNPACKED_MAX >> 20} MiB; pack the tables alone")
            for each in tables:
                (folder / Path(each.filename).name).write_bytes(archive.read(each))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise BadInputError(f"{DLTDV}: cannot be unpacked ({error}); pack the folder again") from None


def _measurements(desk: Desk, operator: str) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / MEASUREMENTS
        write_measurements(desk.measurements(operator), path)
        return path.read_bytes()


def _table(desk: Desk, operator: str) -> bytes:
    return csv_of(desk.session(operator).everything())


def _dltdv(desk: Desk, operator: str) -> bytes:
    marks = desk.session(operator).everything()
    return _packed(*dltdv_files(marks, list(desk.log.facts.cameras), _range(desk), desk.orienting.system))


def _argus(desk: Desk, operator: str) -> bytes:
    marks, system = desk.session(operator).everything(), desk.orienting.system
    return _packed(*argus_files(marks, list(desk.log.facts.cameras), _range(desk), system, sizes=_sizes(desk)))


def _packed(files: Mapping[str, bytes], notes: tuple[str, ...]) -> bytes:
    out = BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
        if notes:
            archive.writestr("notes.txt", "\n".join(notes) + "\n")
    return out.getvalue()


def _range(desk: Desk) -> range:
    return range(desk.log.pulses[0], desk.log.pulses[-1] + 1)


def _sizes(desk: Desk) -> dict[str, tuple[int, int]]:
    return {name: camera.size for name, camera in desk.log.facts.cameras.items()}


_WRITERS: Final[Mapping[str, Callable[[Desk, str], bytes]]] = {
    MEASUREMENTS: _measurements,
    "marks.csv": _table,
    DLTDV: _dltdv,
    "argus.zip": _argus,
}
