"""A survey that cannot be read is said before the training, not after it."""

from pathlib import Path

import pytest

from rig.settings.file import CONFIG
from rig.settings.model import AnalysisSettings
from svev.doctor.examination import probes, run_probe
from svev.doctor.finding import Level
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
