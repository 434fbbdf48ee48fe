"""Rigs whose pulses come from a line of the computer: real processes and the real libgpiod, on an emulated chip."""

import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import pytest
from mcap.reader import make_reader

from simrig.gpio.build import environment
from simrig.gpio.chip import GpioChip
from tests.capture.rigs import write_rig
from tests.support.loopback import Loopback
from triggering.sources.gpio.pulser import LATEST

RATE_HZ = 20.0


@pytest.fixture
def chip() -> Iterator[GpioChip]:
    """A chip whose line 3 is taken."""
    with tempfile.TemporaryDirectory() as folder, GpioChip(Path(folder) / "gpiochip0", taken={3: "fan"}) as chip:
        yield chip


def _record(folder: Path, loopback: Loopback, chip: GpioChip, line: int, seconds: float) -> subprocess.Popen[str]:
    path = write_rig(folder, "sim", loopback, source="gpio", rate_hz=RATE_HZ, names=["K1"])
    keys = f'source = "gpio"\nchip = "{chip.path}"\nline = {line}\npulse_ms = 2.0'
    path.write_text(path.read_text().replace('source = "gpio"', keys))
    command = [sys.executable, "-m", "svev", "record", "--rig", str(path), "--seconds", str(seconds)]
    return subprocess.Popen(
        [*command, "--out", str(folder / "logs"), "--json"], env={**os.environ, **environment()},
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def test_the_line_has_the_pulses_and_the_log_says_how_even_they_were(
    tmp_path: Path, loopback: Loopback, chip: GpioChip
) -> None:
    with _record(tmp_path, loopback, chip, 1, 2.0) as program:
        output, complaints = program.communicate(timeout=90)
    assert program.returncode == 0, complaints
    chip.wait_for_use(1, used=False)
    edges = chip.edges
    assert [edge.high for edge in edges] == [True, False] * (len(edges) // 2)
    rises = [edge.time for edge in edges if edge.high]
    assert len(rises) > RATE_HZ
    assert min(after - before for before, after in pairwise(rises)) > (1 - 2 * LATEST) * 1e9 / RATE_HZ
    with Path(json.loads(output)["log"]).open("rb") as file:
        messages = list(make_reader(file).iter_messages(topics=["/health"]))
    made = json.loads(messages[-1][2].data)["made"]
    assert 0 < made["made"] <= len(rises)
    assert made["late_median_us"] <= made["late_p99_us"] <= made["late_max_us"]
    assert made["late_max_us"] >= 0


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
