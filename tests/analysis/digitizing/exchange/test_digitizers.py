"""Folders of DLTdv and Argus: points come back, coefficients show truth where the images show it."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.digitizing.exchange.argus import argus_files, read_argus
from analysis.digitizing.exchange.dltdv import dltdv_files, read_dltdv
from analysis.digitizing.exchange.formats import NAMES, exported, imported
from analysis.digitizing.marks.journal import Entered, Key
from analysis.scene.camera_system import CameraSystem
from photogrammetry.geometry.camera_model import Distortion
from rig.api.digitizing import MarkState
from rig.arrays import Floats
from rig.errors import BadInputError
from tests.analysis.simulated import SIZE, true_cameras

PULSES = range(101, 111)
SIZES = {name: (int(SIZE[0]), int(SIZE[1])) for name in ("K1", "K2", "K3")}
XYZ = {
    pulse: {"P1": np.array([10 + 0.8 * step, 0.1, -2.0]), "P3": np.array([9.8 + 0.8 * step, -0.2, -3.1])}
    for step, pulse in enumerate(PULSES)
}


def lens(system: CameraSystem, distortion: Distortion, **interior: float) -> CameraSystem:
    """The cameras with lenses that distort."""
    order = ("c", "x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2")
    changed = {}
    for name, placed in system.cameras.items():
        values = placed.camera.interior.copy()
        for parameter, value in interior.items():
            values[order.index(parameter)] = value
        changed[name] = replace(placed, camera=replace(placed.camera, interior=values, distortion=distortion))
    return replace(system, cameras=changed)


IDEAL = lens(true_cameras(), Distortion.PROJECTED, x0=3.0, y0=-2.0)
SHAPE = {"a1": 6e-9, "a2": 1e-15, "b1": 2e-7, "b2": -1e-7}
BARREL = lens(IDEAL, Distortion.PROJECTED, **SHAPE)
SYSTEMS = {"ideal": IDEAL, "projected": BARREL, "measured": lens(IDEAL, Distortion.MEASURED, **SHAPE, c1=1e-4)}


def marks_in(system: CameraSystem) -> list[tuple[Key, Entered]]:
    """What an operator without error measures: points, a line, a guess and something hidden."""
    found = []
    for pulse, points in XYZ.items():
        for name in system.names:
            for thing, xyz in points.items():
                x, y = system[name].project(xyz).tolist()
                found.append((Key(pulse, name, thing), Entered(xy=(x, y))))
    ski = [(Key(103, "K2", "left ski", vertex), Entered(xy=(100.125 + vertex, 200.0))) for vertex in range(11)]
    return sorted([*found, *ski], key=lambda item: item[0])


REST = [
    (Key(104, "K1", "P2"), Entered(MarkState.GUESS, (5.0, 6.0))),
    (Key(104, "K2", "P2"), Entered(MarkState.HIDDEN)),
    (Key(999, "K1", "P1"), Entered(xy=(1.0, 2.0))),
]


def written(folder: Path, files: dict[str, bytes]) -> Path:
    for name, content in files.items():
        (folder / name).write_bytes(content)
    return folder


def same(found: list[tuple[Key, Entered]], expected: list[tuple[Key, Entered]]) -> None:
    assert [key for key, _ in found] == [key for key, _ in expected]
    assert all(mark.state is MarkState.MEASURED for _, mark in found)
    assert np.abs(np.array([mark.xy for _, mark in found]) - np.array([mark.xy for _, mark in expected])).max() < 1e-6


def numbers(content: bytes, headings: int) -> Floats:
    return np.atleast_2d(np.genfromtxt(io.BytesIO(content), delimiter=",", skip_header=headings))


def shown(coefficients: Floats, xyz: Floats) -> Floats:
    """`dlt_inverse.m` of DLTdv, for one camera."""
    c = coefficients
    w = c[8:11] @ xyz + 1
    return np.array([(c[:3] @ xyz + c[3]) / w, (c[4:7] @ xyz + c[7]) / w])


@pytest.mark.parametrize("kind", SYSTEMS)
def test_points_of_dltdv_come_back(kind: str, tmp_path: Path) -> None:
    system = SYSTEMS[kind]
    files, notes = dltdv_files([*marks_in(system), *REST], list(SIZES), PULSES, system)
    assert notes[0] == "3 marks without a measured place are not in it"
    folder = written(tmp_path, files)
    same(read_dltdv(folder / "svev_xypts.csv", list(SIZES), PULSES, system), marks_in(system))
    if kind == "ideal":
        same(read_dltdv(folder / "svev_xypts.csv", list(SIZES), PULSES), marks_in(system))
        assert len(notes) == 1
    else:
        assert notes[1] == "DLT knows no distortion: it was removed from the points of K1, K2, K3"
        with pytest.raises(BadInputError, match="the distortion of K1 was removed; orient the cameras"):
            read_dltdv(folder / "svev_xypts.csv", list(SIZES), PULSES)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_coefficients_of_dltdv_show_the_truth(kind: str) -> None:
    system = SYSTEMS[kind]
    files, _ = dltdv_files(marks_in(system), list(SIZES), PULSES, system)
    coefficients = numbers(files["svev_DLTcoefs.csv"], 0)
    assert coefficients.shape == (11, 3)
    points = numbers(files["svev_xypts.csv"], 1)
    space = numbers(files["svev_xyzpts.csv"], 1)
    for frame, pulse in enumerate(PULSES):
        for track, thing in enumerate(("P1", "P3")):
            for place in range(3):
                at = 6 * track + 2 * place
                place_shown = shown(coefficients[:, place], XYZ[pulse][thing])
                assert np.abs(place_shown - points[frame, at : at + 2]).max() < 1e-6
            assert np.abs(space[frame, 3 * track : 3 * track + 3] - XYZ[pulse][thing]).max() < 1e-6
    if kind == "ideal":
        x, y = system["K2"].project(XYZ[101]["P1"]).tolist()
        assert points[0, 2:4].tolist() == pytest.approx([x + 1, y + 1], abs=1e-9)  # MATLAB counts from 1, y down


def test_files_of_dltdv_are_read(tmp_path: Path) -> None:
    path = tmp_path / "old_xypts.csv"
    path.write_text("pt1_cam1_X,pt1_cam1_Y,pt1_cam2_X,pt1_cam2_Y\nNaN,NaN,1,480\n 11.5,21.25,,\n")
    cameras = ["K1", "K2"]
    with pytest.raises(BadInputError, match=r"has 4 columns.*in old_names.csv beside it"):
        read_dltdv(path, cameras, PULSES)
    top = read_dltdv(path, cameras, PULSES, things=["P1"])
    assert top == [(Key(101, "K2", "P1"), Entered(xy=(0.0, 479.0))), (Key(102, "K1", "P1"), Entered(xy=(10.5, 20.25)))]
    bottom = read_dltdv(path, cameras, PULSES, things=["P1"], from_bottom={"K1": 480, "K2": 480})
    assert bottom[0] == (Key(101, "K2", "P1"), Entered(xy=(0.0, 0.0)))
    sparse = tmp_path / "new_xypts.tsv"
    sparse.write_text("pt1_cam1_X\tpt1_cam1_Y\n10\t4\t2\n2\t1\t11.5\n2\t2\t21.25\n")
    assert read_dltdv(sparse, cameras, PULSES, things=["P1"]) == top[1:]
    sparse.write_text("pt1_cam1_X\tpt1_cam1_Y\n10\t4\t1\n11\t1\t11.5\n")
    with pytest.raises(BadInputError, match="entries outside of its 10 rows"):
        read_dltdv(sparse, cameras, PULSES, things=["P1"])
    for line in ("10\tNaN\t1", "10\t4", "1e9\t1e9\t0", "-1\t4\t0", "inf\t1\t0"):
        sparse.write_text(f"pt1_cam1_X\n{line}\n")
        with pytest.raises(BadInputError, match="is no sparse table of DLTdv"):
            read_dltdv(sparse, cameras, PULSES, things=["P1"])
    sparse.write_text("pt1_cam1_X\n10\t4\t1\n2\t1\t1e7\n2\t2\t1\n")
    with pytest.raises(BadInputError, match="'P1' at pulse 102 in K1: xy"):
        read_dltdv(sparse, cameras, PULSES, things=["P1"])
    with pytest.raises(BadInputError, match="is no file of DLTdv"):
        read_dltdv(tmp_path / "marks.csv", cameras, PULSES)
    for text in ("pt1_cam1_X;pt1_cam1_Y\n1,5;2,5\n", "pt1_cam1_X,pt1_cam1_Y\n1_0,2\n"):
        path.write_text(text)
        with pytest.raises(BadInputError, match="is no table of numbers"):
            read_dltdv(path, ["K1"], PULSES, things=["P1"])


def test_columns_in_another_order_are_refused(tmp_path: Path) -> None:
    """Columns are known by their places: a spreadsheet that moved them would give each point the places of another."""
    path = tmp_path / "a_xypts.csv"
    path.write_text("pt2_cam1_X,pt2_cam1_Y,pt1_cam1_X,pt1_cam1_Y\n1,2,3,4\n")
    with pytest.raises(BadInputError, match="its columns are not in the order of DLTdv"):
        read_dltdv(path, ["K1"], PULSES, things=["P1", "P2"])
    path.write_text("pt1_cam1_Y,pt1_cam1_X\n1,2\n")
    with pytest.raises(BadInputError, match="its columns are not in the order of DLTdv"):
        read_dltdv(path, ["K1"], PULSES, things=["P1"])


@pytest.mark.parametrize(
    "rows",
    [
        "frame1,101,\ncam1,K1,as measured\npt1,P1,\npt2,P1,\n",
        "frame1,101,\ncam1,K1,as measured\npt1,P1,\npt1,P2,\npt2,P3,\n",
    ],
)
def test_a_thing_twice_is_refused(rows: str, tmp_path: Path) -> None:
    path = tmp_path / "a_xypts.csv"
    path.write_text("pt1_cam1_X,pt1_cam1_Y,pt2_cam1_X,pt2_cam1_Y\n1,2,3,4\n")
    (tmp_path / "a_names.csv").write_text(f"column,name,coordinates\n{rows}")
    with pytest.raises(BadInputError, match="a point, a camera or a column stands twice"):
        read_dltdv(path, ["K1"], PULSES)


@pytest.mark.parametrize("kind", SYSTEMS)
def test_points_of_argus_come_back(kind: str, tmp_path: Path) -> None:
    system = SYSTEMS[kind]
    files, notes = argus_files([*marks_in(system), *REST], list(SIZES), PULSES, system, sizes=SIZES)
    folder = written(tmp_path, files)
    same(read_argus(folder / "svev-xypts.csv", list(SIZES), PULSES, sizes=SIZES), marks_in(system))
    config = json.loads(files["svev-config.yaml"])
    assert config[0] == {"videos": [f"svev_{name}.mp4" for name in SIZES]}
    assert {key for entry in config for key in entry} == {
        "videos", "points", "resolution", "last_frame", "offsets", "dlt_coefficents", "camera_profile", "settings",
    }  # fmt: skip
    for entry in config[1], config[4], config[5], config[6]:
        assert next(iter(entry.values())) in files
    assert ("K1" in notes[-1]) is False
    assert any("the lens of K2 in the profile of Argus is off by" in note for note in notes) is (kind == "measured")


@pytest.mark.parametrize("kind", ["ideal", "projected"])
def test_calibration_of_argus_shows_the_truth(kind: str) -> None:
    system = SYSTEMS[kind]
    files, _ = argus_files(marks_in(system), list(SIZES), PULSES, system, sizes=SIZES)
    coefficients = numbers(files["svev-dlt-coefficients.csv"], 0)
    profiles = np.loadtxt(io.BytesIO(files["svev-profile.txt"]))
    assert profiles.shape == (3, 12)
    points = numbers(files["svev-xypts.csv"], 1)
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-14)
    for place, name in enumerate(SIZES):
        profile = np.delete(profiles[place], [0, 2, 3, 6])  # as argus-click does
        focal, cx, cy = profile[:3]
        matrix = np.array([[focal, 0, cx], [0, focal, cy], [0, 0, 1.0]])
        seen = points[:1, 2 * place : 2 * place + 2].reshape(1, 1, 2)
        ideal = cv2.undistortPoints(seen, matrix, profile[3:], P=matrix, criteria=stop).ravel()
        assert np.abs(ideal - shown(coefficients[:, place], XYZ[101]["P1"])).max() < 1e-6
        x, y = system[name].project(XYZ[101]["P1"]).tolist()
        assert seen.ravel().tolist() == pytest.approx([x, SIZE[1] - 1 - y], abs=1e-9)


def test_without_orientation_there_are_points_only(tmp_path: Path) -> None:
    for files, notes in (
        dltdv_files(marks_in(IDEAL), list(SIZES), PULSES, IDEAL.only(["K1", "K2"])),
        argus_files(marks_in(IDEAL), list(SIZES), PULSES, None, sizes=SIZES),
    ):
        assert not any("coef" in name.lower() or "profile" in name for name in files)
        assert notes[0].startswith("not all cameras are oriented")
    folder = written(tmp_path, argus_files([], list(SIZES), PULSES, None, sizes=SIZES)[0])
    with pytest.raises(BadInputError, match="holds no rows"):
        read_argus(folder / "svev-xypts.csv", list(SIZES), PULSES, sizes=SIZES)


def test_a_camera_beside_the_origin_has_no_coefficients() -> None:
    placed = IDEAL["K1"]
    axis = placed.rotation[:, 2]
    aside = replace(placed, position=placed.position - axis * (axis @ placed.position))
    system = replace(IDEAL, cameras={**IDEAL.cameras, "K1": aside})
    with pytest.raises(BadInputError, match="the origin of the survey lies just beside camera K1"):
        dltdv_files([], list(SIZES), PULSES, system)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("kind", SYSTEMS)
def test_a_file_that_was_taken_away_comes_back(name: str, kind: str) -> None:
    system = SYSTEMS[kind]
    content = exported(name, marks_in(system), SIZES, PULSES, system)
    assert content == exported(name, marks_in(system), SIZES, PULSES, system)
    same(imported(content, SIZES, PULSES, system), marks_in(system))
    if name != "marks.csv":
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            points = next(each for each in archive.namelist() if each.endswith("xypts.csv"))
            alone = archive.read(points)
        if name == "argus.zip":
            same(imported(alone, SIZES, PULSES, system), marks_in(system))
        else:
            with pytest.raises(BadInputError, match=r"^xypts.csv: has 78 columns.*in names.csv beside it"):
                imported(alone, SIZES, PULSES, system)


def test_what_cannot_come_back_is_refused() -> None:
    with pytest.raises(BadInputError, match=r"there is no marks.xls: choose marks.csv"):
        exported("marks.xls", [], SIZES, PULSES, None)
    with pytest.raises(BadInputError, match="the archive cannot be unpacked"):
        imported(b"PK\3\4" + bytes(100), SIZES, PULSES, None)
    empty = io.BytesIO()
    zipfile.ZipFile(empty, "w").close()
    with pytest.raises(BadInputError, match=r"holds 0 files ...xypts.csv"):
        imported(empty.getvalue(), SIZES, PULSES, None)
