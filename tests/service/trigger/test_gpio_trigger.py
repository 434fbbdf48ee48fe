"""Rigs whose pulses come from a line of the computer: real processes and the real libgpiod, on an emulated chip."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from msgspec.structs import replace

from recorder.checking.verify import verify
from recorder.reading.info import info
from rig.clocks import UtcAnchor
from rig.health import Health, PulsesMade
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from rig.transport import wire
from service.status.measurements import measurements
from simrig.gpio.build import environment
from simrig.gpio.chip import GpioChip
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.service.trigger.armed import armed
from tests.support.loopback import Loopback
from tests.support.repeats import repeats
from tests.support.waiting import wait_until
from triggering.sources.gpio.pulser import LATEST

RATE_HZ = 10.0


@pytest.fixture
def chip() -> Iterator[GpioChip]:
    """A chip whose line 3 is taken."""
    with tempfile.TemporaryDirectory() as folder, GpioChip(Path(folder) / "gpiochip0", taken={3: "fan"}) as chip:
        yield chip


def _write_rig(
    folder: Path, loopback: Loopback, chip: GpioChip, line: int, backend: str = "sim", more: str = "", **rig: Any
) -> Path:
    path = write_rig(folder, backend, loopback, source="gpio", rate_hz=RATE_HZ, **{"names": ["K1"], **rig})
    keys = f'source = "gpio"\nchip = "{chip.path}"\nline = {line}\npulse_ms = 2.0\n{more}'
    path.write_text(path.read_text().replace('source = "gpio"', keys))
    return path


def _record(
    folder: Path, loopback: Loopback, chip: GpioChip, line: int, seconds: float, backend: str = "sim", **rig: Any
) -> subprocess.Popen[str]:
    path = _write_rig(folder, loopback, chip, line, backend, **rig)
    command = [sys.executable, "-m", "svev", "record", "--rig", str(path), "--seconds", str(seconds)]
    return subprocess.Popen(
        [*command, "--out", str(folder / "logs"), "--json"], env={**os.environ, **environment()},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


@pytest.mark.parametrize("backend", repeats(["aravis", "sim"]))
def test_each_pulse_of_the_line_is_in_the_log_at_its_time_also_those_that_no_camera_saw(
    tmp_path: Path, loopback: Loopback, chip: GpioChip, backend: str
) -> None:
    """Of ten pulses the trigger cable is out for two, and K2 misses one more."""
    gaps = [[pulse, pulse + 2] for pulse in range(0, 3000, 10)]
    misses = [{"camera": "K2", "kind": "missed_pulse", "at_pulse": pulse} for pulse in range(5, 1000, 10)]
    options = {"names": ["K1", "K2"], "scenario": f"pauses = {gaps}", "faults": misses}
    with _record(tmp_path, loopback, chip, 1, 3.0, backend, **options) as program:
        output, complaints = program.communicate(timeout=90)
    assert program.returncode == 5, complaints
    chip.wait_for_use(1, used=False)
    edges = chip.edges
    assert [edge.high for edge in edges] == [True, False] * (len(edges) // 2)
    rises = [edge.time for edge in edges if edge.high]
    assert len(rises) > 2 * RATE_HZ
    assert min(after - before for before, after in pairwise(rises)) > (1 - 2 * LATEST) * 1e9 / RATE_HZ
    with Path(json.loads(output)["log"]).open("rb") as file:
        reader = make_reader(file)
        healths = [message.data for _, _, message in reader.iter_messages(topics=["/health"])]
        tags = [json.loads(message.data) for _, _, message in reader.iter_messages(topics=["/triplet/tag"])]
    to_utc = UtcAnchor.take().offset_ns
    pulses = [min(range(len(rises)), key=lambda n: abs(rises[n] + to_utc - int(tag["time_ns"]))) for tag in tags]
    health = wire.decoder(Health).decode(healths[-1])
    source, made = health.pairing.source, health.made
    assert source is not None
    assert made is not None
    # On a crowded machine the word of a pulse that no camera saw may come after later ones are decided; that is told.
    assert pulses == sorted(set(pulses))
    assert pulses[-1] - pulses[0] + 1 - len(pulses) <= source.untagged < 0.1 * len(rises)
    told = [word for each in healths for word in wire.decoder(Health).decode(each).fired or ()]
    assert told
    known_to = 5e6 + 1000 * max(word.uncertainty_us for word in told)
    assert max(abs(rises[n] + to_utc - int(tag["time_ns"])) for n, tag in zip(pulses, tags, strict=True)) < known_to
    fates = Counter(tuple(camera["status"] for camera in tag["cameras"]) for tag in tags)
    # A crowded machine may lose a packet, and says so: the frame is damaged.
    assert {fate for fate in fates if "damaged" not in fate} == {
        ("ok", "ok"),
        ("missed", "missed"),
        ("ok", "missed"),
    }, fates
    assert 0 < fates["missed", "missed"] / len(tags) < 0.5  # a busy computer leaves some of the pulses out
    assert source.unfired == 0
    assert source.unseen > 0
    recounted = verify(Path(json.loads(output)["log"])).recounted
    assert recounted.agrees, list(recounted.in_words())
    assert recounted.source is not None
    assert 0 < recounted.source.unseen <= fates["missed", "missed"]
    assert info(Path(json.loads(output)["log"]), source=True).source == recounted.source
    assert 0 < made.made <= len(rises)
    assert made.late_median_us is not None
    assert made.late_p99_us is not None
    assert made.late_max_us is not None
    assert made.late_median_us <= made.late_p99_us <= made.late_max_us
    assert made.late_max_us >= 0
    _are_told(load_rig(tmp_path / "rig.toml"), health, made)


def _are_told(rig: RigSettings, health: Health, made: PulsesMade) -> None:
    """Status and metrics show how many pulses were made, and left out; without these figures, what the source told."""
    status = armed(rig, health)
    assert status.pulses.fired == made.made
    told = {each.name: each.samples[0].value for each in measurements(status, health) if each.samples}
    assert (told["svev_pulses_fired"], told["svev_pulses_left_out"]) == (made.made, made.skipped)
    assert health.pairing.source is not None
    assert armed(rig, replace(health, made=None)).pulses.fired == health.pairing.source.fired


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_the_line_is_inactive_when_svev_is_killed(
    tmp_path: Path, loopback: Loopback, chip: GpioChip, how: signal.Signals
) -> None:
    with _record(tmp_path, loopback, chip, 1, 60.0) as program:
        chip.wait_for_edges(5)
        program.send_signal(how)
        program.communicate(timeout=60)
    chip.wait_for_use(1, used=False)
    assert not chip.high(1)


def test_a_line_that_somebody_has_is_named(tmp_path: Path, loopback: Loopback, chip: GpioChip) -> None:
    with _record(tmp_path, loopback, chip, 3, 0.5) as program:
        _, complaints = program.communicate(timeout=90)
    assert "line 3 of gpiochip0 is taken by fan: end that, or name another line in the rig file" in complaints


def test_while_a_gate_outside_is_closed_no_pulses_are_made_and_that_is_no_alarm(
    tmp_path: Path, loopback: Loopback, chip: GpioChip
) -> None:
    path = _write_rig(tmp_path, loopback, chip, 1, more="gate = { line = 4, active_low = true }")
    assert load_rig(path).trigger.pauses
    chip.drive(4, high=True)
    with serving(tmp_path, path, loopback, environment=environment()) as service:
        service.arm()
        service.await_statement("state_gate_closed")
        pulses = service.get("/api/status")["pulses"]
        assert (pulses["fired"], pulses["made"]["skipped"], pulses["made"]["gate_open"]) == (0, 0, False)
        assert not any(edge.high for edge in chip.edges)
        chip.drive(4, high=False)
        service.await_statement("state_armed")
        recording = service.post("/api/recordings")["id"]
        service.await_pulses(5)
        chip.drive(4, high=True)
        service.post(f"/api/recordings/{recording}/stop", {"confirm": True})
        service.await_statement("state_gate_closed")
        wait_until(
            lambda: service.get("/api/status")["pulses"]["fired"] == sum(edge.high for edge in chip.edges),
            "all pulses are told",
            poll_s=0.05,
        )
        alarms = {alarm["statement"]["code"] for alarm in service.get("/api/status")["alarms"]}
        assert not alarms & {"alarm_stopped", "alarm_stopped_commands"}  # a crowded machine may have others
    chip.wait_for_use(4, used=False)
