"""Camera parameters that weak geometry hardly determines: intervals beyond the linearisation, and better minima."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.adjustment.run import adjust, settled
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.adjustment.solution.curvature import REACH, curvature
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Network
from svev.cli import main
from tests.photogrammetry.synthetic import hill, lab_frame, rods, with_state


def _weak(seed: int) -> Network:
    """The hill without helmets; c, x0, y0 of all three cameras unknown, from one image each."""
    network = hill(seed).network
    cameras = tuple(replace(camera, estimate=("c", "x0", "y0")) for camera in network.cameras)
    return replace(network, cameras=cameras)


def test_the_ends_of_an_interval_are_where_the_square_sum_has_risen_enough() -> None:
    a = adjust_once(_weak(3))
    intervals = curvature(a).intervals
    assert [(one.camera, one.parameter.name) for one in intervals] == [("K2", "y0"), ("K3", "y0")]
    for one in intervals:
        index = int(one.camera[1]) - 1
        for end in (one.low, one.high):
            network = with_state(a.network, a.state)
            points = tuple(
                replace(p, xyz=q.xyz) if p.sigma is None else q
                for p, q in zip(network.points, a.network.points, strict=True)
            )
            interior = a.state.interior[index].copy()
            interior[INTERIOR.index(one.parameter.name)] = end
            held = list(network.cameras)
            held[index] = replace(held[index], interior=interior, estimate=("c", "x0"))
            rise = (
                adjust_once(replace(network, cameras=tuple(held), points=points)).equations.square_sum
                - a.equations.square_sum
            )
            assert np.sqrt(rise) / a.ratio == pytest.approx(REACH, rel=0.05)
        low, high = (one.parameter.value - one.low, one.high - one.parameter.value)
        assert max(low, high) > 1.25 * REACH * one.parameter.sigma


def test_what_the_geometry_determines_is_not_in_doubt() -> None:
    for network in (rods(1).network, lab_frame(4).network, hill(1, noise=0.0).network):
        assert curvature(adjust_once(network)).intervals == ()


def test_a_better_minimum_is_taken() -> None:
    outcome = adjust(_weak(68))
    better = settled(outcome)
    assert better.adjustment.equations.square_sum < outcome.adjustment.equations.square_sum - 0.1


def test_adjust_and_calibrate_say_what_is_beyond_its_linearisation(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_network(_weak(3), tmp_path / "hill.json")
    assert main(["adjust", str(tmp_path / "hill.json"), "--force", "-o", str(tmp_path / "result.json")]) == 0
    assert "camera K3: y0" in (printed := capsys.readouterr().out)
    assert "is beyond its linearisation: 95 % lie between" in printed
    result = json.loads((tmp_path / "result.json").read_text())
    assert "beyond their linearisation: K2 y0, K3 y0" in result["status"]
    low, high = result["cameras"]["K3"]["interval"]["y0"]
    assert low < result["cameras"]["K3"]["y0"] < high
    assert result["cameras"]["K1"]["interval"] == {}
    write_network(lab_frame(2).network, tmp_path / "frame.json")
    assert main(["calibrate", str(tmp_path / "frame.json"), "--force", "-o", str(tmp_path / "cameras.json")]) == 0
    assert "camera K3: y0" in capsys.readouterr().out
    assert set(json.loads((tmp_path / "cameras.json").read_text())["cameras"]["K3"]["interval"]) == {"y0"}
