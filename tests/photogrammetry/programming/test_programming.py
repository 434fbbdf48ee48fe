"""`import photogrammetry`: what programs need, by names; the same numbers as the commands give."""

import json
import subprocess
import sys
from dataclasses import asdict
from importlib import resources
from pathlib import Path

import cv2
import numpy as np
import pytest

import photogrammetry
from photogrammetry.network.file_writer import network_to_json
from rig.settings.file import CONFIG
from svev.cli import main
from tests.photogrammetry.synthetic import hill, lab_frame, with_state

RODS = CONFIG / "networks" / "rods.json"


@pytest.fixture(scope="module")
def rods() -> photogrammetry.Result:
    return photogrammetry.adjust(photogrammetry.read(RODS))


def test_everything_offered_is_there_and_typed() -> None:
    assert {"read", "adjust", "orient", "intersect_points", "intersect_lines", "stick_angles"} <= set(
        photogrammetry.__all__
    )
    for name in photogrammetry.__all__:
        assert getattr(photogrammetry, name).__doc__, name
    assert set(photogrammetry.__all__) <= set(dir(photogrammetry))
    assert resources.files("photogrammetry").joinpath("py.typed").is_file()
    with pytest.raises(AttributeError, match="has no attribute 'adjusst'"):
        _ = photogrammetry.adjusst  # type: ignore[attr-defined]


def test_nothing_is_loaded_before_it_is_used() -> None:
    code = "import photogrammetry, sys; print(sorted(n for n in sys.modules if n.startswith(('photogr', 'scipy'))))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "['photogrammetry']"


def test_adjusting_gives_what_the_command_gives(rods: photogrammetry.Result, tmp_path: Path) -> None:
    assert main(["adjust", str(RODS), "--force", "-o", str(tmp_path / "result.json")]) == 0
    result = json.loads((tmp_path / "result.json").read_text())
    assert rods.to_json() == result
    assert (rods.sigma0, rods.redundancy) == (result["sigma0"], result["redundancy"])
    assert rods.verdict == result["global_test"]["verdict"]
    assert rods.length_unit == "m"
    assert (rods.gross_errors, rods.removed) == ((), ())
    for name, point in result["points"].items():
        assert rods.points[name].xyz.tolist() == point["X"]
        assert rods.points[name].covariance.tolist() == point["covariance"]
    for name, image in result["images"].items():
        assert rods.images[name].camera == image["camera"]
        assert rods.images[name].R.tolist() == image["R"]
        assert rods.images[name].sigma.tolist() == image["sigma_X0"]
    for name, camera in result["cameras"].items():
        assert rods.cameras[name].sigmas == camera["sigma"]
        assert rods.cameras[name].values["c"] == camera["c"]


def test_joint_covariance_by_names(rods: photogrammetry.Result) -> None:
    joint = rods.covariance("R2-2", "P0", "R2-1")
    assert joint.shape == (9, 9)
    assert joint[:3, :3] == pytest.approx(rods.points["R2-2"].covariance)
    assert not joint[3:6].any()  # a fixed point
    length = rods.points["R2-2"].xyz - rods.points["R2-1"].xyz
    along = np.concatenate((length, np.zeros(3), -length)) / np.linalg.norm(length)
    assert np.sqrt(along @ joint @ along) == pytest.approx(0.001, rel=0.1)  # the rod, though its ends have decimetres
    with pytest.raises(photogrammetry.BadInputError, match="no point is called 'R9-1'"):
        rods.covariance("R9-1")


def test_orientation_and_calibration_say_what_they_found(tmp_path: Path) -> None:
    network = hill(6, helmets=17).network
    data = network_to_json(network)
    data["points"]["B5"]["X"][0] += 0.3
    for image in data["images"].values():
        image["X0"] = image["R"] = None
    result = photogrammetry.orient(photogrammetry.network_from(data))
    assert any("control point B5" in one for one in result.removed)
    assert any("control point B5: wrong by about" in note for note in result.notes)
    photogrammetry.write(network, tmp_path / "again.json")
    assert photogrammetry.read(tmp_path / "again.json").points[0].name == "B1"
    calibrated = photogrammetry.calibrate(lab_frame(2, points=30).network)
    assert set(calibrated.cameras["K1"].sigmas) == {"c", "x0", "y0", "a1"}
    assert any("no distance gives the scale" in note for note in calibrated.notes)
    assert calibrated.length_unit == ""


def test_a_view_projects_as_opencv_does(tmp_path: Path) -> None:
    matrix = np.array([[1420.0, 0.0, 325.5], [0.0, 1420.0, 231.25], [0.0, 0.0, 1.0]])
    coefficients, turn, shift = np.array([-0.31, 0.22, 0.0013, -0.0007, 0.4]), np.array([0.2, -1.1, 0.7]), np.ones(3)
    storage = cv2.FileStorage(str(tmp_path / "K1.yml"), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", matrix)
    storage.write("distortion_coefficients", coefficients)
    storage.write("extrinsic_parameters", np.concatenate((turn, shift))[None])
    storage.write("image_points", np.zeros((1, 4, 2)))
    storage.release()
    view = photogrammetry.views_of(photogrammetry.import_network([tmp_path / "K1.yml"]).network)["K1-1"]
    rotation, _ = cv2.Rodrigues(turn)
    xyz = (np.random.default_rng(2).uniform((-0.7, -0.5, 3.0), (0.7, 0.5, 4.0), (20, 3)) - shift) @ rotation
    expected = cv2.projectPoints(xyz, turn, shift, matrix, coefficients)[0][:, 0]
    assert view.project(xyz) == pytest.approx(expected, abs=1e-9)
    to = xyz - view.X0
    assert view.rays(expected) == pytest.approx(to / np.linalg.norm(to, axis=1, keepdims=True), abs=1e-9)


def test_intersections_by_names_have_the_errors_that_they_say(rods: photogrammetry.Result) -> None:
    """Normalised errors of points and lines, measured with noise in the three views of the rods."""
    views, rng = photogrammetry.views_of(rods), np.random.default_rng(3)
    flight = {f"P{i}": np.array((6.0 + 0.1 * i, 0.02 * i, -2.0)) for i in range(60)}
    points = {
        name: {image: view.project(xyz) + rng.normal(0.0, 0.4, 2) for image, view in views.items()}
        for name, xyz in flight.items()
    }
    del points["P1"]["K1-1"]
    points["P2"] = {"K1-1": points["P2"]["K1-1"]}
    found = photogrammetry.intersect_points(points, views, sigma=0.4)
    normed = [(found[n].xyz - xyz) / found[n].sigma for n, xyz in flight.items() if n != "P2"]
    assert 0.85 < np.std(normed) < 1.15
    assert set(found["P1"].residuals) == {"K2-1", "K3-1"}
    assert not found["P2"].determined
    assert "measure the point in another image" in found["P2"].words

    ski = {"K1-1": (-1.2, 0.1, 1.1), "K2-1": (-1.0, -0.5, 0.0, 0.7), "K3-1": (-0.8, 0.9)}  # not the same points
    lines = {
        name: {
            image: [views[image].project(xyz + t * np.array((1.0, 0.1, 0.2))) + rng.normal(0.0, 0.4, 2) for t in along]
            for image, along in ski.items()
        }
        for name, xyz in flight.items()
    }
    skis = photogrammetry.intersect_lines(lines, views, sigma=0.4)
    slopes = [(line.parameters[0] - 0.2) / np.sqrt(line.covariance[0, 0]) for line in skis.values()]
    assert all(line.determined for line in skis.values())
    assert 0.75 < np.std(slopes) < 1.25
    line = skis["P0"]
    assert line.at(7.0) - line.at(6.0) == pytest.approx(line.direction / line.direction[0])
    with pytest.raises(photogrammetry.BadInputError, match="image 'K9' is not among the views; name one of K1-1, K2-1"):
        photogrammetry.intersect_points({"P": {"K9": (1.0, 2.0)}}, views, sigma=0.4)
    with pytest.raises(photogrammetry.BadInputError, match="is no image point"):
        photogrammetry.intersect_points({"P": {"K1-1": (1.0, float("nan"))}}, views, sigma=0.4)


def test_the_stick_model_of_a_known_pose() -> None:
    angles = photogrammetry.stick_angles(
        helmet=(1.0, 0.0, 1.0),
        hip=(0.0, 0.0, 1.0),
        bindings=((0.0, -0.2, 0.0), (0.0, 0.2, 0.0)),
        right_ski=(1.0, -1.0, 0.0),
        left_ski=(2.0, 2.0, 0.0),
    )
    expected = {"alpha": 90.0, "beta": 90.0, "gamma": 90.0, "dphi": 0.0, "phi": 0.0}
    assert asdict(angles) == pytest.approx(expected, abs=1e-9)


def test_a_view_needs_a_pose() -> None:
    with pytest.raises(photogrammetry.BadInputError, match='no pose; give "X0" and "R", or orient the network first'):
        photogrammetry.views_of(photogrammetry.read(RODS))
    synthetic = hill(1)
    views = photogrammetry.views_of(with_state(synthetic.network, synthetic.truth))
    assert set(views) == {image.name for image in synthetic.network.images}
