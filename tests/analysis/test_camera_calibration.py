"""Calibrations for Foxglove and OpenCV, against `cv2.projectPoints` and our own camera model."""

import json
import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from analysis.export.camera_calibration import calibration_for_log
from photogrammetry.geometry.camera_model import INTERIOR, Lens, image_point, undistort
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.errors import BadInputError
from rig.settings.camera import CameraSettings, Region

WIDTH, HEIGHT = 640, 480
CENTRE = np.array([WIDTH - 1, HEIGHT - 1]) / 2.0
CAMERAS = [CameraSettings(name=name, backend="sim", region=Region(width=WIDTH, height=HEIGHT)) for name in ("K1", "K2")]
#: A lens of 8 mm before pixels of 5.6 um, 3 px of radial distortion in the corners.
PLAIN: dict[str, Any] = dict.fromkeys((*INTERIOR, "r0"), 0.0) | {"c": 1419.7, "distortion": "projected"}
REAL = PLAIN | {"x0": 3.1, "y0": -4.2, "a1": -7e-8, "a2": 1e-13, "b1": 1e-6, "b2": -8e-7, "r0": 200.0}


def _write(folder: Path, *bodies: dict[str, Any], **more: Any) -> Path:
    """A result file with cameras K1, K2, ..."""
    cameras = {f"K{number}": body | {"sigma": {"c": 1.9}} for number, body in enumerate(bodies, 1)}
    path = folder / "poses.json"
    path.write_text(json.dumps({"format": "svev-adjustment/1", "converged": True, "cameras": cameras} | more))
    return path


def _lens(body: dict[str, Any]) -> Lens:
    interior = np.array([body[name] for name in INTERIOR])
    return Lens(interior, np.asarray(body["r0"]), np.asarray(body["distortion"] == "measured"))


def _pixels(metric: NDArray[Any]) -> NDArray[Any]:
    """The contract: x_metric = x - (width - 1) / 2, y_metric = (height - 1) / 2 - y."""
    return np.stack([metric[:, 0] + CENTRE[0], CENTRE[1] - metric[:, 1]], axis=-1)


def _largest_deviation(folder: Path, body: dict[str, Any]) -> float:
    """Between where OpenCV, given the message, and our camera model see points that fill the image, px."""
    calibration = calibration_for_log(_write(folder, body), CAMERAS[:1])
    message = CameraCalibration.FromString(calibration.cameras["K1"])
    lens, position = _lens(body), np.array([3.0, -40.0, 12.0])
    rotation = rotation_from_vector(np.array([1.4, -0.1, 0.05]))
    columns, rows = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 639, 41), np.linspace(0, 479, 31)))
    ideal = undistort(lens, np.stack([columns - CENTRE[0], CENTRE[1] - rows], axis=-1))
    ahead = np.column_stack([ideal / body["c"], np.full(len(ideal), -1.0)])  # the contract's camera looks along -z
    xyz = position + 50.0 * ahead @ rotation.T
    ours = _pixels(image_point(lens, rotation, position, xyz))
    np.testing.assert_allclose(ours, np.stack([columns, rows], axis=-1), atol=1e-6)
    turned = np.diag([1.0, -1.0, -1.0]) @ rotation.T  # OpenCV's camera looks along +z, its y points down
    theirs, _ = cv2.projectPoints(
        xyz, cv2.Rodrigues(turned)[0], -turned @ position, np.reshape(message.K, (3, 3)), np.array(message.D)
    )
    return float(np.abs(theirs.reshape(-1, 2) - ours).max())


@given(
    c=st.floats(800.0, 3000.0),
    principal=st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0)),
    radial=st.tuples(st.floats(-8e-8, 8e-8), st.floats(-1e-13, 1e-13), st.floats(-3e-19, 3e-19)),
    decentring=st.tuples(st.floats(-3e-6, 3e-6), st.floats(-3e-6, 3e-6)),
    r0=st.floats(0.0, 300.0),
)
def test_projected_distortion_is_converted_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    c: float,
    principal: tuple[float, float],
    radial: tuple[float, float, float],
    decentring: tuple[float, float],
    r0: float,
) -> None:
    names = ("x0", "y0", "a1", "a2", "a3", "b1", "b2")
    body = PLAIN | {"c": c, "r0": r0} | dict(zip(names, (*principal, *radial, *decentring), strict=True))
    assert _largest_deviation(tmp_path_factory.mktemp("exact"), body) < 1e-7


@pytest.mark.parametrize(
    ("change", "least", "most"),
    [
        pytest.param({"c1": 1e-4}, 0.0, 1.5e-4, id="affinity"),
        pytest.param({"c1": 1e-4, "a1": 0.0, "a2": 0.0, "b1": 0.0, "b2": 0.0}, 0.0, 1e-7, id="affinity alone"),
        pytest.param({"c2": 1e-4}, 0.02, 0.03, id="shear, which has no counterpart: 1e-4 of 240 px"),
        pytest.param({"distortion": "measured"}, 0.0, 0.005, id="measured"),
        pytest.param({"distortion": "measured", "a1": -2e-7}, 0.0, 0.03, id="measured, 10 px in the corners"),
        pytest.param({"distortion": "measured", "a1": 2e-7}, 0.0, 0.05, id="measured, -10 px in the corners"),
        pytest.param({"distortion": "measured", "c1": -1e-4, "c2": 1e-4}, 0.0, 0.03, id="all"),
        pytest.param({"distortion": "measured", "c": 2493.3}, 0.0, 0.005, id="a longer lens"),
    ],
)
def test_any_other_distortion_is_fitted(tmp_path: Path, change: dict[str, Any], least: float, most: float) -> None:
    """The bounds are what remained when the test was written, doubled at most: far below what images show."""
    assert least <= _largest_deviation(tmp_path, REAL | change) < most


def test_a_distortion_left_out_would_be_seen(tmp_path: Path) -> None:
    """The measure of the tests above sees what they are about."""
    lens, plain = _lens(REAL), _lens(REAL | {"a1": 0.0, "a2": 0.0, "b1": 0.0, "b2": 0.0})
    corner = np.array([[300.0, 220.0]])
    assert np.abs(undistort(lens, corner) - undistort(plain, corner)).max() > 1.0


def test_the_message(tmp_path: Path) -> None:
    path = _write(tmp_path, REAL, PLAIN | {"c": 2493.3, "x0": 7.0, "y0": -5.0}, PLAIN)
    os.utime(path, ns=(0, 1_795_216_434_399_239_000))
    calibration = calibration_for_log(path, CAMERAS)
    assert calibration.json == path.read_bytes()
    assert list(calibration.cameras) == ["K1", "K2"], "the rig's cameras, in its order"
    message = CameraCalibration.FromString(calibration.cameras["K2"])
    assert (message.frame_id, message.width, message.height) == ("K2", WIDTH, HEIGHT)
    assert message.timestamp.ToNanoseconds() == 1_795_216_434_399_239_000
    assert message.distortion_model == "plumb_bob"
    assert list(message.D) == [0.0] * 5
    # y0 is upwards, rows are downwards
    assert list(message.K) == [2493.3, 0.0, 326.5, 0.0, 2493.3, 244.5, 0.0, 0.0, 1.0]
    assert list(message.R) == np.eye(3).ravel().tolist()
    assert np.reshape(message.P, (3, 4)).tolist() == np.column_stack(
        [np.reshape(message.K, (3, 3)), np.zeros(3)]
    ).tolist()  # fmt: skip


def _complaint(path: Path) -> str:
    with pytest.raises(BadInputError) as caught:
        calibration_for_log(path, CAMERAS)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith(f"{path}: ")
    return line.removeprefix(f"{path}: ")


def test_a_file_that_is_no_good_is_named_with_the_remedy(tmp_path: Path) -> None:
    missing = _complaint(tmp_path / "none.json")
    assert missing == 'no such file; correct "calibration" in the rig file, or remove it there'
    assert _complaint(tmp_path) == "is a directory; name the file in it"
    (tmp_path / "torn.json").write_text('{"format": "svev-adj')
    assert "not valid JSON" in _complaint(tmp_path / "torn.json")
    network = tmp_path / "network.json"
    network.write_text('{"format": "svev-network/1", "cameras": {}}')
    assert "is a network or survey, and a result of svev calibrate, orient or adjust is wanted" in _complaint(network)
    failed = _write(tmp_path, REAL, REAL, converged=False)
    assert _complaint(failed) == "this calibration has no result; calibrate again or name another file"


def test_a_camera_that_was_not_calibrated_is_named(tmp_path: Path) -> None:
    words = _complaint(_write(tmp_path, REAL))
    assert words.startswith("lacks camera K2 of the rig (it has K1); calibrate it too, ")


@pytest.mark.parametrize("c", [8.4, 35.0, 150.0])
def test_a_result_in_millimetres_is_refused(tmp_path: Path, c: float) -> None:
    words = _complaint(_write(tmp_path, REAL, PLAIN | {"c": c}))
    assert words.startswith(f"cameras.K2: c = {c:g} cannot be in pixels where images are 640 px wide; name the result")


def test_a_distortion_without_inverse_is_refused(tmp_path: Path) -> None:
    words = _complaint(_write(tmp_path, PLAIN | {"a1": -3e-6}, REAL))
    assert words.startswith("cameras.K1: the distortion cannot be undone everywhere in images of 640 x 480 px; ")
