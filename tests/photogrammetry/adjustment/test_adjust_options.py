"""What `svev adjust` gives on request: detectable blunders, joint covariances, another datum, estimated weights."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Datum, DatumType, Network
from svev.cli import main
from tests.photogrammetry.synthetic import hill, lab_frame, rods

Run = Callable[..., dict[str, Any]]


@pytest.fixture
def run(tmp_path: Path) -> Run:
    def adjust(network: Network, *options: str, command: str = "adjust") -> dict[str, Any]:
        write_network(network, tmp_path / "network.json")
        result = tmp_path / "result.json"
        result.unlink(missing_ok=True)
        main([command, str(tmp_path / "network.json"), "--force", "-o", str(result), *options])
        return json.loads(result.read_text()) if result.exists() else {}

    return adjust


def test_detectable_blunders_are_those_of_the_definition(run: Run) -> None:
    """4.13 sigma / sqrt(r), sigma a posteriori (Baarda: significance 0.1 %, power 80 %)."""
    network = rods(1).network
    result = run(network, "--detectable")
    ratio = result["sigma0"] / network.sigma0
    seen = result["observations"][5]
    sigma = network.observations.sigma[5]
    assert seen["detectable"] == pytest.approx(4.13 * ratio * sigma / np.sqrt([seen["rx"], seen["ry"]]))
    relation = [*result["distances"], *result["differences"]]
    assert [entry["detectable"] for entry in relation] == pytest.approx(
        [4.13 * ratio * s / np.sqrt(e["r"]) for e, s in zip(relation, [0.001] * 4 + [0.02] * 10, strict=True)]
    )
    assert "detectable" not in run(network)["observations"][5]


def test_joint_covariance_has_the_points_own_blocks_and_what_is_between_them(run: Run) -> None:
    result = run(hill(1).network, "--covariance", "T*", "--covariance", "B3")
    joint = result["joint_covariance"]
    assert joint["points"] == ["B3", "T1", "T2", "T3", "T4", "T5", "T6"]
    matrix = np.array(joint["covariance"])
    assert matrix.shape == (21, 21)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0
    for i, name in enumerate(joint["points"]):
        own = matrix[3 * i : 3 * i + 3, 3 * i : 3 * i + 3]
        assert own == pytest.approx(np.array(result["points"][name]["covariance"]))
    assert np.abs(matrix[:3, 3:6]).max() > 0.0


def test_another_datum_gives_the_sigmas_that_the_file_would_give_with_it(run: Run) -> None:
    network = lab_frame(5, points=20).network
    chosen = (2, 5, 11, 17)
    names = [network.points[i].name for i in chosen]
    asked = run(network, *(word for name in names for word in ("--datum", name)))
    plain = run(network)
    there = tuple(replace(p, xyz=np.array(plain["points"][p.name]["X"])) for p in network.points)
    given = run(replace(network, points=there, datum=Datum(DatumType.INNER, chosen)))
    for name, point in asked["points"].items():
        assert point["X"] == pytest.approx(given["points"][name]["X"], abs=1e-8)
        assert point["sigma"] == pytest.approx(given["points"][name]["sigma"], rel=1e-5)
    assert asked["points"]["F1"]["sigma"] != pytest.approx(plain["points"]["F1"]["sigma"], rel=0.1)
    assert asked["points"]["F1"]["X"] == plain["points"]["F1"]["X"]
    assert [o["wx"] for o in asked["observations"]] == [o["wx"] for o in plain["observations"]]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--datum", "Q*"), '--datum: no point is called "Q*"; name points of the network'),
        (("--covariance", "Q"), '--covariance: no point is called "Q"; name points of the network'),
        (("--datum", "T*"), "--datum: nothing is free in this network"),
        (("--reweight", "--paper"), "choose one"),
    ],
)
def test_what_cannot_be_given_is_said(
    options: tuple[str, ...], message: str, run: Run, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(hill(1).network, *options) == {}
    assert message in capsys.readouterr().err


def test_two_points_are_no_datum(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(lab_frame(5, points=20).network, "--datum", "F1", "--datum", "F2") == {}
    assert "--datum: these points leave 1 of 7 conditions open" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["adjust", "orient"])
def test_weights_are_estimated_on_request(command: str, run: Run) -> None:
    """Survey sigmas five times too small: the survey gets its true weight, and sigma0 is 1."""
    network = hill(2, helmets=17).network
    points = tuple(p if p.sigma is None else replace(p, sigma=p.sigma / 5.0) for p in network.points)
    result = run(replace(network, points=points), "--reweight", command=command)
    assert result["variance_components"]["control"]["factor"] == pytest.approx(5.0, rel=0.5)
    assert result["sigma0"] == pytest.approx(1.0, abs=1e-6)
    assert "the weights are estimated from the residuals, group by group" in result["status"]
