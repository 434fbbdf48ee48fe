"""`svev adjust`: result file by contract, exit codes, summary."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photogrammetry.network.file_writer import network_to_json, write_network
from photogrammetry.network.model import Datum, ImageFrame, Network, Reweight, Role
from svev.cli import main
from tests.photogrammetry.synthetic import hill, lab_frame, rods

Run = Callable[..., tuple[int, dict[str, Any]]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def adjust(network: Network, *options: str) -> tuple[int, dict[str, Any]]:
        write_network(network, tmp_path / "network.json")
        result = tmp_path / "result.json"
        code = main(["adjust", str(tmp_path / "network.json"), "--force", "-o", str(result), *options])
        return code, json.loads(result.read_text()) if result.exists() else {}

    return adjust


def _some_checked() -> Network:
    """Rods with check points among the helmets and a control point."""
    network = rods(1).network
    points = list(network.points)
    for i in (12, 13):
        points[i] = replace(points[i], role=Role.CHECK)
    points[14] = replace(points[14], role=Role.CONTROL, sigma=np.full(3, 0.3))
    return replace(network, points=tuple(points))


def test_result_has_everything_the_contract_names(run: Run) -> None:
    network = _some_checked()
    code, result = run(network)
    assert code == 0
    assert result["format"] == "svev-adjustment/1"
    assert result["converged"] is True
    assert result["n_observations"] == 2 * 77 + 4 + 10 + 3
    assert result["n_unknowns"] == 18 + 6 + 3 * 25
    assert result["n_conditions"] == 0
    assert result["redundancy"] == result["n_observations"] - result["n_unknowns"]
    assert result["sigma0"] == pytest.approx(np.sqrt(result["vTPv"] / result["redundancy"]))
    camera = result["cameras"]["K1"]
    assert set(camera["sigma"]) == {"c", "a1"}
    assert -1.0 < camera["correlations"]["c|a1"] < 1.0
    assert camera["significance"]["a1"] == pytest.approx(abs(camera["a1"]) / camera["sigma"]["a1"])
    image = result["images"]["hill-1"]
    assert [len(image[key]) for key in ("X0", "R", "sigma_X0", "sigma_angles")] == [3, 3, 3, 3]
    point = result["points"]["P11"]
    assert point["rays"] == 3
    assert np.sqrt(np.diagonal(point["covariance"])) == pytest.approx(point["sigma"])
    assert set(result["check_points"]) == {"H4", "H5"}
    given = network.points[12].xyz
    assert given is not None
    assert result["check_points"]["H4"]["delta"] == pytest.approx(np.array(result["points"]["H4"]["X"]) - given)
    assert result["check_points"]["H4"]["sigma"] == result["points"]["H4"]["sigma"]
    assert len(result["observations"]) == 77
    assert result["control"][0]["point"] == "H6"
    assert [d["from"] for d in result["distances"]] == ["P11", "P21", "P31", "P41"]
    assert result["differences"][-1]["axis"] == "Y"
    assert set(result["variance_components"]) == {"image", "control", "distance", "difference"}
    assert result["diagnosis"] == []
    total = sum(o["rx"] + o["ry"] for o in result["observations"]) + sum(result["control"][0]["r"])
    total += sum(d["r"] for d in result["distances"] + result["differences"])
    assert total == pytest.approx(result["redundancy"], abs=1e-6)
    assert result["points"]["P0"]["sigma"] == [0.0, 0.0, 0.0]


def test_residuals_and_w_are_those_of_the_definition(run: Run) -> None:
    """Adjusted - observed in pixels, y downwards, by hand from the result file alone."""
    network = hill(1).network
    _, result = run(network)
    written = json.loads(json.dumps(result))
    for i, entry in enumerate(written["observations"]):
        o = network.observations
        image, point = written["images"][entry["image"]], written["points"][entry["point"]]
        d = (np.array(point["X"]) - image["X0"]) @ np.array(image["R"])
        c = written["cameras"][image["camera"]]["c"]
        x, y = -c * d[:2] / d[2]
        assert entry["vx"] == pytest.approx(x - o.xy[i, 0], abs=1e-8)
        assert entry["vy"] == pytest.approx(-(y - o.xy[i, 1]), abs=1e-8)
        sigma = o.sigma[i, 0] * np.sqrt(entry["rx"])
        assert entry["wx"] == pytest.approx(entry["vx"] / (written["sigma0"] * sigma), rel=1e-9)


def test_metric_and_pixel_frame_give_the_same(run: Run) -> None:
    network = rods(2).network
    _, pixel = run(network)
    _, metric = run(replace(network, image_frame=ImageFrame.METRIC))
    assert metric["sigma0"] == pytest.approx(pixel["sigma0"], rel=1e-9)
    for one, other in zip(pixel["observations"], metric["observations"], strict=True):
        assert one["vx"] == pytest.approx(other["vx"], abs=1e-7)
        assert one["wy"] == pytest.approx(-other["wy"], abs=1e-6)


def test_sigma0_carries_its_unit(run: Run) -> None:
    """With another a-priori sigma0 only vTPv and sigma0 change, which have its unit."""
    network = hill(2).network
    _, one = run(network)
    _, other = run(replace(network, sigma0=0.33))
    assert other["sigma0"] == pytest.approx(0.33 * one["sigma0"])
    assert other["vTPv"] == pytest.approx(0.33**2 * one["vTPv"])
    assert other["points"]["T1"]["sigma"] == pytest.approx(one["points"]["T1"]["sigma"])
    assert other["observations"][5]["wx"] == pytest.approx(one["observations"][5]["wx"])


def test_two_runs_are_equal_to_the_last_bit(run: Run) -> None:
    network = lab_frame(5, points=20).network
    assert run(network) == run(network)


def test_rank_defect_is_diagnosed(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    code, result = run(replace(lab_frame(5, points=20).network, datum=Datum()))
    assert code == 3
    assert result["converged"] is False
    assert [entry["kind"] for entry in result["diagnosis"]] == ["datum"]
    assert sum(entry["defect"] for entry in result["diagnosis"]) == 7
    assert not {"sigma0", "points", "images", "observations"} & set(result)
    assert "no datum" in capsys.readouterr().out


def test_what_does_not_converge_gives_no_numbers(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    """Observations are random numbers that fit no network."""
    network = lab_frame(5, points=20).network
    o = network.observations
    chance = np.random.default_rng(1).uniform(-300.0, 300.0, o.xy.shape)
    code, result = run(replace(network, observations=replace(o, xy=chance)))
    assert code == 4
    assert result["converged"] is False
    assert "not converged" in result["status"]
    assert set(result) == {"format", "converged", "status", "diagnosis"}
    assert "sigma" not in capsys.readouterr().out


def test_bad_input_leaves_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "network.json").write_text('{"format": "svev-network/1"}')
    assert main(["adjust", str(tmp_path / "network.json"), "--force", "-o", str(tmp_path / "result.json")]) == 2
    assert not (tmp_path / "result.json").exists()
    assert "network.json" in capsys.readouterr().err


def test_paper_and_snoop_and_json(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    network = hill(2).network
    xy = network.observations.xy.copy()
    xy[8] += 20.0
    spoilt = replace(network, observations=replace(network.observations, xy=xy))
    code, result = run(spoilt, "--snoop", "--json")
    assert code == 0
    assert len(result["removed"]) == 1
    assert result["gross_errors"] == []
    assert len(result["observations"]) == len(xy) - 1
    printed = json.loads(capsys.readouterr().out)
    assert printed["sigma0"] == result["sigma0"]
    assert "observations" not in printed
    code, result = run(network, "--paper")
    assert code == 0
    assert result["variance_components"]["control"]["redundancy"] == 8
    _, same = run(replace(network, reweight=Reweight.PAPER))
    assert same == result
    code, _ = run(rods(1).network, "--paper")
    assert code == 2
    assert "more than 7 control points" in capsys.readouterr().err


def test_report(run: Run, tmp_path: Path) -> None:
    code, _ = run(rods(1).network, "--report", str(tmp_path / "report"))
    assert code == 0
    for name in ("protocol.txt", "protocol.html"):
        text = (tmp_path / "report" / name).read_text()
        assert "difference Y from P11 to P12" in text
        assert "K1 c" in text


def test_summary_names_the_suspect(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    network = hill(2).network
    xy = network.observations.xy.copy()
    xy[8] += (0.0, 20.0)
    run(replace(network, observations=replace(network.observations, xy=xy)))
    printed = capsys.readouterr().out
    o = network.observations
    name = f"point {network.points[o.point[8]].name} in image {network.images[o.image[8]].name}"
    assert f"{name}: wrong by about" in printed
    assert "redundancy" in printed
    assert max(len(line) for line in printed.splitlines()) < 250


def _numbers(value: Any, way: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths to all numbers of nested JSON."""
    if isinstance(value, dict):
        return [leaf for key, item in value.items() for leaf in _numbers(item, (*way, key))]
    if isinstance(value, list):
        return [leaf for i, item in enumerate(value) for leaf in _numbers(item, (*way, i))]
    return [way] if isinstance(value, (int, float)) and not isinstance(value, bool) else []


@pytest.mark.parametrize("seed", range(24))
def test_absurd_numbers_end_in_one_of_four_ways(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    data = network_to_json((hill, rods)[seed % 2](1).network)
    ways = [way for way in _numbers(data) if way[0] != "observations" or rng.random() < 0.1]
    for way in rng.permutation(len(ways))[:3]:
        *before, last = ways[way]
        place = data
        for step in before:
            place = place[step]
        place[last] = rng.choice([0.0, 1e-30, 1e12, -1e11, -1e6, 1e-10, 10.0 * place[last], -place[last]])
    (tmp_path / "network.json").write_text(json.dumps(data))
    code = main(["adjust", str(tmp_path / "network.json"), "--force", "-o", str(tmp_path / "result.json")])
    assert code in {0, 2, 3, 4}
    assert (tmp_path / "result.json").exists() == (code != 2)


def test_an_absurd_result_is_shown_and_taken_by_no_other_command(
    run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Three wrong survey points: the contract wants numbers and exit code 0, and nobody may take them for good ones."""
    network = hill(3).network
    points = list(network.points)
    for i, error in ((1, (1.0, -2.0, 0.5)), (6, (-1.5, 1.0, 1.0)), (11, (0.5, 1.5, -2.0))):
        points[i] = replace(points[i], xyz=np.asarray(points[i].xyz, dtype=float) + np.array(error))
    code, result = run(replace(network, points=tuple(points)))
    assert code == 0
    assert result["sigma0"] > 10.0
    assert result["global_test"]["usable"] is False
    assert "not to be used" in result["status"]
    assert "do not use this result" in capsys.readouterr().err
    write_network(network, tmp_path / "hill.json")
    taken = ["orient", str(tmp_path / "hill.json"), "--calibration", str(tmp_path / "result.json")]
    assert main([*taken, "--force", "-o", str(tmp_path / "poses.json")]) == 2
    assert "correct them, do not use this result" in capsys.readouterr().err
    code, result = run(network)
    assert result["global_test"]["usable"] is True
    assert capsys.readouterr().err == ""
