"""Folders that DLTdv opens (T. L. Hedrick, University of North Carolina).

Files with a common prefix, as DLTdv8 names and reads them: `xypts.csv` with the columns `pt1_cam1_X`, `pt1_cam1_Y`,
`pt1_cam2_X`, ... and a row for each frame, NaN where nothing is digitized; `xyzpts.csv` (`pt1_X`, `pt1_Y`, `pt1_Z`),
`xyzres.csv` (`pt1`), `offsets.csv` (`cam1_offset`); or the first as `xypts.tsv` with rows, columns and value of what is
not zero (`sparseSave.m`). The DLT coefficients of all cameras stand in a table of their own, 11 rows, a column for each
camera (`dlt_inverse.m`).

DLTdv8 counts pixels from 1, from the top left corner, y down: its `movieDataStore4.m` takes coordinates as row and
column of the image (https://github.com/tlhedrick/dltdv, DLTdv8a_internal). DLTdv versions 3 to 7 turn the image over
and count y from the bottom.

DLTdv knows neither states nor names of points in these files. Our own table `names.csv` gives the names of points and
cameras, the pulse of the first frame, and says whether the lens' distortion was removed. Coefficients are exact only
without it: of lenses that distort, points are written without distortion, and put back when they are read.
"""

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from analysis.digitizing.exchange.dlt import camera_matrix, coefficients, distorted, has_distortion, undistorted
from analysis.digitizing.exchange.space import all_oriented, xyz_of
from analysis.digitizing.exchange.tables import read_matrix, table
from analysis.digitizing.exchange.tracks import Tracks, tracks_of
from analysis.digitizing.marks.journal import Entered, Key
from analysis.scene.camera_system import CameraSystem
from rig.errors import BadInputError

#: From our pixels, which count from 0, to those of MATLAB.
_FIRST: Final = 1.0
_TO_MATLAB: Final = np.array([[1.0, 0.0, _FIRST], [0.0, 1.0, _FIRST], [0.0, 0.0, 1.0]])
_AS_MEASURED, _REMOVED = "as measured", "distortion removed"
_XYPTS: Final = ("xypts.csv", "xypts.tsv")


def dltdv_files(
    marks: Iterable[tuple[Key, Entered]],
    cameras: Sequence[str],
    pulses: range,
    system: CameraSystem | None,
    prefix: str = "svev_",
) -> tuple[dict[str, bytes], tuple[str, ...]]:
    """The files of a folder for DLTdv8.

    Videos are those of `svev export LOG --out X.mp4 --separate`: frame 1 is the first pulse of the log. Where
    distortion is removed from the points of a camera, DLTdv shows them beside their places in its video.

    Args:
        marks: of an operator.
        cameras: names of the log's cameras, left to right.
        pulses: of the log, without gaps.
        system: the oriented cameras; without all of them there are no coefficients and no points in space.
        prefix: of the names of the files.

    Returns:
        Content by name, and what a person should know, one line each.

    Raises:
        BadInputError: DLT coefficients are not defined.
    """
    tracks, notes = tracks_of(marks, cameras, pulses)
    system = all_oriented(system, cameras)
    removed = [name for name in cameras if system is not None and has_distortion(system[name])]
    if system is None:
        notes.append("not all cameras are oriented: no DLT coefficients, no points in space")
    if removed:
        notes.append(f"DLT knows no distortion: it was removed from the points of {', '.join(removed)}")
    xy = tracks.xy.copy()
    for place, name in enumerate(cameras):
        if name in removed and system is not None:
            xy[:, :, place] = undistorted(system[name], xy[:, :, place])
    xyz, residuals = xyz_of(tracks, system)
    points = range(1, len(tracks.names) + 1)
    views = range(1, len(cameras) + 1)
    frames = len(pulses)
    files = {
        "xypts.csv": table(
            [f"pt{p}_cam{c}_{a}" for p in points for c in views for a in "XY"], xy.reshape(frames, -1) + _FIRST
        ),
        "xyzpts.csv": table([f"pt{p}_{a}" for p in points for a in "XYZ"], xyz.reshape(frames, -1)),
        "xyzres.csv": table([f"pt{p}" for p in points], residuals),
        "offsets.csv": table([f"cam{c}_offset" for c in views], np.zeros((frames, len(cameras)))),
        "names.csv": _names(tracks, removed),
    }
    if system is not None:
        matrices = {name: _TO_MATLAB @ camera_matrix(system[name]) for name in cameras}
        files["DLTcoefs.csv"] = table(None, coefficients(system, matrices))
    return {prefix + name: content for name, content in files.items()}, tuple(notes)


def read_dltdv(
    path: Path,
    cameras: Sequence[str],
    pulses: range,
    system: CameraSystem | None = None,
    *,
    things: Sequence[str] = (),
    from_bottom: Mapping[str, int] | None = None,
) -> list[tuple[Key, Entered]]:
    """Read the marks of a file `xypts.csv` or `xypts.tsv`, of DLTdv or of ours.

    Args:
        path: the file; `names.csv` with the same prefix beside it says what its columns are, where it is there.
        cameras: names of the log's cameras, left to right, for files without names.
        pulses: of the log; the first row of a file without names is the first of them.
        system: the oriented cameras, where their distortion has to be put back.
        things: what the points are, in their order, for files without names.
        from_bottom: heights of the images by camera, px, if y counts from the bottom (DLTdv 3 to 7); None: it
            counts from the top.

    Raises:
        BadInputError: the file is none of DLTdv, does not fit the log, or nobody says what its points are.
    """
    beginning = next((path.name.removesuffix(each) for each in _XYPTS if path.name.endswith(each)), None)
    if beginning is None:
        raise BadInputError(f"{path}: is no file of DLTdv; name its ...xypts.csv or ...xypts.tsv")
    beside = path.with_name(beginning + "names.csv")
    named = _read_names(beside) if beside.exists() else _Names(pulses.start, list(cameras), list(things), ())
    headings, values = read_matrix(path)
    t, m = len(named.tracks), len(named.cameras)
    if not t or values.shape[1] != 2 * t * m:
        raise BadInputError(
            f"{path}: has {values.shape[1]} columns, and {t} points in {m} cameras are {2 * t * m}: say which things "
            f"its points are, in {beside.name} beside it"
        )
    expected = [f"pt{p}_cam{c}_{a}" for p in range(1, t + 1) for c in range(1, m + 1) for a in "XY"]
    if headings != expected[: len(headings)]:  # of a sparse table the last columns may be empty
        raise BadInputError(
            f"{path}: its columns are not in the order of DLTdv (pt1_cam1_X, pt1_cam1_Y, pt1_cam2_X, ...); put them "
            "into it"
        )
    for name in named.cameras:
        if name not in cameras:
            raise BadInputError(f"{path}: is of a camera {name}, and the log has {', '.join(cameras)}")
    xy = values.reshape(len(values), t, m, 2) - _FIRST
    for place, name in enumerate(named.cameras):
        if from_bottom is not None:
            xy[:, :, place, 1] = from_bottom[name] - 1 - xy[:, :, place, 1]
        if name in named.removed:
            if system is None or name not in system.names:
                raise BadInputError(f"{path}: the distortion of {name} was removed; orient the cameras, to put it back")
            xy[:, :, place] = distorted(system[name], xy[:, :, place])
    marks = Tracks(named.tracks, named.cameras, named.first, xy).marks()
    outside = next((key.pulse for key, _ in marks if key.pulse not in pulses), None)
    if outside is not None:
        raise BadInputError(f"{path}: has a point at pulse {outside}, and the log has {pulses.start} to {pulses[-1]}")
    return marks


@dataclass(frozen=True, slots=True)
class _Names:
    """What the columns and rows of a file are: pulse of its first row, cameras, tracks, cameras without distortion."""

    first: int
    cameras: list[str]
    tracks: list[str]
    removed: Sequence[str]


def _names(tracks: Tracks, removed: Sequence[str]) -> bytes:
    rows = [("frame1", str(tracks.first_pulse), "")]
    rows += [
        (f"cam{place}", name, _REMOVED if name in removed else _AS_MEASURED)
        for place, name in enumerate(tracks.cameras, 1)
    ]
    rows += [(f"pt{place}", name, "") for place, name in enumerate(tracks.names, 1)]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([("column", "name", "coordinates"), *rows])
    return text.getvalue().encode()


def _read_names(path: Path) -> _Names:
    try:
        rows = list(csv.reader(io.StringIO(path.read_text("utf-8-sig"))))[1:]
        said = {row[0]: row[1:] for row in rows if row}
        cameras = [said[f"cam{place}"] for place in range(1, sum(each.startswith("cam") for each in said) + 1)]
        names = [row[0] for row in cameras]
        tracks = [said[f"pt{place}"][0] for place in range(1, sum(each.startswith("pt") for each in said) + 1)]
        removed = [row[0] for row in cameras if row[1] == _REMOVED]
        found = _Names(int(said["frame1"][0]), names, tracks, removed)
    except (KeyError, IndexError, ValueError, csv.Error) as error:
        raise BadInputError(f"{path}: does not name the columns of a file of DLTdv ({error}); write it again") from None
    if len(said) < len(list(filter(None, rows))) or any(len(set(each)) < len(each) for each in (names, tracks)):
        raise BadInputError(f"{path}: a point, a camera or a column stands twice; write it again")
    return found
