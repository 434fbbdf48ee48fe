"""`svev demo` from the command line: it makes all files that its help names, and their content is true."""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import pytest

from analysis.scene.survey import read_survey
from bench.analysis.hill_logs import write_hill_log
from recorder.log.beside import truth_path
from rig.settings.file import CONFIG
from simrig.world.scenario import load_scenario
from svev.demo import _showing
from svev.demo_analysis import measure
from tests.support.commands import run_svev


@pytest.mark.parametrize(
    "bus", ["gige", pytest.param("firewire", marks=pytest.mark.long), pytest.param("sim", marks=pytest.mark.long)]
)
def test_the_demo_records_publishes_verifies_and_shows(tmp_path: Path, bus: str) -> None:
    options = ("--seconds", "4", "--bus", bus, "--out", str(tmp_path), "--no-analyze", "--json")
    done = run_svev("demo", *options, timeout_s=120)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["pulses"] == result["complete"] + result["partial"] == 120
    assert result["complete"] > 60, "a busy machine loses frames"
    assert result["verdict"] == ("partial" if result["partial"] else "clean")
    assert result["bytes"] == Path(result["log"]).stat().st_size
    assert result["subscriber"]["received"] == 120
    assert result["subscriber"]["missing"] == 0
    assert result["subscriber"]["bytes"] == 120 * 480 * 1920
    sheet = cv2.imread(result["contact_sheet"])
    assert sheet is not None
    assert sheet.std() > 10  # there is something to see
    truth = json.loads(Path(result["truth"]).read_text())
    pulses = truth["hill_pulse_of_recording"]
    assert list(pulses) == [str(number) for number in range(1, 121)]
    assert [pulses[str(number)] - pulses["1"] for number in range(1, 121)] == list(range(120))
    assert read_survey(Path(result["survey"])).surveyed().names[:2] == ("B1", "B2")


def test_the_demo_shows_the_scenario_that_is_asked_for() -> None:
    rig, text = _showing(CONFIG / "rigs" / "sim-gige.toml", "hard")
    assert rig.simulation is not None
    assert rig.simulation.scenario == CONFIG / "scenarios" / "hard.toml"
    assert 'scenario = "../scenarios/hard.toml"' in text
    exposures = {camera.name: camera.exposure_us for camera in load_scenario(rig.simulation.scenario).cameras}
    assert exposures == {camera.name: camera.exposure_us for camera in rig.cameras}


@pytest.mark.long
def test_a_hard_day_is_measured_with_the_survey_beside_the_log(tmp_path: Path) -> None:
    """A camera sinks, balls have fallen or are covered with snow, markers are hidden: the survey fits all the same."""
    log = write_hill_log(tmp_path / "hard", load_scenario(CONFIG / "scenarios" / "hard.toml"), range(120, 195))
    hill_pulses = {str(number): state["pulse"] for number, state in log.truth.items()}
    truth = {"hill_pulse_of_recording": hill_pulses, "pulses": list(log.truth.values())}
    truth_path(log.path).write_text(json.dumps(truth))
    found = measure(log.path, lambda _: None)
    figures = [figure for jump in found.jumps for figure in jump.figures]
    assert len(figures) == 7, found.jumps
    for figure in figures:
        assert abs(figure.measured.value - figure.true) < 5 * figure.measured.sigma + 1e-3, figure


@pytest.mark.long
def test_the_demo_measures_the_jumper_and_shows_the_truth_beside(tmp_path: Path) -> None:
    """Six seconds hold a whole jump, whenever they begin: one comes every four seconds and is in sight for 1.3 s."""
    command = [sys.executable, "-m", "svev", "demo", "--seconds", "6", "--out", str(tmp_path), "--json"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=170, check=False)
    assert done.returncode == 0, done.stderr
    analysis = json.loads(done.stdout)["analysis"]
    assert analysis["message"] == ""
    jumps = [jump for jump in analysis["jumps"] if "measured well" in jump["verdict"]]
    assert jumps, analysis["jumps"]
    figures = [figure for jump in jumps for figure in jump["figures"]]
    assert len(figures) >= 7
    for figure in figures:
        assert abs(figure["value"] - figure["true"]) < 5 * figure["sigma"] + 1e-3, figure
    assert "Take-off speed" in Path(analysis["report"]).read_text(encoding="utf-8")
