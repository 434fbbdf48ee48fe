"""Likely mistakes of a first day: each is one line that says what to do."""

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from analysis.scene.orientation import orient_images
from analysis.scene.survey import read_survey
from photogrammetry.network.calibration_file import read_calibration
from photogrammetry.network.file import read_network
from rig.errors import BadInputError
from rig.settings.file import CONFIG
from svev.cli import main
from tests.analysis.scene.hill import survey_json, training, training_images
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig

Change = Callable[[dict[str, Any]], None]


def _sigmas_in_mm(survey: dict[str, Any]) -> None:
    survey["points"]["B3"]["sigma"] = [12, 12, 12]


def _c_in_mm(survey: dict[str, Any]) -> None:
    survey["cameras"]["K2"]["c"] = 8.0


def _decimal_comma(survey: dict[str, Any]) -> None:
    survey["points"]["B1"]["X"] = [0, 81, -3.09, -1.51]


def _no_cameras(survey: dict[str, Any]) -> None:
    survey["cameras"] = {}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_sigmas_in_mm, "the sigma of ball B3 is 12.0 m, by which nothing can be named; write sigmas in metres"),
        (_c_in_mm, "camera K2 has c = 8.0 px, so its picture of 640 px would be 177 degrees wide; write c in px"),
        (_decimal_comma, "4 values, 3 at most; correct it, decimals are written with a point"),
        (_no_cameras, "holds no camera; make a survey of calibration and balls: svev network import"),
    ],
    ids=["sigmas in mm", "c in mm", "decimal comma", "no cameras"],
)
def test_a_survey_with_a_usual_mistake(tmp_path: Path, change: Change, words: str) -> None:
    survey = survey_json(training(), seed=1)
    change(survey)
    path = tmp_path / "survey.json"
    path.write_text(json.dumps(survey))
    with pytest.raises(BadInputError, match=path.name) as refused:
        read_survey(path)
    assert words in str(refused.value)


def test_the_survey_of_another_hill_is_told_once(tmp_path: Path) -> None:
    survey = survey_json(training(), seed=1)
    survey["cameras"] = {f"cam{name}": camera for name, camera in survey["cameras"].items()}
    path = tmp_path / "survey.json"
    path.write_text(json.dumps(survey))
    with pytest.raises(BadInputError) as refused:
        orient_images(training_images(), read_survey(path))
    said = str(refused.value)
    assert "has none of the log's cameras K1, K2, K3 (there: camK1, camK2, camK3)" in said
    assert said.count("survey.json") == 1


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("svev-truth/1", "is the truth of a simulated recording, and a network or survey is wanted; name another file"),
        ("svev-adjustment/1", "is a result of svev calibrate, orient or adjust, and a network or survey is wanted; of"),
    ],
)
def test_another_file_of_ours(tmp_path: Path, kind: str, words: str) -> None:
    path = tmp_path / "file.json"
    path.write_text(json.dumps({"format": kind, "observations": [1], "cameras": {}}))
    for read in (read_survey, read_network):
        with pytest.raises(BadInputError, match=words):
            read(path)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (
            ["analyze", "no.mcap", "--survey", "{scenario}", "--out", "out"],
            "is a scenario of the simulated hill, and a",
        ),
        (
            ["analyze", "no.mcap", "--survey", "{rig}", "--out", "out"],
            "is a rig file, and a network or survey is wanted",
        ),
        (["analyze", "no.mcap", "--survey", "{foreign}", "--out", "out"], "svev network import {foreign} balls.csv -o"),
        (["adjust", "{scenario}", "-o", "out.json"], "is a scenario of the simulated hill, and a network or survey is"),
        (["plan", "{scenario}"], "is a scenario of the simulated hill, and a plan is wanted; a rig file names it"),
        (["plan", "{rig}"], "is a rig file, and a plan is wanted; name another file"),
        (
            ["doctor", "--rig", "{scenario}"],
            "is a scenario of the simulated hill, and a rig file is wanted; a rig file",
        ),
        (
            ["doctor", "--rig", "{plan}"],
            "is a plan, and a rig file is wanted; svev plan {plan} --simulate NETWORK.json",
        ),
        (["doctor", "--rig", "{network}"], "is JSON, and a rig file is TOML; name another file"),
        (["orient", "{network}", "-o", "{folder}"], "{folder}: is a folder; name a file in it"),
    ],
)
def test_another_file_that_people_write(
    command: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign = tmp_path / "cameras.toml"
    foreign.write_text("[K1]\nsize = [640, 480]\nmatrix = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\ndistortions = [0, 0, 0]\n")
    files = {
        "scenario": CONFIG / "scenarios" / "training.toml",
        "rig": CONFIG / "rigs" / "sim.toml",
        "plan": CONFIG / "networks" / "hill-1.toml",
        "network": CONFIG / "networks" / "hill.json",
        "foreign": foreign,
        "folder": tmp_path,
    }
    assert main([word.format(**files) for word in command]) == 2
    said = capsys.readouterr().err
    assert words.format(**files) in said
    assert said.count("\n") == 1
    assert len(said) < 400  # one thing is wrong: it is another file


def test_a_survey_as_calibration(tmp_path: Path) -> None:
    path = tmp_path / "survey.json"
    path.write_text(json.dumps(survey_json(training(), seed=1)))
    with pytest.raises(BadInputError, match=r"is a network or survey, and a result .* is wanted; a survey is given as"):
        read_calibration(path)


def test_an_empty_file_is_called_empty(tmp_path: Path) -> None:
    path = tmp_path / "survey.json"
    path.write_text("\n")
    with pytest.raises(BadInputError, match=r"survey\.json: is empty; name an existing survey"):
        read_survey(path)


def test_decimal_commas_between_commas(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "balls.csv"
    path.write_text("name,X,Y,Z\nB1,0,81,-3,09,-1,51\n")
    assert main(["network", "import", str(path), "-o", str(tmp_path / "survey.json")]) == 2
    assert "line 2: 7 columns, but only name, x, y, z are known" in (said := capsys.readouterr().err)
    assert "and decimals with a point" in said


def test_recordings_into_a_file(tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]) -> None:
    rig = str(write_rig(tmp_path, loopback, backend="sim"))
    assert main(["record", "--rig", rig, "--seconds", "1", "--out", rig]) == 2
    assert f"{rig}: is no folder; choose another --out" in capsys.readouterr().err


def test_targets_into_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "print"
    path.write_text("")
    for folder in (path, path / "targets"):
        assert main(["target", "-o", str(folder)]) == 2
        assert "a folder is wanted, and there is a file; choose another path" in capsys.readouterr().err


def test_an_exposure_longer_than_the_period(
    tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]
) -> None:
    rig = write_rig(tmp_path, loopback, backend="sim")
    rig.write_text(rig.read_text().replace('backend = "sim"', 'backend = "sim"\nexposure_us = 40000', 1))
    assert main(["record", "--rig", str(rig), "--seconds", "0.2", "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().err
    assert "warning: K1: it exposes for 40.0 ms, pulses come every 33.3 ms, so it misses pulses" in said
    assert "shorten exposure_us, or lower trigger.rate_hz" in said


def _day(utc_s: float) -> str:
    return time.strftime("%Y-%m-%d", time.localtime(utc_s))


def test_a_clock_in_the_future_or_a_file_from_there(
    tmp_path: Path, loopback: Loopback, capsys: pytest.CaptureFixture[str]
) -> None:
    """Somebody has typed a wrong year: it is said before the date is written, and stands in the record."""
    next_year = time.time() + 366 * 86_400
    network = tmp_path / "network.json"
    network.write_bytes((CONFIG / "networks" / "hill.json").read_bytes())
    (tmp_path / "out").mkdir()
    (log := tmp_path / "out" / "2036-01-01T00-00-00Z.mcap").write_bytes(b"")
    for file in (network, log):
        os.utime(file, (next_year, next_year))
    rig = write_rig(tmp_path, loopback, backend="sim")
    assert main(["record", "--rig", str(rig), "--seconds", "0.2", "--out", str(tmp_path / "out")]) == 0
    doubt = f"{_day(next_year)}: one of the two dates"
    said = capsys.readouterr().err
    assert f"{log} was written on {doubt}" in said
    assert "if today is another day, set it: sudo date -s" in said
    report = tmp_path / "report"
    assert main(["orient", str(network), "-o", str(tmp_path / "poses.json"), "--report", str(report)]) == 0
    assert f"{network} was written on {doubt}" in capsys.readouterr().err
    assert f"the date may be wrong: the clock says {time.gmtime().tm_year}" in (report / "protocol.txt").read_text()


def test_a_clock_before_the_recording_is_told_by_analyze_before_anything_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    next_year = time.time() + 366 * 86_400
    (log := tmp_path / "jump.mcap").write_bytes(b"cut off at once")
    (survey := tmp_path / "survey.json").write_text(json.dumps(survey_json(training(), seed=1)))
    analyze = ["analyze", str(log), "--survey", str(survey), "--out", str(tmp_path / "out")]
    assert main(analyze) == 2
    assert "the clock says" not in capsys.readouterr().err
    os.utime(log, (next_year, next_year))
    assert main(analyze) == 2
    first, *_ = capsys.readouterr().err.splitlines()
    assert first.startswith("warning: the clock says")
    assert f"{log} was written on {_day(next_year)}: one of the two dates is wrong; if today is another day" in first
