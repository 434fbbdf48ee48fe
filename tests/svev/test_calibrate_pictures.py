"""`svev target` and `svev calibrate --pictures`: from a folder of pictures to files that other commands take."""

import json
import struct
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.export.camera_calibration import calibration_for_log
from analysis.scene.survey import read_survey
from photogrammetry.network.calibration_file import read_calibration
from photogrammetry.network.file import read_network
from rig.settings.camera import Region
from rig.settings.file import load_rig
from svev.cli import main
from tests.analysis.targets.drawn import Drawing, DrawnCamera, board_sheet, frame_sheets, looking, stations
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig

_CAMERA = DrawnCamera((480, 360), 600.0, 4.0, -3.0, -2e-7)


@pytest.fixture(scope="module")
def frame() -> list[NDArray[np.uint8]]:
    """Five pictures of a frame, which is enough to calibrate and too few to be praised."""
    drawing = Drawing(_CAMERA, random=np.random.default_rng(2))
    middle = np.array([0.0, 0.0, -200.0])
    poses = stations(middle, 1700.0, np.random.default_rng(3), count=5)
    return [drawing.picture(frame_sheets(), *pose) for pose in poses]


def _written(folder: Path, pictures: list[NDArray[np.uint8]], ending: str = ".png") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for n, picture in enumerate(pictures):
        assert cv2.imwrite(str(folder / f"{n}{ending}"), picture)
    return folder


def _calibrate(*arguments: str | Path) -> int:
    return main(["calibrate", "--pictures", *map(str, arguments)])


def test_pictures_become_a_calibration_that_orient_and_the_rig_take(
    tmp_path: Path, frame: list[NDArray[np.uint8]], capsys: pytest.CaptureFixture[str], loopback: Loopback
) -> None:
    folder, out = _written(tmp_path / "K1", frame), tmp_path / "out"
    (folder / "notes.txt").write_text("lens 25 mm")
    assert _calibrate(folder, "-o", out, "--distance", "T100a,T103b,860,1") == 0
    said = capsys.readouterr().out
    assert "note: K1/notes.txt is left out: it is no picture of a format that is known" in said
    assert "camera K1: good enough for 1:1000" in said
    assert "still better: take more pictures: 5 of 9 to 15" in said
    camera = read_calibration(out / "calibration.json")["K1"]
    assert camera.c == pytest.approx(600.0, abs=0.5)
    assert camera.size == [480, 360]
    rig = load_rig(write_rig(tmp_path, loopback))
    one = rig.cameras[0].model_copy(update={"region": Region(width=480, height=360)})
    assert calibration_for_log(out / "calibration.json", (one,)) is not None
    balls = tmp_path / "balls.csv"
    balls.write_text("name,X,Y,Z,sigma\n" + "".join(f"B{i},{i},{i * i},{-i},0.012\n" for i in range(6)))
    survey = tmp_path / "survey.json"
    assert main(["network", "import", str(out / "calibration.json"), str(balls), "-o", str(survey)]) == 0
    known = read_survey(survey).camera("K1")
    assert (known.size, known.estimate, known.interior[0]) == ((480, 360), (), camera.c)
    network = read_network(out / "network.json")
    assert len(network.images) == 5
    assert "Verdict" in (out / "protocol.txt").read_text()
    assert main(["calibrate", str(out / "network.json"), "-o", str(tmp_path / "again.json")]) == 0
    assert read_calibration(tmp_path / "again.json")["K1"].c == pytest.approx(camera.c, abs=1e-3)


def test_pictures_of_any_format_and_depth_give_the_same(tmp_path: Path, frame: list[NDArray[np.uint8]]) -> None:
    results: list[float] = []
    for ending, levels in ((".png", 1), (".tif", 257), (".bmp", 1), (".tiff", 16)):  # the last: 12 bits of 16
        pictures = [picture.astype(np.uint16) * levels if levels > 1 else picture for picture in frame[:4]]
        folder = _written(tmp_path / ending[1:] / "K1", pictures, ending)  # type: ignore[arg-type]
        assert _calibrate(folder, "-o", tmp_path / "out") == (2 if results else 0), "nothing is overwritten"
        assert _calibrate(folder, "-o", tmp_path / "out", "--force") == 0
        results.append(read_calibration(tmp_path / "out" / "calibration.json")["K1"].c)
    assert results[:3] == pytest.approx([results[0]] * 3, abs=1e-3)
    assert results[3] == pytest.approx(results[0], abs=0.3)  # found in other grey values: a few others, 1 sigma of c


def _with_orientation(picture: NDArray[np.uint8], orientation: int) -> bytes:
    """A JPEG whose EXIF tells viewers to turn it (TIFF 6.0, tag 274), as phones and many cameras write it."""
    done, data = cv2.imencode(".jpg", picture, (cv2.IMWRITE_JPEG_QUALITY, 98))
    assert done
    tiff = b"II*\0\x08\0\0\0" + struct.pack("<HHHIHHI", 1, 274, 3, 1, orientation, 0, 0)
    exif = b"Exif\0\0" + tiff
    return data.tobytes()[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + data.tobytes()[2:]


def test_pictures_are_measured_in_the_sensors_own_axes_whatever_their_exif_says(
    tmp_path: Path, frame: list[NDArray[np.uint8]]
) -> None:
    """Of a camera that was turned by 90 and 180 degrees for some pictures, and wrote that down."""
    folder = tmp_path / "K1"
    folder.mkdir()
    for n, picture in enumerate(frame):
        (folder / f"{n}.jpg").write_bytes(_with_orientation(picture, (6, 1, 3, 8, 6)[n]))
    shown = cv2.imread(str(folder / "0.jpg"))
    assert shown is not None
    assert shown.shape[:2] == (480, 360)  # a viewer turns it
    assert _calibrate(folder, "-o", tmp_path / "out") == 0
    camera = read_calibration(tmp_path / "out" / "calibration.json")["K1"]
    assert camera.size == [480, 360]
    assert [camera.c, camera.x0, camera.y0] == pytest.approx([600.0, 4.0, -3.0], abs=0.5)


def test_circles_are_calibrated_by_as_corners_are_without_a_word(tmp_path: Path) -> None:
    drawing = Drawing(_CAMERA, random=np.random.default_rng(2))
    sheets = frame_sheets(target_mm=110.0, step=50.0, circles=True)
    poses = stations(np.array([0.0, 0.0, -75.0]), 1600.0, np.random.default_rng(3), count=5)
    folder = _written(tmp_path / "K1", [drawing.picture(sheets, *pose) for pose in poses])
    assert _calibrate(folder, "-o", tmp_path / "out", "--target-mm", "110") == 0
    assert read_calibration(tmp_path / "out" / "calibration.json")["K1"].c == pytest.approx(600.0, abs=0.5)
    assert all(point.name >= "T175" for point in read_network(tmp_path / "out" / "network.json").points)


def test_json_ends_with_the_verdict(
    tmp_path: Path, frame: list[NDArray[np.uint8]], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = _written(tmp_path / "left", frame)
    assert _calibrate(folder, "-o", tmp_path / "out", "--camera", "K7", "--json") == 0
    verdict = json.loads(capsys.readouterr().out)["verdicts"]["K7"]
    assert verdict["good"] is True
    assert verdict["lens_px"] < 0.1


def _refused(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> str:
    assert _calibrate(*arguments) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_what_no_calibration_comes_of_is_refused_in_one_line(
    tmp_path: Path, frame: list[NDArray[np.uint8]], capsys: pytest.CaptureFixture[str]
) -> None:
    out = ("-o", tmp_path / "out")
    empty = tmp_path / "empty"
    empty.mkdir()
    assert "no pictures in it" in _refused(capsys, empty, *out)
    assert "no such folder, picture or log" in _refused(capsys, tmp_path / "nowhere", *out)
    one = _written(tmp_path / "one", frame[:1])
    assert "take at least six pictures" in _refused(capsys, one, *out)
    text = tmp_path / "text.txt"
    text.write_text("no picture")
    assert "is no picture and no log" in _refused(capsys, text, *out)
    mirrored = _written(tmp_path / "mirrored", [picture[:, ::-1] for picture in frame])
    assert "5 of 5 pictures show the targets in a mirror" in _refused(capsys, mirrored, *out)
    grey = _written(tmp_path / "grey", [np.full((60, 80), 90, np.uint8)] * 2)
    assert "no targets in 2 pictures" in _refused(capsys, grey, *out)
    sizes = _written(tmp_path / "sizes", [*frame[:2], cv2.resize(frame[2], (960, 720))])  # type: ignore[list-item]
    assert "480 x 360 px" in (said := _refused(capsys, sizes, *out))
    assert "one folder for each camera and size" in said
    turned = _written(tmp_path / "turned", [*frame[:2], np.rot90(frame[2])])
    assert "a program has turned one of them; take the files as the camera wrote them" in _refused(capsys, turned, *out)
    log = tmp_path / "bad.mcap"
    log.write_bytes(b"no log")
    assert "bad.mcap" in _refused(capsys, log, *out)
    assert "write corner,corner,mm" in _refused(capsys, one, *out, "--distance", "T100a-T101b")
    assert "for instance 9x6" in _refused(capsys, one, *out, "--board", "nine")
    assert main(["calibrate", str(one)]) == 2
    assert f"{one}: holds pictures and is no network file; add --pictures" in capsys.readouterr().err
    phone = tmp_path / "phone"
    phone.mkdir()
    (phone / "IMG_1.HEIC").write_bytes(b"\0\0\0\x18ftypheic")
    said = _refused(capsys, phone, *out)
    assert "no pictures in it that can be read (phone/IMG_1.HEIC is left out" in said
    assert "save them as PNG, TIFF or JPEG" in said
    five = _written(tmp_path / "five", frame)
    said = _refused(capsys, five, *out, "--distance", "T106a,T106b,8")
    assert "T106a and T106b are about 80 mm apart by the nominal size of the targets, not 8; give it in mm" in said


def test_a_mirrored_picture_a_copy_and_a_target_that_is_there_twice_are_left_out(
    tmp_path: Path, frame: list[NDArray[np.uint8]], capsys: pytest.CaptureFixture[str]
) -> None:
    sheets = frame_sheets()
    twice = [*sheets[:15], replace(sheets[0], place=np.array([390.0, 390.0, 0.0]), axes=np.eye(3))]
    drawing = Drawing(_CAMERA, random=np.random.default_rng(2))
    both = drawing.picture(twice, *looking(np.array([0.0, 0.0, -200.0]), 1700.0, along=5.0, up=5.0, roll=0.0))
    folder = _written(tmp_path / "K1", [*frame, frame[0][:, ::-1], both, frame[1]])
    assert _calibrate(folder, "-o", tmp_path / "out") == 0
    said = capsys.readouterr().out
    assert "note: K1/5.png is left out: it shows the targets in a mirror" in said
    assert "note: K1/7.png is left out: it is a copy of K1/1.png" in said
    assert "note: target 100 is left out: it is twice in K1/6.png" in said
    assert "T100a" not in (tmp_path / "out" / "network.json").read_text()


def test_a_board_of_other_squares_is_noticed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawing = Drawing(_CAMERA)
    pose = looking(np.zeros(3), 420.0, along=20.0, up=10.0, roll=5.0)
    folder = _written(tmp_path / "K1", [drawing.picture([board_sheet()], *pose)])
    assert "say how many it has" in _refused(capsys, folder, "-o", tmp_path / "out", "--board", "8x7")


def test_targets_are_printed_as_asked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["target", "-o", str(tmp_path / "print"), "--targets", "3"]) == 0
    said = capsys.readouterr().out
    assert "targets.pdf: 2 pages" in said
    assert "circles.pdf: 2 pages" in said
    assert "print at 100 %" in said
    for name in ("board.pdf", "targets.pdf", "circles.pdf"):
        assert (tmp_path / "print" / name).read_bytes().startswith(b"%PDF-1.4")
    assert main(["target", "-o", str(tmp_path), "--board", "40x30"]) == 2


def test_a_network_is_calibrated_without_image_processing() -> None:
    loaded = subprocess.run(
        [sys.executable, "-c", "import sys, svev.commands.networks.calibrate; print(*sys.modules)"],
        capture_output=True, text=True, timeout=60, check=True,
    ).stdout.split()  # fmt: skip
    assert not {"cv2", "analysis.targets.detection"} & set(loaded)
