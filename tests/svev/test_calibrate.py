"""`svev calibrate`: result file, report, its use by `svev orient`, exit codes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Distance, Network
from svev.cli import main
from tests.photogrammetry.synthetic import hill, lab_frame


def _run(folder: Path, network: Network, *options: str) -> int:
    write_network(network, folder / "frame.json")
    return main(["calibrate", str(folder / "frame.json"), "--force", "-o", str(folder / "cameras.json"), *options])


def test_cameras_of_a_calibration_orient_the_hill(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    lab, field = lab_frame(1), hill(1, helmets=17)
    # only what is carried over is compared: the hill was imaged by cameras of other principal points
    assert _run(tmp_path, lab.network, "--report", str(tmp_path / "report")) == 0
    result = json.loads((tmp_path / "cameras.json").read_text())
    assert set(result["cameras"]["K1"]["sigma"]) == {"c", "x0", "y0", "a1"}
    for name in ("protocol.txt", "protocol.html"):
        text = (tmp_path / "report" / name).read_text()
        assert "K1 x0" in text
        assert "Correlations" in text
    assert "camera K1: c 14" in capsys.readouterr().out
    write_network(field.network, tmp_path / "hill.json")
    options = ["--calibration", str(tmp_path / "cameras.json"), "--force", "-o", str(tmp_path / "poses.json")]
    assert main(["orient", str(tmp_path / "hill.json"), *options]) == 0
    poses = json.loads((tmp_path / "poses.json").read_text())
    for camera in ("K1", "K2", "K3"):
        assert poses["cameras"][camera]["c"] == result["cameras"][camera]["c"]
        assert poses["cameras"][camera]["a1"] == result["cameras"][camera]["a1"]


def test_json_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _run(tmp_path, lab_frame(2, points=30).network, "--json") == 0
    result = json.loads((tmp_path / "cameras.json").read_text())
    printed = json.loads(capsys.readouterr().out)
    assert printed["cameras"] == result["cameras"]
    assert printed["notes"] == result["notes"]


def test_exit_codes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    network = lab_frame(5, points=20).network
    known = tuple(replace(camera, estimate=()) for camera in network.cameras)
    assert _run(tmp_path, replace(network, cameras=known)) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "cameras.json").exists()
    o = network.observations
    alone = o.image == 0
    parts = {name: getattr(o, name)[alone] for name in ("image", "point", "xy", "sigma", "group")}
    assert _run(tmp_path, replace(network, observations=replace(o, **parts))) == 3
    assert "cameras" not in json.loads((tmp_path / "cameras.json").read_text())
    chance = np.random.default_rng(1).uniform(-300.0, 300.0, o.xy.shape)
    assert _run(tmp_path, replace(network, observations=replace(o, xy=chance))) == 4
    assert json.loads((tmp_path / "cameras.json").read_text())["converged"] is False


def test_without_a_distance_nothing_is_in_metres(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = lab_frame(3, points=30)
    assert _run(tmp_path, case.network, "--report", str(tmp_path / "report")) == 0
    printed = capsys.readouterr().out
    assert "no distance gives the scale" in printed
    assert "points: sigma 0." in printed
    assert " m (median)" not in printed
    assert json.loads((tmp_path / "cameras.json").read_text())["length_unit"] == ""
    length = float(np.linalg.norm(case.truth.xyz[0] - case.truth.xyz[7]))
    assert _run(tmp_path, replace(case.network, distances=(Distance(0, 7, length, 1e-4),))) == 0
    printed = capsys.readouterr().out
    assert "no distance gives the scale" not in printed
    assert " m (median)" in printed
    assert json.loads((tmp_path / "cameras.json").read_text())["length_unit"] == "m"
