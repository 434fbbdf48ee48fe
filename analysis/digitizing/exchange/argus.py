"""Folders that Argus Clicker opens (D. Evangelista, D. Ray, T. Hedrick et al., University of North Carolina).

Files with a common tag, as Clicker saves and loads them (https://github.com/kilmoretrout/argus_gui: `argus-click`,
`tools.py`, docs/user-guide.md): `TAG-xypts.csv` with the columns `NAME_cam_1_x`, `NAME_cam_1_y`, ... of each track and
a row for each frame; `-xyzpts.csv` (`NAME_x`, ...), `-xyzres.csv` (`NAME`), `-offsets.csv` (`camera_1`);
`-config.yaml`, a list with videos, points, resolution, last frame, offsets, coefficients, profile and settings, which
Clicker loads; DLT coefficients, 11 rows with a column for each camera; and the camera profile, a line for each: number,
focal length, width, height, principal point, aspect, k1, k2, p1, p2, k3 (of the model of OpenCV).

Clicker counts pixels from 0, from the bottom left corner, y up: it takes the place of the pointer in its window as it
is. It reads points with 11 bits, i.e. to 0.5 px below 1024 px, and takes 0 for no point; the files hold all digits.

Points are those of the images; the profile removes their distortion before the coefficients are used. It is our lens'
but for the names if distortion is "projected" and there is neither affinity nor shear; otherwise the nearest one, and
what is left is said.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np

from analysis.digitizing.exchange.dlt import coefficients
from analysis.digitizing.exchange.space import all_oriented, xyz_of
from analysis.digitizing.exchange.tables import read_matrix, table
from analysis.digitizing.exchange.tracks import Tracks, tracks_of
from analysis.digitizing.marks.journal import Entered, Key
from analysis.export.camera_calibration import plumb_bob, project
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.calibration_file import CalibratedCamera
from rig.arrays import Floats
from rig.errors import BadInputError

#: A lens that is off by less is the same.
_EXACT_PX: Final = 1e-6
_GRID: Final = 25  # places along each side of the image at which lenses are compared


def argus_files(
    marks: Iterable[tuple[Key, Entered]],
    cameras: Sequence[str],
    pulses: range,
    system: CameraSystem | None,
    *,
    sizes: Mapping[str, tuple[int, int]],
    tag: str = "svev",
) -> tuple[dict[str, bytes], tuple[str, ...]]:
    """The files of a folder for Argus Clicker.

    The configuration names the videos `TAG_CAMERA.mp4` in the folder where Clicker is started: those of
    `svev export LOG --out TAG.mp4 --separate`. Frame 1 is the first pulse of the log.

    Args:
        marks: of an operator.
        cameras: names of the log's cameras, left to right.
        pulses: of the log, without gaps.
        system: the oriented cameras; without all of them there are no coefficients and no points in space.
        sizes: width and height of the images by camera, px.
        tag: with which the names of the files begin.

    Returns:
        Content by name, and what a person should know, one line each.

    Raises:
        BadInputError: DLT coefficients are not defined.
    """
    tracks, notes = tracks_of(marks, cameras, pulses)
    system = all_oriented(system, cameras)
    if system is None:
        notes.append("not all cameras are oriented: no DLT coefficients, no camera profile, no points in space")
    xy = _turned_over(tracks.xy, cameras, sizes)
    xyz, residuals = xyz_of(tracks, system)
    frames, views = len(pulses), range(1, len(cameras) + 1)
    files = {
        "-xypts.csv": table(
            [f"{n}_cam_{c}_{a}" for n in tracks.names for c in views for a in "xy"], xy.reshape(frames, -1)
        ),
        "-xyzpts.csv": table([f"{n}_{a}" for n in tracks.names for a in "xyz"], xyz.reshape(frames, -1)),
        "-xyzres.csv": table(list(tracks.names), residuals),
        "-offsets.csv": table([f"camera_{c}" for c in views], np.zeros((frames, len(cameras)))),
        "-config.yaml": _config(tracks, tag, calibrated=system is not None),
    }
    if system is not None:
        matrices, profiles = {}, []
        for place, name in enumerate(cameras, 1):
            profile, worst = _profile(system[name])
            if worst > _EXACT_PX:
                notes.append(f"the lens of {name} in the profile of Argus is off by {worst:.2g} px at most")
            matrices[name] = _matrix(profile)
            profiles.append([place, profile[0], *sizes[name], *profile[1:3], 1.0, *profile[3:]])
        files["-dlt-coefficients.csv"] = table(None, coefficients(system, matrices))
        files["-profile.txt"] = table(None, np.array(profiles), " ")
    return {tag + name: content for name, content in files.items()}, tuple(notes)


def read_argus(
    path: Path, cameras: Sequence[str], pulses: range, *, sizes: Mapping[str, tuple[int, int]]
) -> list[tuple[Key, Entered]]:
    """Read the marks of a file `...-xypts.csv` of Argus Clicker, as they were measured in the images.

    Args:
        path: the file; names of tracks are names of things.
        cameras: names of the log's cameras, left to right.
        pulses: of the log; the first row is the first of them.
        sizes: width and height of the images by camera, px.

    Raises:
        BadInputError: the file is none of Clicker, or does not fit the log.
    """
    headings, values = read_matrix(path)
    names = list(dict.fromkeys(heading.rsplit("_", 3)[0] for heading in headings))
    views = range(1, len(cameras) + 1)
    if headings != [f"{n}_cam_{c}_{a}" for n in names for c in views for a in "xy"] or values.shape[1] != len(headings):
        raise BadInputError(
            f"{path}: its columns are not those of Argus Clicker for {len(cameras)} cameras (NAME_cam_1_x, ...); name "
            "a file ...-xypts.csv of this recording"
        )
    if np.isfinite(values[len(pulses) :]).any():
        raise BadInputError(f"{path}: has points after frame {len(pulses)}, where the log ends; name its own file")
    xy = _turned_over(values.reshape(len(values), len(names), len(cameras), 2), cameras, sizes)
    return Tracks(names, cameras, pulses.start, xy).marks()


def _turned_over(xy: Floats, cameras: Sequence[str], sizes: Mapping[str, tuple[int, int]]) -> Floats:
    """Places (f, t, m, 2) with y from the other edge of the image, from the centre of its last row of pixels."""
    turned = xy.copy()
    for place, name in enumerate(cameras):
        turned[:, :, place, 1] = sizes[name][1] - 1 - xy[:, :, place, 1]
    return turned


def _profile(placed: PlacedCamera) -> tuple[Floats, float]:
    """Focal length, principal point, k1, k2, p1, p2, k3 (8,) with y up; and by how much they are off at most, px.

    Raises:
        BadInputError: the lens has none of this kind.
    """
    camera = placed.camera
    width, height = (int(size) for size in placed.size)
    interior = dict(zip(INTERIOR, camera.interior.tolist(), strict=True))
    calibrated = CalibratedCamera(**interior, r0=float(camera.balance), distortion=camera.distortion.value)
    try:
        lens = plumb_bob(calibrated, (width, height))
    except ValueError as error:
        raise BadInputError(f"{camera.name}: {error}") from None
    lens[:2] = lens[:2].mean()  # Argus knows one focal length
    grid = np.stack(np.meshgrid(*(np.linspace(0, n - 1, _GRID) for n in (width, height))), axis=-1).reshape(-1, 2)
    ideal = placed.reduced(grid)
    directions = np.column_stack([ideal[:, 0], -ideal[:, 1], np.full(len(ideal), interior["c"])])
    worst = float(np.abs(project(lens, directions) - grid).max())
    focal, _, cx, cy, k1, k2, p1, p2, k3 = lens.tolist()
    return np.array([focal, cx, height - 1 - cy, k1, k2, -p1, p2, k3]), worst


def _matrix(profile: Floats) -> Floats:
    """(3, 3) from the camera's system (x right, y up, z backward) to the pixels of a profile without distortion."""
    focal, cx, cy = profile[:3]
    return np.array([[-focal, 0.0, cx], [0.0, -focal, cy], [0.0, 0.0, 1.0]])


def _config(tracks: Tracks, tag: str, *, calibrated: bool) -> bytes:
    """What Clicker loads: YAML, of which JSON is a part."""
    track = tracks.names[0] if tracks.names else "Track 1"
    settings = {
        "sync": True, "displaying_all_tracks": True, "current_track": track, "init_track": track, "auto_advance": True,
        "global_filename": tag, "rgb": False, "output_sparse": False, "bstrap": False,
    }  # fmt: skip
    project = [
        {"videos": [f"{tag}_{name}.mp4" for name in tracks.cameras]},
        {"points": f"{tag}-xypts.csv"},
        {"resolution": 1},
        {"last_frame": 2},
        {"offsets": f"{tag}-offsets.csv"},
        {"dlt_coefficents": f"{tag}-dlt-coefficients.csv" if calibrated else None},
        {"camera_profile": f"{tag}-profile.txt" if calibrated else None},
        {"settings": settings},
    ]
    return (json.dumps(project, indent=1) + "\n").encode()
