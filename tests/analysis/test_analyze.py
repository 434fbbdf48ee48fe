"""`svev analyze` and `svev worker` on a rendered jump: what they measure is true, and what they cannot, they say."""

import functools
import json
import re
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zmq

from analysis.measurements.file import read_measurements
from analysis.procedure.analyze import analyze
from bench.analysis.hill_logs import HillLog
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import stored_triplets
from tests.analysis.measured import FIRST_DAY, PULSES, measured_jump
from tests.analysis.simulated import training
from tests.recorder.split import split_log
from tests.support.commands import run_svev, start_svev
from tests.support.kept import kept_hill_log
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

AT_MOST = 6.0  # sigmas, of live states: where the motion has just changed, large errors are not so rare


@pytest.fixture(scope="module")
def jump() -> HillLog:
    return kept_hill_log(training(), PULSES, FIRST_DAY)


def svev(*arguments: str | Path, code: int = 0) -> subprocess.CompletedProcess[str]:
    done = run_svev(*map(str, arguments), timeout_s=170)
    assert done.returncode == code, done.stderr
    return done


@pytest.mark.long
@pytest.mark.parametrize("ending", [signal.SIGHUP, signal.SIGTERM])
def test_a_closed_terminal_leaves_no_half_written_result(jump: HillLog, tmp_path: Path, ending: signal.Signals) -> None:
    out = tmp_path / "out"
    with start_svev("analyze", str(jump.path), "--survey", str(jump.survey), "--out", str(out)) as command:
        wait_until(lambda: out.is_dir() or command.poll() is not None, "it writes", 170)
        command.send_signal(ending)
        assert command.wait(60) == 130, command.written()
    assert not [file.name for file in out.iterdir() if file.name.startswith(".")]


@pytest.mark.long
def test_a_jump_is_measured_and_its_errors_are_within_their_sigmas(
    jump: HillLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out, summary = measured_jump().result, measured_jump().summary
    result = json.loads((out / "jumper.json").read_text())
    assert result["format"] == "svev-jumper/1"
    assert len(result["jumps"]) == 1
    measured = result["jumps"][0]
    assert measured["verdict"]["ok"], measured["verdict"]["message"]
    assert abs(measured["takeoff"]["pulse"] - (30.0 - PULSES[0] + 1)) < 4 * measured["takeoff"]["sigma_pulses"] + 0.05
    _points_are_true(measured, jump.truth)
    _angles_are_true(measured, jump.truth)
    names = {"jumper.csv", "jumper.c3d", "jumper.trc", "jumper.osim", "report.html", "protocol.html", "protocol.txt"}
    names |= {"jumper.json", "network.json", "measurements.json", "overlay.json", "cameras.json"}
    names |= {"kinogram.html", "kinogram.jpg", "kinogram.json"}
    assert {Path(file).name for file in summary["files"]} == names
    assert all((out / name).stat().st_size > 100 for name in names)
    _the_same_from_the_measurements(jump, out, tmp_path / "again")
    _the_example_of_the_documentation_runs(jump, out, tmp_path / "documented", monkeypatch, capsys)


@pytest.mark.long
def test_a_jump_in_two_parts_is_one_jump(jump: HillLog, tmp_path: Path) -> None:
    with LogReader(jump.path) as reader:
        pulses = len(stored_triplets(reader))
    _, second = split_log(jump.path, tmp_path / "r1.mcap", (pulses // 2,))
    svev("analyze", second, "--survey", jump.survey, "--out", tmp_path / "out")
    whole, split = (json.loads((out / "jumper.json").read_text()) for out in (measured_jump().result, tmp_path / "out"))
    assert [each["pulses"] for each in split["jumps"]] == [each["pulses"] for each in whole["jumps"]]


def _points_are_true(measured: dict[str, Any], truth: dict[int, dict[str, Any]]) -> None:
    """Points in sight of two cameras are solved, to 0.02 m in 95 % of the pulses."""
    seen = solved = 0
    errors = []
    for pulse in measured["pulses"]:
        true = truth[pulse["pulse"]]
        for name in ("P1", "P2", "P3", "P4"):
            if sum(bool(sight[name]) for sight in true["in_sight"].values()) < 2:
                continue
            seen += 1
            point = pulse["points"][name]
            if point is not None:
                solved += 1
                off = np.array(point["X"]) - true["points"][name]
                sigma = np.sqrt(np.diagonal(np.array(point["covariance"])))
                assert (np.abs(off) < 5 * sigma).all(), (pulse["pulse"], name, off, sigma)
                errors.append(np.abs(off).max())
    assert solved >= 0.95 * seen
    assert np.quantile(errors, 0.95) < 0.02


def _angles_are_true(measured: dict[str, Any], truth: dict[int, dict[str, Any]]) -> None:
    flight = [pulse for pulse in measured["pulses"] if 0.2 < pulse["since_takeoff_s"] < 0.7]
    assert len(flight) > 10
    for pulse in flight:
        for name, true in truth[pulse["pulse"]]["angles"].items():
            found = pulse["smoothed"]["angles"][name]
            assert abs(found["value"] - true) < 5 * found["sigma"] + 0.05, (pulse["pulse"], name, found, true)


def _the_same_from_the_measurements(jump: HillLog, out: Path, again: Path) -> None:
    """What was measured can be computed again without looking at the jumper."""
    given: list[str | Path] = ["--survey", jump.survey, "--measurements", out / "measurements.json"]
    for day in (1, 2, 3):
        earlier = _kinogram_of(out, slower=0.1 * day)
        (again / f"day{day}").mkdir(parents=True)
        (again / f"day{day}" / "kinogram.json").write_text(json.dumps(earlier))
        given += ["--earlier", again / f"day{day}"]
    svev("analyze", jump.path, *given, "--out", again, "--json")
    (told,) = json.loads((again / "kinogram.json").read_text())["jumps"]
    assert told["marks"]["v_angle"]["word"] == "within noise"
    assert told["marks"]["takeoff_speed"]["jumps"] == 3
    assert [place["missing"] for place in told["places"]] == [None] * 5
    first, second = (json.loads((folder / "jumper.json").read_text())["jumps"][0] for folder in (out, again))
    for before, after in zip(first["pulses"], second["pulses"], strict=True):
        assert (before["points"]["P1"] is None) == (after["points"]["P1"] is None)
        if before["points"]["P1"] is not None:
            assert after["points"]["P1"]["X"] == pytest.approx(before["points"]["P1"]["X"], abs=1e-4)


def _kinogram_of(out: Path, slower: float) -> dict[str, Any]:
    """The kinogram of a result as if it were of an earlier jump."""
    content: dict[str, Any] = json.loads((out / "kinogram.json").read_text())
    (jump,) = content["jumps"]
    jump["time"] = "2026-01-02T10:00:00Z"
    jump["figures"]["takeoff_speed"]["value"] -= slower
    return content


def _the_example_of_the_documentation_runs(
    jump: HillLog, out: Path, again: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """As it stands there, except that it does not look for the jumper once more."""
    page = Path(__file__).resolve().parents[2] / "docs" / "how-to" / "measuring.md"
    (example,) = re.findall(r"```python\n(from pathlib .*?)```", page.read_text(), re.DOTALL)
    known = functools.partial(analyze, by_hand=read_measurements(out / "measurements.json"), images=False)
    monkeypatch.setattr("analysis.procedure.analyze.analyze", known)
    exec(example, {"LOG": str(jump.path), "SURVEY": str(jump.survey), "OUT": str(again)})  # noqa: S102
    assert "1 measured well" in capsys.readouterr().out
    assert (again / "report.html").exists()


def test_what_cannot_be_measured_is_said_in_one_line(jump: HillLog, tmp_path: Path) -> None:
    empty = kept_hill_log(training(), range(75, 100), "empty")
    out = tmp_path / "out"
    nobody = svev("analyze", empty.path, "--survey", empty.survey, "--out", out, code=3)
    assert "nobody jumps in it" in nobody.stderr
    first, second = split_log(empty.path, tmp_path / "r1.mcap", (5,))
    first.unlink()
    alone = svev("analyze", second, "--survey", empty.survey, "--out", out, code=3)
    lone = "it is part 2 of a recording, and r1 does not lie beside it: put all parts into one folder"
    assert f"nobody jumps in it, but {lone}" in alone.stderr
    assert lone in svev("export", second, "--out", tmp_path / "tags.csv").stderr
    survey = json.loads(jump.survey.read_text())
    survey["cameras"]["K1"]["size"] = [1280, 960]
    wrong = tmp_path / "wrong.json"
    wrong.write_text(json.dumps(survey))
    size = svev("analyze", jump.path, "--survey", wrong, "--out", out, code=2)
    assert "calibrated for images of 1280 x 960 px" in size.stderr
    both = svev("analyze", jump.path, "--survey", jump.survey, "--calibration", wrong, "--out", out, code=2)
    for done in (nobody, alone, size, both):
        assert len(done.stderr.strip().splitlines()) == 1
        assert done.stderr.startswith("svev: ")
    assert not out.exists()


@pytest.mark.long
def test_a_worker_measures_a_replayed_log(jump: HillLog, tmp_path: Path, loopback: Loopback) -> None:
    replay = [sys.executable, "-m", "svev", "replay", str(jump.path), "--reliable", "--speed", "max"]
    address, results = loopback.endpoint(), loopback.endpoint()
    with (
        zmq.Context() as context,
        context.socket(zmq.SUB) as socket,
        subprocess.Popen([*replay, "--bind", address, "--wait", "60"], stdout=subprocess.DEVNULL) as serving,
    ):
        socket.subscribe(b"jumper")
        socket.connect(results)
        options = ("--survey", jump.survey, "--bind", results, "--out", tmp_path, "--idle", "3", "--json")
        summary = json.loads(svev("worker", "--connect", address, "--reliable", *options).stdout)
        assert serving.wait(20) == 0
        got = []
        while socket.poll(500):
            got.append(socket.recv_multipart())
    assert summary["pulses"] == len(PULSES)
    assert summary["jumps"] == 1
    states = [json.loads(data) for topic, data in got if topic == b"jumper"]
    jumps = [json.loads(data) for topic, data in got if topic == b"jumper/jump"]
    assert [state["pulse"] for state in states] == sorted({state["pulse"] for state in states})
    assert len(states) == summary["states"] > 30
    assert jumps[0]["jumps"][0]["pulses"]
    assert sum(None not in state["angles"].values() for state in states) > 0.7 * len(states)
    for state in states:
        _is_true(state, jump.truth[state["pulse"]])


def _is_true(state: dict[str, Any], true: dict[str, Any]) -> None:
    """A live state has all points, and errs by as much as it says."""
    for name, point in state["points"].items():
        off = np.array(point["X"]) - np.array(true["points"][name])
        assert off @ np.linalg.solve(point["covariance"], off) < AT_MOST**2, (state["pulse"], name)
        assert (point["status"] == "predicted") == (len(point["cameras"]) < 2)
        assert point["status"] == "predicted" or np.abs(off).max() < 0.1
    found = {**state["angles"], "speed": state["speed"], "height": state["height"]}
    for name, value in {**true["angles"], "speed": true["speed"], "height": true["height"]}.items():
        measured = found[name]
        assert measured is None or abs(measured["value"] - value) < AT_MOST * measured["sigma"], (state["pulse"], name)


def test_the_analysis_starts_without_scipys_distributions() -> None:
    heavy = "analysis.procedure.analyze, analysis.worker.live, analysis.comparison.report"
    # half a second of each start; scipy.special has the functions that are needed
    check = f"import sys, {heavy}; print([name for name in sys.modules if name.startswith('scipy.stats')])"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"
