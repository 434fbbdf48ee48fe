"""Calibrations of other programs: understood to the last key, over the whole picture, or refused."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from photogrammetry.exchange.importing import Imported, import_network
from photogrammetry.geometry.camera_model import image_point
from photogrammetry.network.file_writer import metric_to_pixel, network_to_json
from rig.arrays import Floats
from rig.errors import BadInputError

MATRIX = [800.0, 0.0, 319.5, 0.0, 800.0, 239.5, 0.0, 0.0, 1.0]
LENS = [-0.2, 0.05, 0.001, -0.002, 0.01]
BASE: dict[str, Any] = {"image_width": 640, "image_height": 480, "camera_matrix": MATRIX, "dist_coeffs": LENS}


def _json(folder: Path, **changed: Any) -> Path:
    path = folder / "K1.json"
    path.write_text(json.dumps({key: value for key, value in (BASE | changed).items() if value is not None}))
    return path


def _yaml(folder: Path, text: str) -> Path:
    path = folder / "K1.yml"
    path.write_text(text)
    return path


def _seen(imported: Imported, size: tuple[int, int], directions: Floats) -> Floats:
    """Pixels of directions x, y, 1 (y down, z forward) by the network's camera."""
    lens = imported.network.cameras[0].lens()
    rays = np.column_stack((directions * (1.0, -1.0), -np.ones(len(directions))))
    return metric_to_pixel(np.asarray(image_point(lens, np.eye(3), np.zeros(3), rays)), np.array(size))


def _by_opencv(matrix: list[float], lens: list[float], directions: Floats) -> Floats:
    rays = np.column_stack((directions, np.ones(len(directions))))
    k = np.array(matrix).reshape(3, 3)
    return np.asarray(cv2.projectPoints(rays, np.zeros(3), np.zeros(3), k, np.array(lens))[0][:, 0])


def _by_file_storage(folder: Path, ending: str) -> Path:
    """As OpenCV's own calibration programs write it."""
    path = folder / f"K1{ending}"
    file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    file.write("calibration_time", "Fri Nov 27 12:00:00 2026")
    file.write("image_width", 640)
    file.write("image_height", 480)
    file.write("flags", "")
    if ending != ".json":  # OpenCV's comments there are no JSON
        file.writeComment("flags: none")
    file.write("camera_matrix", np.reshape(MATRIX, (3, 3)))
    file.write("distortion_coefficients", np.reshape(LENS, (5, 1)))
    file.write("avg_reprojection_error", 0.25)
    file.release()
    return path


DIRECTIONS = np.random.default_rng(2).uniform(-0.25, 0.25, (50, 2))
BLOCK = """image_width: 640
image_height: 480
camera_matrix: [800.0, 0.0, 319.5, 0.0, 800.0, 239.5, 0.0, 0.0, 1.0]
dist_coeffs:
- -0.2
- 0.05
- 0.001
- -0.002
- 1.0e-2
"""
ROS = """image_width: 640
image_height: 480
camera_name: north
camera_matrix:
  rows: 3
  cols: 3
  data: [800.0, 0.0, 319.5, 0.0, 800.0, 239.5, 0.0, 0.0, 1.0]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.2, 0.05,
    0.001, -0.002, 1e-2]
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
"""


@pytest.mark.parametrize(
    "write",
    [
        _json,
        lambda folder: _json(folder, dist_coeffs=[LENS]),
        lambda folder: _json(folder, camera_matrix=np.reshape(MATRIX, (3, 3)).tolist()),
        lambda folder: _json(folder, dist_coeffs={"k1": -0.2, "k2": 0.05, "p1": 0.001, "p2": -0.002, "k3": 0.01}),
        lambda folder: _json(folder, dist_coeffs={"rows": 5, "cols": 1, "data": [[each] for each in LENS]}),
        lambda folder: _json(folder, dist_coeffs=None, distortion=LENS, fisheye_model=False, camera_model="pinhole"),
        lambda folder: _yaml(folder, BLOCK),
        lambda folder: _yaml(folder, ROS),
        lambda folder: _yaml(folder, "%YAML:1.0\n---\n" + BLOCK),
        *(partial(_by_file_storage, ending=ending) for ending in (".xml", ".yml", ".yaml", ".json")),
    ],
)
def test_the_distortion_is_read_however_it_is_written(write: Callable[[Path], Path], tmp_path: Path) -> None:
    imported = import_network([write(tmp_path)])
    assert _seen(imported, (640, 480), DIRECTIONS) == pytest.approx(_by_opencv(MATRIX, LENS, DIRECTIONS), abs=1e-9)
    assert imported.notes == ()


@pytest.mark.parametrize(
    ("changed", "pattern"),
    [
        ({"fisheye_model": True}, 'key "fisheye_model" = True: a fisheye or other lens model cannot'),
        ({"fisheye_model": 1}, 'key "fisheye_model" = 1: a fisheye'),
        ({"distortion_model": "equidistant"}, "'equidistant': a fisheye or other lens model cannot be carried over"),
        ({"camera_model": "omni"}, "'omni': a fisheye or other lens model cannot be carried over"),
        ({"xi": 1.2}, 'key "xi" is not understood; remove it if it does not change'),
        ({"cam0": {"distortion_coeffs": [1, 2]}}, 'key "cam0" is not understood'),
        ({"dist_coeffs": "none"}, 'key "dist_coeffs" is not understood; write its numbers'),
        ({"dist_coeffs": {"values": LENS}}, 'key "dist_coeffs" is not understood; write its numbers'),
        ({"dist_coeffs": [True, 0, 0, 0]}, 'key "dist_coeffs" is not understood'),
        ({"dist_coeffs": {"rows": 2, "cols": 3, "data": LENS}}, 'key "dist_coeffs" is not understood'),
        ({"dist_coeffs": [1e300, 0, 0, 0]}, 'key "dist_coeffs" holds a number that no camera has, or none'),
        (
            {"camera_matrix": [1e11, 0, 0, 0, 1e200, 0, 0, 0, 1]},
            'key "camera_matrix" holds a number that no camera has',
        ),
        ({"extrinsic_parameters": [[1e200] * 6]}, 'key "extrinsic_parameters" holds a number that no camera has'),
        ({"D": [0.0] * 5}, 'keys "dist_coeffs" and "D" say the same; remove one'),
        ({"Camera_Matrix": MATRIX}, 'key "Camera_Matrix" stands twice, written differently'),
        ({"binning_x": 2}, 'key "binning_x": a part of the picture'),
        ({"roi": {"x_offset": 40}}, 'key "roi": a part of the picture'),
        ({"camera_matrix": np.reshape(MATRIX, (3, 3)).T.tolist()}, "the camera matrix is none, or transposed"),
        ({"image_width": 640.5}, "an image size of 640.5 x 480 px is none"),
        ({"image_size": [1920, 1080]}, "says two image sizes"),
        ({"image_points": [1.0, 2.0]}, 'key "image_points" is not understood'),
    ],
)
def test_what_is_not_understood_is_refused(changed: dict[str, Any], pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern) as refused:
        import_network([_json(tmp_path, **changed)])
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "pattern"),
    [
        (BLOCK + "dist_coeffs: [0, 0, 0, 0]\n", 'line 10: key "dist_coeffs" stands twice; remove one'),
        (BLOCK + "flags: *missing\n", "not valid YAML: found undefined alias.* in line 10"),
        (BLOCK + "flags: &a [1]\nnotes: *a\n", "line 10: refers to another place"),
        (BLOCK + "  bad: [\n", "not valid YAML"),
        (BLOCK.replace("- 0.05", "- .nan"), 'key "dist_coeffs" is not understood'),
        (ROS.replace("plumb_bob", "equidistant"), "'equidistant': a fisheye or other lens model"),
        ("- 1\n", "is no table of keys"),
        ("", "is no table of keys"),
    ],
)
def test_yaml_that_says_two_things_or_none_is_refused(text: str, pattern: str, tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=pattern) as refused:
        import_network([_yaml(tmp_path, text)])
    assert "\n" not in str(refused.value)


def _wide(focal: float, lens: list[float]) -> dict[str, Any]:
    matrix = [focal, 0.0, 959.5, 0.0, focal, 539.5, 0.0, 0.0, 1.0]
    return {"image_width": 1920, "image_height": 1080, "camera_matrix": matrix, "dist_coeffs": lens}


RATIONAL = [0.8300838007, 0.1262758316, 0.0, 0.0, 0.0017900886, 1.1633299189, 0.3146537878, 0.0152086893]


def test_a_wide_rational_lens_is_refused_for_what_it_differs_at_the_corners(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"cannot be carried over: image points would differ by up to \S+ px"):
        import_network([_json(tmp_path, **_wide(900.0, RATIONAL))])


@pytest.mark.parametrize("focal", [1500.0, 2000.0, 3000.0])
def test_what_is_said_of_a_rational_lens_holds_all_over_the_picture(focal: float, tmp_path: Path) -> None:
    said = _wide(focal, RATIONAL)
    imported = import_network([_json(tmp_path, **said)])
    (note,) = imported.notes
    up_to = float(note.split(" up to ")[1].split()[0])
    assert up_to <= 1.0
    directions = np.random.default_rng(4).uniform(-2.0, 2.0, (80_000, 2))
    pixels = _by_opencv(said["camera_matrix"], RATIONAL, directions)
    shown = ((pixels >= 0.0) & (pixels <= (1919.0, 1079.0))).all(axis=1)
    directions, pixels = directions[shown], pixels[shown]
    corners = np.array([[0.0, 0.0], [1919.0, 0.0], [0.0, 1079.0], [1919.0, 1079.0]])
    assert np.linalg.norm(pixels - corners[:, None], axis=2).min(axis=1).max() < 60.0  # the corners are among them
    off = np.abs(_seen(imported, (1920, 1080), directions) - pixels).max()
    assert off <= 1.1 * up_to  # two digits are said


def test_a_lens_that_folds_inside_the_picture_is_said(tmp_path: Path) -> None:
    (note,) = import_network([_json(tmp_path, **_wide(900.0, [-0.4, 0.0, 0.0, 0.0]))]).notes
    # r (1 - 0.4 r^2) is largest, 0.609, at r = 0.913; a pixel more than 548 px from the axis shows nothing.
    u, v = np.meshgrid(np.arange(1920) - 959.5, np.arange(1080) - 539.5)
    beyond = float((np.hypot(u, v) > 900.0 * 2.0 / 3.0 / np.sqrt(1.2)).mean())
    assert "the distortion folds inside the picture" in note
    assert float(note.split(": ")[2].split("%")[0]) / 100.0 == pytest.approx(
        beyond, abs=0.06
    )  # a coarse grid, with edges


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"image_width": 480, "image_height": 640}, "look whether its width and height are exchanged"),
        (
            {"camera_matrix": [2400.0, 0.0, 959.5, 0.0, 2400.0, 539.5, 0.0, 0.0, 1.0]},
            "is 640, -300 px from the middle of the picture: look whether image size and calibration belong",
        ),
        ({"camera_matrix": [800.0, 0.0, 319.5, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0]}, "fx and fy differ as those of no"),
    ],
)
def test_a_camera_that_cannot_be_is_noted(changed: dict[str, Any], said: str, tmp_path: Path) -> None:
    notes = import_network([_json(tmp_path, dist_coeffs=[0.0] * 5, **changed)]).notes
    assert [said in note for note in notes] == [True]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("cameras.txt", "1 SIMPLE_PINHOLE 640 480 800 320 240\n1 SIMPLE_PINHOLE 640 480 900 320 240\n"),
        ("images.txt", "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 5 1 a.jpg\n\n"),
        ("points3D.txt", "1 0 0 0 0 0 0 0\n1 0 0 5 0 0 0 0\n"),
    ],
)
def test_colmap_with_a_name_twice_is_refused(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_PINHOLE 640 480 800 320 240\n")
    (tmp_path / name).write_text(text)
    with pytest.raises(BadInputError, match="is there twice; keep one of them, or export the model again"):
        import_network([tmp_path])


def test_a_size_that_is_not_whole_is_refused(tmp_path: Path) -> None:
    (tmp_path / "cameras.txt").write_text("1 SIMPLE_PINHOLE 640.5 480 800 320 240\n")
    with pytest.raises(BadInputError, match=r"an image size of 640\.5 x 480 px is none"):
        import_network([tmp_path])
    (tmp_path / "a.txt").write_text(PHOTOMODELER.replace("640 480", "640.5 480", 1))
    with pytest.raises(BadInputError, match="line 2: width and height of the image must be positive"):
        import_network([tmp_path / "a.txt"])


PHOTOMODELER = (
    "Bundle Soln\n0.0005 20 640 480\n1\n7.5 3.6 2.7 7.2 5.4 0 0 0 0 0\n0\n"
    f"0 P1.JPG\n0 1 2 3 0 0 0\n0 0 0 0 0 0 0\n\n0 9 3.6 2.7 7.2 5.4 0 0 0 0 0\n0 {'0 ' * 10}\n"
    "\n0317 1 2 3 0.1 0.1 0.1\n317 4 5 6 0.1 0.1 0.1\n\n\n0 0317 320 240 1 1\n0 317 100 240 1 1\n"
)


def test_marks_of_photomodeler_keep_their_names(tmp_path: Path) -> None:
    (tmp_path / "a.txt").write_text(PHOTOMODELER)
    network = import_network([tmp_path / "a.txt"]).network
    assert [point.name for point in network.points] == ["0317", "317"]
    assert [network.points[i].name for i in network.observations.point] == ["0317", "317"]
    (tmp_path / "a.txt").write_text(PHOTOMODELER.replace("\n317 4", "\n0317 4"))
    with pytest.raises(BadInputError, match="control point '0317' is there twice"):
        import_network([tmp_path / "a.txt"])


def test_images_of_a_board_in_xml_are_those_in_yaml(tmp_path: Path) -> None:
    draw = np.random.default_rng(3)
    written: dict[str, Any] = {
        "image_width": 640,
        "image_height": 480,
        "camera_matrix": np.reshape(MATRIX, (3, 3)),
        "grid_points": draw.random((6, 3)).astype(np.float32),
        "image_points": (100 * draw.random((2, 6, 2))).astype(np.float32),
        "extrinsic_parameters": draw.random((2, 6)),
    }
    networks = []
    for ending in (".xml", ".yml"):
        file = cv2.FileStorage(str(tmp_path / f"K1{ending}"), cv2.FILE_STORAGE_WRITE)
        for key, value in written.items():
            file.write(key, value)
        file.release()
        networks.append(network_to_json(import_network([tmp_path / f"K1{ending}"]).network))
    assert networks[0]["observations"]
    assert networks[0] == networks[1]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "not valid XML: no element found"),
        ("<opencv_storage><image_width>640", "not valid XML: no element found: line 1"),
        ("<calibration><image_width>640</image_width></calibration>", "is no table of keys in <opencv_storage>"),
        ('<!DOCTYPE x [<!ENTITY y "z">]><opencv_storage>&y;</opencv_storage>', "has a document type"),
        ("<a>" * 5000 + "</a>" * 5000, "not valid XML: maximum recursion depth"),
        ("<opencv_storage>640</opencv_storage>", "is no table of keys in <opencv_storage>"),
        ("<opencv_storage><k1>1</k1><k1>2</k1></opencv_storage>", 'key "k1" stands twice'),
        ("<opencv_storage><K>1 <_>2</_></K></opencv_storage>", "text beside other elements in <K>"),
        ("<opencv_storage><image_width>640</image_width></opencv_storage>", 'no 3 x 3 matrix "camera_matrix"'),
    ],
)
def test_xml_that_opencv_did_not_write_is_refused(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "K1.xml").write_text(text)
    with pytest.raises(BadInputError, match=says):
        import_network([tmp_path / "K1.xml"])
