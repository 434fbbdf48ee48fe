"""`svev orient`: result file, report, calibration, exit codes."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photogrammetry.network.file_writer import network_to_json, write_network
from photogrammetry.network.model import ImageFrame, Network, Role
from svev.cli import main
from tests.photogrammetry.synthetic import hill
from tests.support.repeats import repeats

Run = Callable[..., tuple[int, dict[str, Any]]]


def test_nothing_to_orient_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    network = network_to_json(hill().network)
    balls = {name: point for name, point in network["points"].items() if "sigma" in point}
    path = tmp_path / "balls.json"
    path.write_text(json.dumps(network | {"images": {}, "observations": [], "points": balls}))
    assert main(["orient", str(path), "--force", "-o", str(tmp_path / "poses.json")]) == 2
    assert "has no images" in capsys.readouterr().err
    assert not (tmp_path / "poses.json").exists()


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def orient(network: Network, *options: str) -> tuple[int, dict[str, Any]]:
        write_network(network, tmp_path / "hill.json")
        result = tmp_path / "poses.json"
        code = main(["orient", str(tmp_path / "hill.json"), "--force", "-o", str(result), *options])
        return code, json.loads(result.read_text()) if result.exists() else {}

    return orient


_NAMES = ("x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2", "r0")
_LENS: dict[str, Any] = dict.fromkeys(_NAMES, 0.0) | {"distortion": "projected", "sigma": {"c": 1.9}}


def _calibration(path: Path, **changes: Any) -> Path:
    """A calibration's result: the true cameras of the hill."""
    cameras = {name: _LENS | {"c": c} for name, c in (("K1", 1419.7), ("K2", 1421.7), ("K3", 2493.3))}
    content = {"format": "svev-adjustment/1", "converged": True, "cameras": cameras} | changes
    path.write_text(json.dumps(content))
    return path


def _culprit() -> Network:
    network = hill(6, helmets=17).network
    points = list(network.points)
    points[4] = replace(points[4], xyz=np.asarray(points[4].xyz, dtype=float) + np.array([0.3, -0.2, 0.1]))
    return replace(network, points=tuple(points))


def test_result_and_report_name_the_culprit(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, result = run(_culprit(), "--report", str(tmp_path / "report"))
    assert code == 0
    assert result["format"] == "svev-adjustment/1"
    assert [len(stage["findings"]) for stage in result["stages"]] == [0, 1, 0]
    assert [gone["point"] for gone in result["removed"]] == ["B5"]
    assert set(result["check_points"]) == {"B5"}
    assert len(result["images"]["hill-1"]["sigma_X0"]) == 3
    text = (tmp_path / "report" / "protocol.txt").read_text()
    page = (tmp_path / "report" / "protocol.html").read_text()
    for words in (text, page, capsys.readouterr().out):
        assert "control point B5: wrong by about" in words
    for part in ("Stage 1: free adjustment", "Poses", "Points", "Correlations", "Residuals"):
        assert part in text
        assert part in page
    assert "http" not in page.replace('xmlns="http://www.w3.org/2000/svg"', "")  # nothing is fetched


def test_names_are_escaped_in_the_page(run: Run, tmp_path: Path) -> None:
    network = hill(1).network
    points = (replace(network.points[0], name="<script>&"), *network.points[1:])
    code, _ = run(replace(network, points=points), "--report", str(tmp_path / "report"))
    assert code == 0
    page = (tmp_path / "report" / "protocol.html").read_text()
    assert "&lt;script&gt;&amp;" in page
    assert "<script>" not in page


def test_calibration_replaces_the_cameras(run: Run, tmp_path: Path) -> None:
    network = hill(1, helmets=17).network
    wrong = tuple(
        replace(camera, interior=camera.interior * 1.1, estimate=("c",), sigma={"c": 5.0}) for camera in network.cameras
    )
    _, sound = run(network)
    code, result = run(replace(network, cameras=wrong), "--calibration", str(_calibration(tmp_path / "cameras.json")))
    assert code == 0
    assert result["images"]["hill-2"]["X0"] == pytest.approx(sound["images"]["hill-2"]["X0"], abs=1e-6)
    assert result["cameras"]["K1"]["sigma"] == {}


def test_a_calibration_in_another_unit_is_refused(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cameras in millimetres would end as a network that does not converge for want of start values."""
    network = hill(1, helmets=17).network
    other = "metric" if network.image_frame is ImageFrame.PIXEL else "pixel"
    code, _ = run(network, "--calibration", str(_calibration(tmp_path / "cameras.json", image_frame=other)))
    assert code == 2
    assert f'"image_frame" is "{other}", and cameras of "{network.image_frame}" are wanted' in capsys.readouterr().err


def test_a_camera_that_the_calibration_lacks_is_left_out(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    network = hill(1, helmets=17).network
    calibration = _calibration(tmp_path / "cameras.json")
    known = json.loads(calibration.read_text())
    del known["cameras"]["K3"]
    calibration.write_text(json.dumps(known))
    code, result = run(network, "--calibration", str(calibration))
    assert code == 0
    assert list(result["images"]) == ["hill-1", "hill-2"]
    words = "camera K3 is left out: the calibration lacks it (it has K1, K2); calibrate it too or correct the name"
    assert words in result["notes"]
    assert words in capsys.readouterr().out


def test_alternatives(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    network = hill(1, helmets=17).network
    _, static = run(network, "--alternative", "1")
    _, moving = run(network, "--alternative", "2")
    assert "H1" not in static["points"]
    assert "H1" in moving["points"]
    code, result = run(network, "--alternative", "1", "--moving", "T*", "--json")
    assert code == 0
    assert "T1" not in result["points"]
    printed = capsys.readouterr().out
    assert json.loads(printed[printed.rindex("\n{\n") :])["stages"] == result["stages"]
    assert main(["orient", "none.json", "--force", "-o", "out.json", "--alternative", "3"]) == 2


def test_paper_weights(run: Run) -> None:
    code, result = run(hill(2, helmets=17).network, "--paper")
    assert code == 0
    assert result["variance_components"]["control"]["redundancy"] == 8
    assert not any("left out" in stage["words"] for stage in result["stages"])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"converged": False}, "has no result"),
        ({"cameras": {}}, "cameras.K1: the calibration lacks it"),
        (
            {"cameras": {"K1": _LENS | {"c": 1419.7, "size": [1936, 1216]}}},
            "cameras.K1: was calibrated with images of 1936 x 1216 px, those of the network have 640 x 480 px",
        ),
        ({"cameras": {"K1": 3}}, "cameras.K1: is no object"),
        ({"cameras": {"K1": {"c": -1.0}}}, "cameras.K1"),
        ({"format": "svev-network/1"}, "is a network or survey, and a result of svev calibrate"),
    ],
)
def test_bad_calibration_is_one_line(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str], content: dict[str, Any], words: str
) -> None:
    calibration = _calibration(tmp_path / "cameras.json", **content)
    code, result = run(hill(1).network, "--calibration", str(calibration))
    assert (code, result) == (2, {})
    complaint = capsys.readouterr().err
    assert words in complaint
    assert complaint.count("\n") == 1


def test_other_bad_input_is_one_line(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _ = run(hill(1).network, "--calibration", str(tmp_path / "none.json"))
    assert code == 2
    code, _ = run(hill(1).network, "--moving", "Q*")
    assert code == 2
    code, _ = run(hill(1).network, "--report", str(tmp_path / "hill.json"))
    assert code == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3
    assert all(line.startswith("svev: ") for line in lines)


def test_no_reference_points_is_not_solvable(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    network = hill(1).network
    loose = tuple(replace(point, role=Role.TIE, sigma=None) for point in network.points)
    code, result = run(replace(network, points=loose))
    assert code == 3
    assert result["converged"] is False
    assert "points" not in result
    assert "datum" in capsys.readouterr().out


@pytest.mark.parametrize("seed", repeats((1, 4, 11, *range(2, 4), *range(5, 11), 0), quick=3))
def test_absurd_numbers_end_in_one_of_four_ways(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    data = network_to_json(hill(1, helmets=5).network)
    for _ in range(3):
        point = data["points"][f"B{rng.integers(1, 16)}"]
        point[rng.choice(["X", "sigma"])][rng.integers(3)] = rng.choice([1e-30, 1e12, 1e6, 1e-10, 7.0])
        data["observations"][rng.integers(40)][rng.integers(2, 5)] = rng.choice([1e-30, 1e12, 1e6, 7.0])
    (tmp_path / "hill.json").write_text(json.dumps(data))
    assert main(["orient", str(tmp_path / "hill.json"), "--force", "-o", str(tmp_path / "poses.json")]) in {0, 2, 3, 4}


def test_chance_does_not_converge(run: Run) -> None:
    network = hill(1).network
    o = network.observations
    chance = np.random.default_rng(1).uniform(-200.0, 200.0, o.xy.shape)
    code, result = run(replace(network, observations=replace(o, xy=chance)))
    assert code in {3, 4}
    assert "images" not in result
