"""The page on the network file is true: samples run, every default is the code's, both formats are read alike."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic_core import PydanticUndefined

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.network.entries import CameraEntry, ImageEntry, NetworkEntry, PointEntry
from photogrammetry.network.file import read_network
from photogrammetry.network.file_writer import laid_out, network_to_json
from photogrammetry.planning.description import read_description
from photogrammetry.planning.plan import plan_from
from photogrammetry.planning.simulated import simulated_network
from rig.settings.file import CONFIG
from rig.settings.strict_toml import StrictModel
from svev.cli import main

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "reference" / "network-file.md").read_text()
TRY_IT = PAGE.split("## Try it", 1)[1].split("\n## ", 1)[0]
PLANS = {"laboratory": "laboratory", "hill": "hill-2", "rods": "rods"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which every command of the first part has run."""
    here = tmp_path_factory.mktemp("page")
    (here / "config").symlink_to(CONFIG)
    commands = [
        line for block in re.findall(r"```sh\n(.*?)```", TRY_IT, re.DOTALL) for line in block.splitlines() if line
    ]
    assert len(commands) > 5
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(here)
        for line in commands:
            assert main([word.strip('"') for word in line.split()[1:]]) == 0, line
    return here


def _result(path: Path) -> dict[str, Any]:
    result: dict[str, Any] = json.loads(path.read_text())
    return result


def test_samples_give_what_was_planned(folder: Path) -> None:
    """Estimates are as far from the truth, which is the plan's, as their sigmas say."""
    for name, result in (("laboratory", "laboratory"), ("rods", "rods-result")):
        plan = plan_from(read_description(CONFIG / "networks" / f"{PLANS[name]}.toml")).network
        cameras = _result(folder / f"{result}.json")["cameras"]
        wrong = [(cameras[c.name]["c"] - c.interior[0]) / cameras[c.name]["sigma"]["c"] for c in plan.cameras]
        assert np.abs(wrong).max() < 4.0
    for name, result in (("hill-2", "poses"), ("hill-2", "trial-poses"), ("rods", "rods-result")):
        plan = plan_from(read_description(CONFIG / "networks" / f"{name}.toml")).network
        images = _result(folder / f"{result}.json")["images"]
        errors = np.array([images[i.name]["X0"] for i in plan.images]) - state_of(plan).position
        sigmas = np.array([images[i.name]["sigma_X0"] for i in plan.images])
        assert np.abs(errors / sigmas).max() < 4.0
        assert np.abs(errors).max() > 1e-3  # there are errors


@pytest.mark.parametrize("name", PLANS)
def test_samples_are_made_of_the_plans(name: str) -> None:
    plan = plan_from(read_description(CONFIG / "networks" / f"{PLANS[name]}.toml"))
    made = laid_out(network_to_json(simulated_network(plan, 2009)))
    assert made == (CONFIG / "networks" / f"{name}.json").read_text()
    assert made != laid_out(network_to_json(simulated_network(plan, 2010)))


def test_other_errors_by_another_seed(folder: Path) -> None:
    trial, other = (_result(folder / f"{name}.json") for name in ("trial", "other"))
    moved = [np.subtract(a[2:4], b[2:4]) for a, b in zip(trial["observations"], other["observations"], strict=True)]
    assert np.std(moved) == pytest.approx(0.33 * np.sqrt(2.0), rel=0.2)
    balls = [n for n, point in trial["points"].items() if point["role"] == "control"]
    moved = [np.subtract(trial["points"][n]["X"], other["points"][n]["X"]) for n in balls]
    assert np.std(moved) == pytest.approx(0.012 * np.sqrt(2.0), rel=0.4)
    assert all(pose["X0"] is None and pose["R"] is None for pose in trial["images"].values())


@pytest.mark.parametrize("model", [NetworkEntry, CameraEntry, ImageEntry, PointEntry])
def test_every_default_is_documented(model: type[StrictModel]) -> None:
    title = {NetworkEntry: "Every key", CameraEntry: "A camera:", ImageEntry: "An image:", PointEntry: "A point:"}[
        model
    ]
    table = PAGE.split(title, 1)[1].lstrip().split("\n\n", 1)[0]
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()[2:]]
    documented = {key: row[-1] for row in rows for key in re.findall(r"`(\w+)`", row[0])}
    assert set(documented) == set(model.model_fields)
    for key, field in model.model_fields.items():
        if field.default is PydanticUndefined:
            assert documented[key] == "needed"
        elif key != "size":  # it depends on the frame
            assert documented[key].startswith(f"`{json.dumps(field.default)}`"), key


def test_json_and_toml_are_the_same_network(tmp_path: Path) -> None:
    networks = []
    for language in ("json", "toml"):
        (text,) = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
        path = tmp_path / f"network.{language}"
        path.write_text(text)
        networks.append(network_to_json(read_network(path)))
        result = tmp_path / f"{language}-result.json"
        assert main(["adjust", str(path), "--force", "-o", str(result)]) == 0
        assert _result(result)["points"]["B1"]["X"] == pytest.approx([5.0, 0.0, 0.0], abs=0.01)
    assert networks[0] == networks[1]


def test_everything_that_is_wrong_is_said_at_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = _result(CONFIG / "networks" / "rods.json")
    data["cameras"]["K1"] = {"c": -1.0, "f": 3.0}
    data["images"]["K2-1"]["camera"] = "K9"
    data["points"]["P0"]["X"] = None
    data["observations"][3][1] = "Z9"
    data["observations"][4] = [1]
    data["distances"][0]["sigma"] = 0
    data["datum"] = {"type": "inner", "points": ["nobody"]}
    del data["image_frame"]
    path = tmp_path / "net.json"
    path.write_text(json.dumps(data))
    assert main(["adjust", str(path), "--force", "-o", str(tmp_path / "result.json")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith(f"svev: {path}: 9 things are wrong: (1) ")
    for piece in (
        'key "image_frame" is missing; add it',
        'cameras.K1: key "c" = -1.0',
        'cameras.K1: unknown key "f"',
        "images.K2-1: camera 'K9' is not listed",
        "points.P0: a fixed point needs its coordinates",
        "observations.3: point 'Z9' is not listed",
        "observations.4: [1] is no observation",
        'distances.0: key "sigma" = 0',
        "datum: point 'nobody' is not listed",
    ):
        assert piece in said


def test_an_input_is_never_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (CONFIG / "networks" / "rods.json").read_text()
    network, link = tmp_path / "net.json", tmp_path / "other.json"
    network.write_text(text)
    link.hardlink_to(network)
    plan = str(CONFIG / "networks" / "rods.toml")
    for command in (
        ["adjust", str(network), "--force", "-o", str(link)],
        ["calibrate", str(network), "--force", "-o", str(network)],
        [
            "orient",
            str(CONFIG / "networks" / "hill.json"),
            "--calibration",
            str(network),
            "--force",
            "-o",
            str(network),
        ],
        ["plan", plan, "--simulate", plan],
    ):
        assert main(command) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "is an input and would be overwritten; name another file to write" in said
    assert network.read_text() == text


def test_a_plan_is_no_network_and_a_network_no_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    networks = CONFIG / "networks"
    assert main(["adjust", str(networks / "rods.toml"), "--force", "-o", str(tmp_path / "result.json")]) == 2
    assert "is a plan, and a network or survey is wanted; svev plan" in capsys.readouterr().err
    assert main(["plan", str(networks / "rods.json")]) == 2
    assert "it is no plan; svev adjust takes networks" in capsys.readouterr().err
