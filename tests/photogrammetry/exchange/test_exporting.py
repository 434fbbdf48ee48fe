"""Cameras and poses go out to other programs and come back as they were: image points equal to 1e-9 px."""

import json
import os
import struct
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from photogrammetry.exchange.exporting import Form, exported
from photogrammetry.exchange.importing import import_network
from photogrammetry.network.file import network_from_json
from photogrammetry.network.model import Network
from photogrammetry.programming.oriented import read_oriented
from photogrammetry.programming.views import views_of
from rig.arrays import Floats
from rig.errors import BadInputError
from svev import cli

#: COLMAP, Pose2Sim and caliscope without what else they want, so that they change nothing in Svev's environment.
_READERS = Path(__file__).parents[3] / "build" / "readers"
#: Distortions that OpenCV's parameters describe exactly: none, all terms, balanced, affinity alone.
EXACT: dict[str, dict[str, float]] = {
    "ideal": {},
    "all terms": {"a1": -1.6e-7, "a2": 4e-13, "a3": -2e-19, "b1": 1e-7, "b2": -2e-7},
    "balanced": {"a1": -1.6e-7, "a2": 4e-13, "b1": 1e-7, "b2": -2e-7, "r0": 250.0},
    "affinity": {"c1": 1e-3},
}
#: Those that it does not.
NEAR: dict[str, dict[str, Any]] = {
    "affinity beside distortion": {"a1": -1.6e-7, "c1": 1e-4},
    "shear": {"c2": 2e-5},
    "measured": {"a1": -1e-8, "b1": 1e-8, "distortion": "measured"},
}
XYZ = np.random.default_rng(3).uniform((-3.0, -3.0, -2.0), (3.0, 3.0, 2.0), (40, 3))
_ANGLES = (0.0, 0.7, np.pi)


def _looking(angle: float) -> Floats:
    """R of a level camera that looks along (sin, cos) of an angle."""
    right = np.array([np.cos(angle), -np.sin(angle), 0.0])
    back = -np.array([np.sin(angle), np.cos(angle), 0.0])
    return np.column_stack((right, [0.0, 0.0, 1.0], back))


def _network(**lens: Any) -> dict[str, Any]:
    cameras = {
        f"K{i + 1}": {"size": [640, 480], "c": 700.0 + i, "x0": 3.2, "y0": -1.7, **lens} for i in range(len(_ANGLES))
    }
    images = {
        f"K{i + 1}": {"camera": f"K{i + 1}", "R": _looking(a).tolist(), "X0": (12.0 * _looking(a)[:, 2]).tolist()}
        for i, a in enumerate(_ANGLES)
    }
    points = {f"P{i + 1}": {"role": "tie", "X": xyz} for i, xyz in enumerate(XYZ.tolist())}
    network: dict[str, Any] = {
        "format": "svev-network/1",
        "length_unit": "m",
        "image_frame": "pixel",
        "cameras": cameras,
        "images": images,
        "points": points,
        "observations": [],
        "datum": {"type": "control"},
    }
    views = views_of(network_from_json(network, "network"))
    network["observations"] = [
        [name, point, *view.project(xyz).tolist(), 0.3]
        for name, view in views.items()
        for point, xyz in zip(points, XYZ, strict=True)
    ]
    return network


def _written(network: Network, form: Form, folder: Path) -> list[Path]:
    """The files that `import` is given."""
    files = exported(network, form).files
    for name, text in files.items():
        (folder / name).write_text(text)
    if form is Form.TOML:
        return [folder / "calibration.toml"]
    return [folder] if form is Form.COLMAP else [folder / name for name in files]


def _apart(one: Network, other: Network) -> float:
    before, after = views_of(one), views_of(other)
    assert set(before) == set(after)
    return max(float(np.abs(before[name].project(XYZ) - after[name].project(XYZ)).max()) for name in before)


@pytest.mark.parametrize("form", Form)
@pytest.mark.parametrize("lens", EXACT)
def test_what_goes_out_comes_back(lens: str, form: Form, tmp_path: Path) -> None:
    network = network_from_json(_network(**EXACT[lens]), "network")
    assert not [note for note in exported(network, form).notes if "differ" in note]
    back = import_network(_written(network, form, tmp_path)).network
    assert _apart(network, back) < 1e-9
    if form is Form.COLMAP:
        assert np.abs(back.observations.xy - network.observations.xy).max() < 1e-8  # written to 9 decimals by import
        assert np.allclose(np.array([point.xyz for point in back.points]), XYZ, atol=1e-15)


@pytest.mark.parametrize("lens", NEAR)
def test_what_cannot_be_carried_over_is_said(lens: str, tmp_path: Path) -> None:
    network = network_from_json(_network(**NEAR[lens]), "network")
    made = exported(network, Form.TOML)
    told = [float(note.split(" up to ")[1].split()[0]) for note in made.notes]
    assert len(told) == len(_ANGLES)
    apart = _apart(network, import_network(_written(network, Form.TOML, tmp_path)).network)
    assert 1e-9 < apart < 1.1 * max(told) + 1e-6
    assert max(told) < 0.1


def test_opencv_reads_its_files_and_projects_the_same(tmp_path: Path) -> None:
    network = network_from_json(_network(**EXACT["all terms"]), "network")
    for path in _written(network, Form.OPENCV, tmp_path):
        file = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
        matrix, lens, rvec, tvec = (
            file.getNode(key).mat() for key in ("camera_matrix", "distortion_coefficients", "rvec", "tvec")
        )
        seen = cv2.projectPoints(XYZ, rvec, tvec, matrix, lens)[0][:, 0]
        assert np.abs(seen - views_of(network)[path.stem].project(XYZ)).max() < 1e-9


def test_the_tables_of_caliscope_hold_the_same_and_come_back(tmp_path: Path) -> None:
    network = network_from_json(_network(**EXACT["all terms"]), "network")
    (path,) = _written(network, Form.TOML, tmp_path)
    nested = path.with_name("camera_array.toml")
    flat = tomllib.loads(path.read_text())
    for number, table in tomllib.loads(nested.read_text())["cameras"].items():
        assert table == flat[f"cam_{number}"] | {"cam_id": int(number), "rotation_count": 0}
    assert _apart(network, import_network([nested]).network) < 1e-9


def test_the_toml_is_what_anipose_and_pose2sim_read(tmp_path: Path) -> None:
    network = network_from_json(_network(**EXACT["balanced"]), "network")
    (path,) = _written(network, Form.TOML, tmp_path)
    tables = tomllib.loads(path.read_text())
    assert tables.pop("metadata") == {"adjusted": True, "error": 0.0}
    for table in tables.values():
        assert set(table) == {"name", "size", "matrix", "distortions", "rotation", "translation", "fisheye"}
        pose = (np.array(table["rotation"]), np.array(table["translation"]))
        seen = cv2.projectPoints(XYZ, *pose, np.array(table["matrix"]), np.array(table["distortions"]))[0][:, 0]
        assert np.abs(seen - views_of(network)[table["name"]].project(XYZ)).max() < 1e-9


@pytest.mark.skipif(not _READERS.exists(), reason="programs that read our files are not there: make readers")
def test_programs_of_others_project_the_same(tmp_path: Path) -> None:
    """COLMAP's own model, which it has written again as text and binary, comes in with all of its files."""
    network = network_from_json(_network(**EXACT["balanced"]), "network")
    for form in (Form.COLMAP, Form.TOML):
        (tmp_path / form).mkdir()
        _written(network, form, tmp_path / form)
    (tmp_path / "points.json").write_text(json.dumps(XYZ.tolist()))
    command = [sys.executable, "-P", str(Path(__file__).with_name("read_by_others.py")), str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(_READERS)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=True)
    seen = json.loads(done.stdout.splitlines()[-1])
    assert set(seen) == {"pycolmap", "Pose2Sim", "caliscope"}
    for cameras in seen.values():
        for view, image_points in zip(views_of(network).values(), cameras, strict=True):
            assert np.abs(np.array(image_points) - view.project(XYZ)).max() < 1e-9
    for kind in ("bin", "txt"):
        folder = tmp_path / kind
        assert (folder / f"frames.{kind}").exists()
        for files in ([folder], sorted(folder.iterdir())):
            assert _apart(network, import_network(files).network) < 1e-9


def _binary(folder: Path) -> None:
    """A model of one camera, one image and one point, as COLMAP writes it."""
    camera = struct.pack("<QIiQQ8d", 1, 7, 4, 640, 480, 700, 700, 320, 240, -0.1, 0.01, 1e-3, -1e-3)
    image = struct.pack("<QI7dI", 1, 3, 1, 0, 0, 0, 0.5, 0, 2, 7) + b"left one.jpg\0"
    image += struct.pack("<QddQddQ", 2, 320.5, 240.5, 9, 10.0, 11.0, 2**64 - 1)
    point = struct.pack("<QQ3d3BdQII", 1, 9, 1.0, 2.0, 3.0, 1, 2, 3, 0.1, 1, 3, 0)
    for name, data in {"cameras": camera, "images": image, "points3D": point}.items():
        (folder / f"{name}.bin").write_bytes(data)


def test_a_binary_model_of_colmap_is_read(tmp_path: Path) -> None:
    _binary(tmp_path)
    network = import_network([tmp_path]).network
    assert [camera.name for camera in network.cameras] == ["7"]
    assert [(image.name, image.camera) for image in network.images] == [("left one.jpg", 0)]
    assert [(point.name, *np.asarray(point.xyz)) for point in network.points] == [("9", 1.0, 2.0, 3.0)]
    assert np.allclose(network.observations.xy, [[0.5, -0.5]])


@pytest.mark.parametrize("length", [3, 40, 70, 150])
def test_a_binary_model_that_breaks_off_is_refused(length: int, tmp_path: Path) -> None:
    _binary(tmp_path)
    path = tmp_path / "images.bin"
    whole = path.read_bytes()
    path.write_bytes(whole[:length] if length < len(whole) else whole + b"more")
    with pytest.raises(BadInputError, match="export COLMAP's model again"):
        import_network([tmp_path])


def test_a_model_as_text_and_as_binary_is_refused(tmp_path: Path) -> None:
    _binary(tmp_path)
    (tmp_path / "cameras.txt").write_text("7 PINHOLE 640 480 700 700 320 240\n")
    with pytest.raises(BadInputError, match="as text and as binary"):
        import_network([tmp_path])


def test_toml_of_others_is_read_or_refused(tmp_path: Path) -> None:
    path = tmp_path / "camera_array.toml"
    table = (
        "size = [640, 480]\nmatrix = [[700, 0, 320], [0, 700, 240], [0, 0, 1]]\ndistortions = [0.1, 0.0, 0.0, 0.0]\n"
    )
    path.write_text(f"[cameras.0]\ncam_id = 0\n{table}rotation = [0.1, 0.2, 0.3]\ntranslation = [1.0, 2.0, 3.0]\n")
    network = import_network([path]).network
    assert [image.name for image in network.images] == ["0"]
    path.write_text(f"[cam_1]\n{table}fisheye = true\n")
    with pytest.raises(BadInputError, match="fisheye cannot be carried over"):
        import_network([path])
    path.write_text(f"[cam_1]\nport = 1\n{table}error = 0.1\nworld_position = [0.0, 0.0, 0.0]\n")
    assert [camera.name for camera in import_network([path]).network.cameras] == ["cam_1"]
    for more, said in (
        ("rotation = [0.1, 0.2, 0.3]\n", "cam_1: a pose is rotation and translation; write both"),
        ("xi = 0.9\n", 'cam_1: unknown key "xi"'),
        ('distortion_model = "equidistant"\n', 'cam_1: unknown key "distortion_model"'),
    ):
        path.write_text(f"[cam_1]\n{table}{more}")
        with pytest.raises(BadInputError, match=said):
            import_network([path])
    path.write_text("[metadata]\nerror = 0.0\n")
    with pytest.raises(BadInputError, match="no camera in it"):
        import_network([path])


def test_a_result_is_exported_as_a_network_is(tmp_path: Path) -> None:
    data = _network(**EXACT["all terms"])
    result = {
        "format": "svev-adjustment/1",
        "converged": True,
        "length_unit": "m",
        "image_frame": "pixel",
        "cameras": {
            name: dict.fromkeys(("a1", "a2", "a3", "b1", "b2", "c1", "c2", "r0"), 0.0)
            | camera
            | {"distortion": "projected", "sigma": {}}
            for name, camera in data["cameras"].items()
        },
        "images": {name: image | {"sigma_X0": [0.1] * 3} for name, image in data["images"].items()},
        "points": {name: {"X": point["X"], "rays": 3} for name, point in data["points"].items()},
    }
    path = tmp_path / "poses.json"
    path.write_text(json.dumps(result))
    network = read_oriented(path)
    assert exported(network, Form.TOML) == exported(network_from_json(data, "network"), Form.TOML)
    assert len(network.points) == len(XYZ)


def test_what_a_file_cannot_hold_is_refused() -> None:
    data = _network()
    data["images"]["again"] = dict(data["images"]["K1"])
    twice = network_from_json(data, "network")
    with pytest.raises(BadInputError, match="camera K1: has 2 poses, and this file holds one"):
        exported(twice, Form.TOML)
    assert any("2 poses, which are left out" in note for note in exported(twice, Form.OPENCV).notes)
    metric = network_from_json({**_network(), "image_frame": "metric", "observations": []}, "network")
    with pytest.raises(BadInputError, match="count in pixels"):
        exported(metric, Form.OPENCV)


def test_the_command_writes_says_what_is_lost_and_overwrites_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, out = tmp_path / "network.json", tmp_path / "out"
    source.write_text(json.dumps(_network(**NEAR["shear"])))
    command = ["network", "export", str(source), "--to", "colmap", "-o", str(out), "--json"]
    assert cli.main(command) == 0
    answer = json.loads(capsys.readouterr().out)
    assert [Path(name).name for name in answer["files"]] == ["cameras.txt", "images.txt", "points3D.txt"]
    assert sum("differ from svev's" in note for note in answer["notes"]) == len(_ANGLES)
    assert cli.main(command) == 2
    assert "--force" in capsys.readouterr().err
    assert cli.main([*command, "--force"]) == 0
