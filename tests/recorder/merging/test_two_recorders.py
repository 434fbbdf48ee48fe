"""`svev merge` of logs of two real recorders on one train of pulses; one is killed, and its log recovered."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from photogrammetry.network.calibration_file import read_calibration
from recorder.checking.verify import verify
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.clocks import host_now
from rig.topics import CALIBRATION_ATTACHMENT
from simrig.images import stamp
from simrig.programs.simulated_hill import GigeOptions, SimulatedHill
from tests.capture.rigs import SCENARIO
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

RATE_HZ, WIDTH, HEIGHT = 15.0, 160, 120
#: The recorder is killed when its file has room for so many pulses; most of them are in it by then.
PULSES, IN_BOTH = 75, 40
INTERIOR: dict[str, Any] = dict.fromkeys(("x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2", "r0"), 0.0)


def test_two_recorders_on_one_train(tmp_path: Path, loopback: Loopback) -> None:
    """Each pulse that both saw is one pulse with three frames, and no frame stands with those of another pulse.

    The hill pauses for irregular times, which tells the computers' pulses apart without a common clock.
    """
    rng = np.random.default_rng(7)
    begins = np.cumsum(rng.integers(14, 24, 200))
    pauses = [[int(begin), int(begin + length)] for begin, length in zip(begins, rng.integers(2, 9, 200), strict=True)]
    scenario = tmp_path / "scenario.toml"
    scenario.write_text(f'base = "{SCENARIO}"\nname = "paused"\npauses = {pauses}\n')
    cameras = dict(zip(("K1", "K2", "K3"), loopback.cameras(3), strict=True))
    size: GigeOptions = {"width": WIDTH, "height": HEIGHT}
    with (
        SimulatedHill(scenario, cameras, RATE_HZ, epoch=host_now(), test_pattern=True, **size),
        _recording(_rig(tmp_path, "left", {"K1": cameras["K1"]}, loopback)) as left,
    ):
        wait_until(lambda: _bytes(tmp_path / "left") > 20 * WIDTH * HEIGHT, "20 pulses on the left", 60)
        with _recording(_rig(tmp_path, "right", {k: cameras[k] for k in ("K2", "K3")}, loopback)) as right:
            enough = PULSES * 2 * WIDTH * HEIGHT
            wait_until(lambda: _bytes(tmp_path / "right") > enough, f"{PULSES} pulses on the right", 120)
            os.killpg(right.pid, signal.SIGKILL)
            right.wait(10)
        left.send_signal(signal.SIGINT)
        left.wait(60)
    (first,), (killed,) = (list((tmp_path / side).glob("*.mcap")) for side in ("left", "right"))
    second, both = tmp_path / "recovered.mcap", tmp_path / "both.mcap"
    assert "was not closed" in _svev("merge", first, killed, "-o", both, code=3).stderr
    _svev("recover", killed, "-o", second)
    report = json.loads(_svev("merge", first, second, "-o", both, "--json").stdout)

    seen = [_stamped(path) for path in (first, second)]
    common = set(seen[0]) & set(seen[1])
    assert len(common) >= IN_BOTH
    joined = {}
    for tag, image in triplets(both):
        read = {camera.name: stamp.read(image[camera.part]) for camera in tag.cameras if camera.status == "ok"}
        shown = {name: found.pulse for name, found in read.items() if found is not None}
        assert len(shown) == len(read)
        assert len(set(shown.values())) == 1, f"pulse {tag.pulse} is mixed: {shown}"
        pulse = next(iter(shown.values()))
        assert pulse not in joined, "a pulse of the hill is one pulse of the log"
        joined[pulse] = sorted(shown)
    assert joined == {pulse: sorted([*seen[0].get(pulse, []), *seen[1].get(pulse, [])]) for pulse in seen[0] | seen[1]}
    assert report["common"] == len(common)
    assert verify(both).findings == ()
    with LogReader(both) as reader:
        for _ in reader.items():
            pass
        (tmp_path / "calibration.json").write_bytes(reader.attachments[CALIBRATION_ATTACHMENT])
    calibration = read_calibration(tmp_path / "calibration.json")
    assert {name: camera.c for name, camera in calibration.items()} == {"K1": 1001.0, "K2": 2002.0, "K3": 2003.0}


def _rig(folder: Path, side: str, cameras: dict[str, str], loopback: Loopback) -> Path:
    """A rig of one computer. Its calibration names all cameras, but is of this computer's."""
    c = {"left": 1000.0, "right": 2000.0}[side]
    bodies = {f"K{number}": INTERIOR | {"c": c + number, "distortion": "projected"} for number in (1, 2, 3)}
    result = {"format": "svev-adjustment/1", "converged": True, "cameras": bodies}
    (folder / f"{side}.json").write_text(json.dumps(result))
    lines = [f'name = "{side}"', f'calibration = "{side}.json"', "[trigger]", f"rate_hz = {RATE_HZ}", "gated = true"]
    lines += ["settle_s = 30", "[network]", f'publish = "{loopback.endpoint()}"']
    for name, address in cameras.items():
        lines += ["[[cameras]]", f'name = "{name}"', 'backend = "aravis"', f'address = "{address}"']
        lines += [f"region = {{ width = {WIDTH}, height = {HEIGHT} }}"]
    path = folder / f"{side}.toml"
    path.write_text("\n".join(lines) + "\n")
    return path


@contextmanager
def _recording(rig: Path) -> Iterator["subprocess.Popen[bytes]"]:
    """A recorder with its processes, in a group of its own; its log is in a folder named as its rig."""
    length = ["--seconds", "300", "--out", str(rig.with_suffix(""))]
    command = [sys.executable, "-m", "svev", "record", "--rig", str(rig), *length]
    with (
        rig.with_suffix(".out").open("wb") as said,
        subprocess.Popen(command, start_new_session=True, stdout=said, stderr=said) as process,
    ):
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)


def _bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.glob("*.mcap"))


def _svev(*arguments: object, code: int = 0) -> "subprocess.CompletedProcess[str]":
    done = run_svev(*map(str, arguments), timeout_s=120)
    assert done.returncode == code, done.stderr
    return done


def _stamped(log: Path) -> dict[int, list[str]]:
    """The cameras that took each pulse of the hill, by the stamps in their pictures."""
    found: dict[int, list[str]] = {}
    for tag, image in triplets(log):
        for camera in tag.cameras:
            if camera.status == "ok" and (read := stamp.read(image[camera.part])) is not None:
                found.setdefault(read.pulse, []).append(camera.name)
    return found
