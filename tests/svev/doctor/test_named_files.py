"""A survey that cannot be read is said before the training, not after it."""

import json
from pathlib import Path

import pytest

from rig.settings.file import CONFIG
from rig.settings.model import AnalysisSettings, RigSettings, SimulationSettings
from svev.doctor.examination import probes, run_probe
from svev.doctor.finding import Level
from tests.analysis.scene.hill import survey_json, training
from tests.support.rigs import SIM


@pytest.mark.parametrize("key", ["survey", "calibration"])
def test_a_misspelt_file_is_a_failure(tmp_path: Path, key: str) -> None:
    settings = AnalysisSettings.model_validate({key: tmp_path / "hil.json"})
    rig = SIM.model_copy(update={"analysis": settings})
    (probe,) = (probe for probe in probes(rig, tmp_path) if probe.name == "survey")
    (found,) = run_probe(probe)
    assert found.level is Level.FAIL
    assert str(tmp_path / "hil.json") in found.what
    assert "no jump is measured before that" in found.remedy


def test_a_rig_that_measures_nothing_is_asked_for_nothing(tmp_path: Path) -> None:
    rig = SIM.model_copy(update={"analysis": None})
    (probe,) = (probe for probe in probes(rig, tmp_path) if probe.name == "survey")
    assert run_probe(probe) == []


@pytest.mark.parametrize(
    ("key", "consequence"), [("calibration", "nothing can be recorded"), ("plan", "cannot help to aim")]
)
def test_every_file_that_the_rig_file_names_is_opened(tmp_path: Path, key: str, consequence: str) -> None:
    rig = SIM.model_copy(update={key: tmp_path / "hil.json"})
    (probe,) = (probe for probe in probes(rig, tmp_path) if probe.name == key)
    (found,) = run_probe(probe)
    assert found.level is Level.FAIL
    assert consequence in found.what
    assert str(tmp_path / "hil.json") in found.what


def test_a_plan_that_can_be_read_is_named(tmp_path: Path) -> None:
    plan = CONFIG / "networks" / "hill-1.toml"
    rig = SIM.model_copy(update={"plan": plan})
    (probe,) = (probe for probe in probes(rig, tmp_path) if probe.name == "plan")
    assert [(found.level, found.what) for found in run_probe(probe)] == [(Level.PASS, f"cameras are aimed by {plan}")]


def _look(rig: RigSettings, name: str, folder: Path) -> list[tuple[Level, str]]:
    (probe,) = (probe for probe in probes(rig, folder) if probe.name == name)
    return [(found.level, found.what) for found in run_probe(probe)]


def test_a_scenario_that_cannot_be_read_or_lacks_a_camera_is_a_failure(tmp_path: Path) -> None:
    scenario = tmp_path / "hill.toml"
    rig = SIM.model_copy(update={"simulation": SimulationSettings(scenario=scenario)})
    ((level, what),) = _look(rig, "scenario", tmp_path)
    assert level is Level.FAIL
    assert what.startswith(f"nothing can be simulated: {scenario}: no such file")
    scenario.write_text(f'base = "{CONFIG / "scenarios" / "training.toml"}"\n')
    assert _look(rig, "scenario", tmp_path) == [(Level.PASS, f"the simulated hill is that of {scenario}")]
    other = rig.model_copy(update={"cameras": (rig.cameras[0].model_copy(update={"name": "left"}),)})
    assert 'has no camera "left"' in _look(other, "scenario", tmp_path)[0][1]


def test_a_survey_of_other_cameras_or_of_none_is_a_failure(tmp_path: Path) -> None:
    path = tmp_path / "hill.json"
    path.write_text(json.dumps(survey_json(training(), seed=1)))
    rig = SIM.model_copy(update={"analysis": AnalysisSettings(survey=path)})
    assert _look(rig, "survey", tmp_path) == [(Level.PASS, f"jumps are measured by {path}")]
    renamed = rig.cameras[0].model_copy(update={"name": "left"})
    ((level, what),) = _look(rig.model_copy(update={"cameras": (renamed, *rig.cameras[1:])}), "survey", tmp_path)
    assert level is Level.FAIL
    assert what.startswith(f"left cannot measure: {path}: camera left of the log is missing (there: K1, K2, K3)")
    path.write_text(json.dumps(json.loads(path.read_text()) | {"cameras": {}, "images": {}}))
    assert "holds no camera; make a survey of calibration and balls" in _look(rig, "survey", tmp_path)[0][1]
