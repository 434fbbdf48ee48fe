"""The benchmark of recording, run shortly in a network of its own: it uses the fixed addresses of its rig."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bench.recording.loads import MANY
from bench.recording.many import scenario_of
from simrig.world.scenario import load_scenario

pytestmark = pytest.mark.long


def _may_have_a_network() -> bool:
    command = ["unshare", "--net", "true"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_eight_cameras_have_a_hill_and_a_rig(tmp_path: Path) -> None:
    load = MANY["cameras-8"]
    scenario = load_scenario(scenario_of(tmp_path, load.cameras))
    names = [f"K{number}" for number in range(1, 9)]
    assert [camera.name for camera in scenario.cameras] == names
    assert [camera.name for camera in load.rig(tmp_path, "tcp://127.0.0.1:5556").cameras] == names
    assert load.bytes_per_s == 8 * 640 * 480 * 30


def test_all_cases_of_the_paper_s_load_are_measured(tmp_path: Path) -> None:
    if not _may_have_a_network():
        pytest.skip("no network namespace of our own is allowed here: the benchmark's addresses may be in use")
    script = 'ip link set lo up && exec "$@"'
    bench = [sys.executable, "-m", "svev", "bench", "paper", "--seconds", "1", "--out", str(tmp_path), "--json"]
    command = ["unshare", "--net", "sh", "-c", script, "sh", *bench]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=150)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)["paper"]
    for case in ("svev", "svev, one subscriber", "svev, split, one subscriber"):
        assert result[case]["pulses"] == 30
        assert result[case]["cpu_s"] > 0
    assert result["svev, one subscriber"]["received"] > 0
    assert json.loads(Path(result["file"]).read_text())
