"""The files that marks leave and come back in, by name or by content."""

import io
import re
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from analysis.digitizing.exchange.argus import argus_files, read_argus
from analysis.digitizing.exchange.csv_file import csv_of, read_csv
from analysis.digitizing.exchange.dltdv import dltdv_files, read_dltdv
from analysis.digitizing.marks.journal import Entered, Key
from analysis.scene.camera_system import CameraSystem
from rig.errors import BadInputError
from rig.host.files import TEXT_MAX

#: Files that `exported` makes.
NAMES: Final = ("marks.csv", "dltdv.zip", "argus.zip")
_DLTDV: Final = re.compile(rb"\W*pt\d+_cam\d+_[XY]\b")
_ARGUS: Final = re.compile(rb"[^\r\n,]+_cam_1_x,")
_POINTS: Final = ("xypts.csv", "xypts.tsv")


def exported(
    name: str,
    marks: Iterable[tuple[Key, Entered]],
    sizes: Mapping[str, tuple[int, int]],
    pulses: range,
    system: CameraSystem | None,
) -> bytes:
    """The content of one of the files `NAMES`; folders of other programs are packed, with notes in a `README.txt`.

    Args:
        name: of the file.
        marks: of an operator.
        sizes: width and height of the images by camera, px, left to right.
        pulses: of the log, without gaps.
        system: the oriented cameras; None: there are none.

    Raises:
        BadInputError: there is no such file, or it cannot hold these cameras.
    """
    match name:
        case "marks.csv":
            return csv_of(marks)
        case "dltdv.zip":
            return _zipped(*dltdv_files(marks, list(sizes), pulses, system), "dltdv")
        case "argus.zip":
            return _zipped(*argus_files(marks, list(sizes), pulses, system, sizes=sizes), "argus")
    raise BadInputError(f"there is no {name}: choose {', '.join(NAMES)}")


def imported(
    content: bytes, sizes: Mapping[str, tuple[int, int]], pulses: range, system: CameraSystem | None
) -> list[tuple[Key, Entered]]:
    """The marks of a file that came from somewhere: our table, points of DLTdv8 or Argus, or a folder of them, packed.

    Args:
        content: of the file.
        sizes: width and height of the images by camera, px, left to right.
        pulses: of the log, without gaps.
        system: the oriented cameras; None: there are none.

    Raises:
        BadInputError: it holds no marks.
    """
    with TemporaryDirectory(prefix="svev-marks-") as folder:
        try:
            if content.startswith(b"PK"):
                return _read(_unpacked(content, Path(folder)), sizes, pulses, system)
            path = Path(folder, "xypts.csv")
            path.write_bytes(content)
            return _read(path, sizes, pulses, system)
        except BadInputError as error:
            raise BadInputError(str(error).replace(f"{folder}/", "")) from None


def _read(
    path: Path, sizes: Mapping[str, tuple[int, int]], pulses: range, system: CameraSystem | None
) -> list[tuple[Key, Entered]]:
    with path.open("rb") as file:
        heading = file.readline(4096).removeprefix(b"\xef\xbb\xbf")
    if path.suffix == ".tsv" or _DLTDV.match(heading):
        return read_dltdv(path, list(sizes), pulses, system)
    if _ARGUS.match(heading):
        return read_argus(path, list(sizes), pulses, sizes=sizes)
    return read_csv(path)


def _zipped(files: Mapping[str, bytes], notes: Sequence[str], folder: str) -> bytes:
    """A ZIP archive with one folder; the same files make the same archive."""
    content = dict(files)
    if notes:
        content["README.txt"] = "".join(f"{note}.\n" for note in notes).encode()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():
            archive.writestr(zipfile.ZipInfo(f"{folder}/{name}", (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def _unpacked(content: bytes, folder: Path) -> Path:
    """Unpack the points of an archive and what names them; returns where the points are."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            # macOS packs a hidden shadow of every file.
            real = [each for each in archive.infolist() if not Path(each.filename).name.startswith("._")]
            there = [each for each in real if each.filename.endswith(_POINTS)]
            if len(there) != 1:
                raise BadInputError(
                    f"the archive holds {len(there)} files ...xypts.csv: pack one folder of DLTdv or Argus"
                )
            (points,) = there
            names = points.filename[: -len(_POINTS[0])] + "names.csv"
            for wanted in [points, *[each for each in real if each.filename == names][:1]]:
                if wanted.file_size > TEXT_MAX:
                    raise BadInputError(f"{Path(wanted.filename).name}: is larger than {TEXT_MAX // 10**6} MB")
                (folder / Path(wanted.filename).name).write_bytes(archive.read(wanted))
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
        raise BadInputError(f"the archive cannot be unpacked ({error}); pack the folder again") from None
    return folder / Path(points.filename).name
