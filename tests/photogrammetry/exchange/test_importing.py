"""Files of other programs: what is carried over projects as the other program does, and comes back as it was."""

import json
import random
import re
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from photogrammetry.exchange.importing import import_network
from photogrammetry.geometry.camera_model import image_point
from photogrammetry.network.file import read_network
from photogrammetry.network.file_writer import metric_to_pixel
from photogrammetry.network.model import Network, Role
from rig.arrays import Floats
from rig.errors import BadInputError
from svev.cli import main
from tests.photogrammetry.exchange.written import (
    AICON,
    AICON_ROTATION,
    SIZE,
    coordinates,
    photomodeler_text,
    write_aicon,
    write_colmap,
    write_opencv,
)
from tests.photogrammetry.synthetic import hill

K = np.array([[1420.0, 0.0, 325.5], [0.0, 1420.0, 231.25], [0.0, 0.0, 1.0]])
D = np.array([-0.31, 0.22, 0.0013, -0.0007, 0.4])
XYZ = np.random.default_rng(1).uniform((-0.75, -0.5, 3.6), (0.75, 0.5, 4.4), (60, 3))  # as the camera sees it
TURN = np.array([0.2, -1.1, 0.7])
SHIFT = np.array([0.3, -0.2, 0.5])


def _projected(network: Network, xyz: Floats, camera: int = 0) -> Floats:
    """Pixel coordinates of points in the network's first image."""
    image = network.images[0]
    assert image.position is not None
    assert image.rotation is not None
    lens = network.cameras[camera].lens()
    return metric_to_pixel(np.asarray(image_point(lens, image.rotation, image.position, xyz)), SIZE)


@pytest.mark.parametrize("ending", [".yml", ".json"])
@pytest.mark.parametrize(
    ("matrix", "coefficients", "within_px"),
    [
        (K, D, 1e-9),
        (K, D[:4], 1e-9),
        (K * [[1.002], [1.0], [1.0]], D, 4e-3),  # fx and fy differ: affinity acts beside the distortion
        (K, np.array([-0.2, 0.1, 1e-3, 2e-4, 0.0, 0.05, 0.02, 0.01]), 1e-6),  # a rational lens
    ],
    ids=["exact", "four coefficients", "oblong pixels", "rational"],
)
def test_opencv_projects_the_same(
    ending: str, matrix: Floats, coefficients: Floats, within_px: float, tmp_path: Path
) -> None:
    rotation, _ = cv2.Rodrigues(TURN)
    xyz = (XYZ - SHIFT) @ rotation  # x = R X + t
    expected = cv2.projectPoints(xyz, TURN, SHIFT, matrix, coefficients)[0][:, 0]
    assert ((expected > 0.0) & (expected < SIZE)).all()
    pose = np.concatenate((TURN, SHIFT))[None]
    board = {"extrinsic_parameters": pose, "image_points": expected[None], "grid_points": xyz[:, None]}
    path = write_opencv(tmp_path / f"K1{ending}", matrix, coefficients, **board)
    imported = import_network([path], sigma=0.2)
    assert np.abs(_projected(imported.network, xyz) - expected).max() < within_px
    lost = [float(n) for note in imported.notes for n in re.findall(r"differ from OpenCV's by up to (\S+) px", note)]
    assert bool(lost) == (within_px > 1e-6)
    assert all(1e-6 < each < within_px for each in lost)
    observed = imported.network.observations
    assert metric_to_pixel(observed.xy, SIZE) == pytest.approx(expected, abs=1e-9)
    assert np.all(observed.sigma == 0.2)
    assert [point.xyz for point in imported.network.points] == [pytest.approx(each) for each in xyz]


def test_what_opencv_has_and_the_network_not_is_refused(tmp_path: Path) -> None:
    prism = np.append(np.zeros(8), [1e-3, 0.0, 0.0, 0.0])
    with pytest.raises(BadInputError, match="thin prism and tilted sensor cannot be carried over"):
        import_network([write_opencv(tmp_path / "prism.yml", K, prism)])
    with pytest.raises(BadInputError, match="fisheye"):
        import_network([write_opencv(tmp_path / "fish.yml", K, D[:4], fisheye_model=1)])
    (tmp_path / "none.yml").write_text("%YAML:1.0\n---\nimage_width: 640\n")
    with pytest.raises(BadInputError, match="no 3 x 3 matrix"):
        import_network([tmp_path / "none.yml"])
    text = write_opencv(tmp_path / "size.yml", K, D).read_text().replace("image_width", "other")
    (tmp_path / "size.yml").write_text(text)
    with pytest.raises(BadInputError, match="image size is missing"):
        import_network([tmp_path / "size.yml"])


def test_calibrations_and_surveyed_balls_are_a_survey_for_logs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("K1", "K2"):
        write_opencv(tmp_path / f"{name}.yml", K, D)
    (tmp_path / "balls.csv").write_text("Name;X;Y;Z;Sigma\nB1;0,523;-2,874;-1,871;0,012\nB2;1;2;3;0,02\n")
    (tmp_path / "more.csv").write_text("B3,1,2,3,0.01,0.02,0.03\n# measured on Tuesday\nB4,1.0,2.5,3,0.01,0.02,0.03\n")
    files = [str(tmp_path / name) for name in ("K1.yml", "K2.yml", "balls.csv", "more.csv")]
    assert main(["network", "import", *files, "--force", "-o", str(tmp_path / "hill.json"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["cameras"], said["images"], said["points"], said["observations"]) == (2, 0, 4, 0)
    network = read_network(tmp_path / "hill.json")
    assert [camera.name for camera in network.cameras] == ["K1", "K2"]
    first, _, third, _ = network.points
    assert (first.name, first.role) == ("B1", Role.CONTROL)
    assert first.xyz == pytest.approx([0.523, -2.874, -1.871])
    assert first.sigma == pytest.approx([0.012] * 3)
    assert third.sigma == pytest.approx([0.01, 0.02, 0.03])


def test_a_colmap_model_comes_back_as_it_was(tmp_path: Path) -> None:
    network = hill(1).network
    imported = import_network([write_colmap(tmp_path / "model", network)], sigma=0.4)
    again = imported.network
    for before, after in zip(network.images, again.images, strict=True):
        assert after.name == f"{before.name}.jpg"
        assert after.camera == before.camera
        assert after.position == pytest.approx(np.asarray(before.position), abs=1e-9)
        assert after.rotation == pytest.approx(np.asarray(before.rotation), abs=1e-12)
    assert again.observations.xy == pytest.approx(network.observations.xy, abs=1e-9)
    assert [again.points[i].name for i in again.observations.point] == [str(i + 7) for i in network.observations.point]
    assert coordinates(again) == pytest.approx(coordinates(network), abs=1e-12)
    assert any("0.4 px assumed" in note for note in imported.notes)
    assert any("neither scale nor axes" in note for note in imported.notes)


def test_colmap_projects_as_opencv_does(tmp_path: Path) -> None:
    """COLMAP's OPENCV model is OpenCV's, with pixels counted from the corner."""
    network = import_network([write_colmap(tmp_path / "model", hill(1).network)]).network
    image = network.images[0]
    assert image.rotation is not None
    down = image.rotation.T * np.array([[1.0], [-1.0], [-1.0]])
    xyz = (XYZ * [2.0, 2.0, 10.0]) @ down + image.position
    camera = network.cameras[0].interior
    matrix = np.array([[camera[0], 0.0, 319.5 + camera[1]], [0.0, camera[0], 239.5 - camera[2]], [0.0, 0.0, 1.0]])
    turn, _ = cv2.Rodrigues(down)
    expected = cv2.projectPoints(xyz, turn, -down @ image.position, matrix, np.array([-0.01, 0.02, 1e-4, 2e-4]))[0][
        :, 0
    ]
    assert np.abs(_projected(network, xyz) - expected).max() < 1e-9


def test_a_photomodeler_export_comes_back_as_it_was(tmp_path: Path) -> None:
    network = hill(1).network
    path = tmp_path / "export.txt"
    path.write_text(photomodeler_text(network))
    again = import_network([path], sigma=0.5).network
    assert [image.name for image in again.images] == [image.name for image in network.images]
    for before, after in zip(network.images, again.images, strict=True):
        assert after.position == pytest.approx(np.asarray(before.position), abs=1e-9)
        assert after.rotation == pytest.approx(np.asarray(before.rotation), abs=1e-9)
    scale = 7.2 / 640.0
    assert again.observations.xy == pytest.approx(scale * network.observations.xy, abs=1e-9)
    assert again.observations.sigma[0] == pytest.approx([0.33 * scale, 0.5 * scale])
    roles = [point.role for point in network.points]
    assert [point.role for point in again.points] == [r if r is Role.CONTROL else Role.TIE for r in roles]
    camera = again.cameras[again.images[0].camera]
    assert camera.interior[1:] == pytest.approx([0.05, 0.02, -2e-4, 0.0, 0.0, -1e-5, 2e-5, 0.0, 0.0], abs=1e-12)


def test_photomodelers_camera_is_that_of_a_published_calibration(tmp_path: Path) -> None:
    """The calibration of camcal, in PhotoModeler's terms and as its authors give it: all signs are right."""
    inner = "7.456995 3.615462 2.613293 7.25319 5.43764 4.588607e-3 -4.513510e-5 -2.052534e-6 -6.12803e-5 -4.41171e-5"
    head = "Bundle Soln\n0.0005 20 2272 1704\n1\n7.5 3.6 2.6 7.25319 5.43764 0 0 0 0 0\n0\n"
    pose = "0 P1.JPG\n0 0.454947 1.793849 1.468066 -179.838467 -1.183179 -39.413082\n0 0 0 0 0 0 0\n\n"
    (tmp_path / "camcal.txt").write_text(head + pose + f"0 {inner}\n0 {'0 ' * 10}\n\n\n\n\n")
    network = import_network([tmp_path / "camcal.txt"]).network
    figures = json.loads((Path(__file__).parents[1] / "data" / "camcal" / "expected.json").read_text())["figures"]
    mm = 5.43764 / 1704  # of a pixel
    c, _, y0, a1, a2, a3, b1, b2, _, _ = network.cameras[0].interior
    ours = {"c": c / mm, "y0": y0 / mm - 0.5, "a1": a1 * mm**2, "a2": a2 * mm**4, "a3": a3 * mm**6}
    for name, value in (ours | {"b1": b1 * mm, "b2": b2 * mm}).items():
        figure = figures[f"cameras.C4040Z.{name}"]
        assert value == pytest.approx(figure["value"], rel=0.0, abs=figure["tolerance"]), name
    r = np.asarray(network.images[0].rotation)
    assert np.degrees(np.arcsin(r[0, 2])) == pytest.approx(figures["angles_deg.1.phi"]["value"])
    assert np.degrees(np.arctan2(-r[1, 2], r[2, 2])) == pytest.approx(figures["angles_deg.1.omega"]["value"])
    assert np.degrees(np.arctan2(-r[0, 1], r[0, 0])) == pytest.approx(figures["angles_deg.1.kappa"]["value"])


def test_files_of_aicon(tmp_path: Path) -> None:
    network = import_network(write_aicon(tmp_path)).network
    (camera,) = network.cameras
    assert camera.interior.tolist() == [28.5, 0.05, -0.03, -1.0e-4, 1.5e-7, 0.0, 1e-6, 2e-6, 1e-4, -2e-4]
    assert (camera.balance, camera.distortion.value) == (9.5, "measured")
    first, second = network.images
    assert first.rotation == pytest.approx(AICON_ROTATION)
    assert second.position == pytest.approx([4.0, 5.0, 6.0])
    assert network.observations.xy.tolist() == [[1.25, -2.5], [1.5, 2.5], [0.0, 0.0]]
    assert network.observations.sigma.tolist() == [[0.001, 0.002], [0.001, 0.002], [0.001, 0.001]]
    assert [(p.name, p.role) for p in network.points] == [("T1", Role.CONTROL), ("T2", Role.TIE)]


def _refused(files: Callable[[], list[Path]], pattern: str) -> None:
    with pytest.raises(BadInputError, match=pattern) as refused:
        import_network(files())
    assert "\n" not in str(refused.value)


def test_what_does_not_fit_together_is_refused(tmp_path: Path) -> None:
    _refused(
        lambda: write_aicon(tmp_path, **{"points.phc": "1 T1 1.25 -2.5\n"}), "line 1: sigma is missing; .*--sigma-mm"
    )
    two = AICON["cams.ior"] + "8 -20 0 0\n"
    _refused(lambda: write_aicon(tmp_path, **{"cams.ior": two})[::2], "which of 2 cameras took image '1'")
    _refused(
        lambda: [*write_aicon(tmp_path), write_opencv(tmp_path / "K1.yml", K, D)],
        "counts in pixels and .* in millimetres",
    )
    _refused(lambda: write_aicon(tmp_path, **{"points.obc": "T1 1 x -8\n"}), "line 1, column y: 'x' is no number")
    wide = "1 7 1 2 3 0.1 0.2 0.3\n"
    _refused(
        lambda: write_aicon(tmp_path, **{"poses.eor": wide}),
        "8 columns, but only image, camera.* name them in the first",
    )
    (tmp_path / "a.csv").write_text("B1,1.0,2,3\n")
    _refused(lambda: [tmp_path / "a.csv"], "line 1: sigma is missing")
    (tmp_path / "b.csv").write_text("B1,1,2,3,0.1\nB1,1,2,4,0.1\n")
    _refused(lambda: [tmp_path / "b.csv"], "line 2: 'B1' is there twice")
    (tmp_path / "c.xyz").write_text("")
    _refused(lambda: [tmp_path / "c.xyz"], "endings are")
    (tmp_path / "d.txt").write_text("something else\n")
    _refused(lambda: [tmp_path / "d.txt"], "is no text export of PhotoModeler")
    model = write_colmap(tmp_path / "model", hill(1).network, "OPENCV_FISHEYE 640 480 1 1 1 1 0 0 0 0")
    _refused(lambda: [model], "OPENCV_FISHEYE cannot be carried over")
    (model / "cameras.txt").write_text("1 SIMPLE_RADIAL 640 480 1 320 240 1e300\n")
    _refused(lambda: [model], "line 1: the distortion .*calibrate again")
    (model / "images.txt").write_text("1 0 0 0 0 1 2 3 1 a.jpg\n")
    _refused(lambda: [model / "images.txt"], "line 1: a quaternion of zeros")
    _refused(lambda: [tmp_path], "has none of cameras.txt")


def test_the_imported_is_adjusted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """COLMAP's model with the survey of its points: the command, then the adjustment."""
    network = hill(1).network
    model = write_colmap(tmp_path / "model", network, "SIMPLE_PINHOLE 640 480 {c} {cx} {cy}")
    balls = [
        f"{i + 7},{','.join(map(str, p.xyz))},0.012"
        for i, p in enumerate(network.points)
        if p.sigma is not None and p.xyz is not None
    ]
    (tmp_path / "balls.csv").write_text("name,X,Y,Z,sigma\n" + "\n".join(balls) + "\n")
    made = tmp_path / "net.json"
    assert (
        main(
            [
                "network",
                "import",
                str(model),
                str(tmp_path / "balls.csv"),
                "--sigma",
                "0.33",
                "--force",
                "-o",
                str(made),
            ]
        )
        == 0
    )
    assert "note: COLMAP writes no accuracy of image points: 0.33 px assumed" in capsys.readouterr().out
    assert main(["orient", str(made), "--force", "-o", str(tmp_path / "poses.json")]) == 0
    result = json.loads((tmp_path / "poses.json").read_text())
    assert result["global_test"]["verdict"] == "agrees"
    assert main(["network", "import", str(model), "--force", "-o", str(model / "images.txt")]) == 2
    assert "is an input and would be overwritten" in capsys.readouterr().err


_ODD = ("nan", "1e400", "-1", "0", "", "x", "1e300", "9" * 30, "[", "}", "é", "1e-320", "\x00", "null", "true")


@pytest.mark.parametrize("kind", ["colmap", "photomodeler", "opencv", "aicon", "survey"])
def test_a_spoilt_file_is_read_or_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    """Words exchanged, lost and added at random; never a crash, and never a warning of numpy."""
    network, chance = hill(1).network, random.Random(kind)
    board = {"extrinsic_parameters": np.ones((2, 6)), "image_points": np.ones((2, 3, 2))}
    (tmp_path / "export.txt").write_text(photomodeler_text(network))
    (tmp_path / "balls.csv").write_text("name,X,Y,Z,sigma\nB1,1,2,3,0.1\nB2,1,2,4,0.1\n")
    files = {
        "colmap": list(write_colmap(tmp_path / "model", network).iterdir()),
        "photomodeler": [tmp_path / "export.txt"],
        "opencv": [write_opencv(tmp_path / "K1.yml", K, D, **board)],
        "aicon": write_aicon(tmp_path),
        "survey": [tmp_path / "balls.csv"],
    }[kind]
    said = []
    for _ in range(60):
        path = chance.choice(sorted(files))
        text = path.read_text()
        words = re.split(r"(\s+|,|;)", text)
        for _ in range(chance.choice((1, 1, 2, 5))):
            place = chance.randrange(len(words))
            words[place : place + chance.choice((0, 1, 1, 40))] = [chance.choice(_ODD)]
        path.write_text("".join(words))
        try:
            import_network(files, sigma=0.5, sigma_mm=0.001)
        except BadInputError as error:
            said.append(str(error))
        path.write_text(text)
    assert len(said) > 10
    assert "\n" not in "".join(said)
