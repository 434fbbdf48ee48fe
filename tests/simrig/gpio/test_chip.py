"""The emulated GPIO chip, seen by the unmodified libgpiod in a program of its own."""

import errno
import os
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from simrig.gpio.abi import LineFlag
from simrig.gpio.build import environment
from simrig.gpio.chip import GpioChip

_HEAD = """
import sys, time
from datetime import timedelta
from gpiod import Chip, LineSettings, is_gpiochip_device
from gpiod.line import Direction, Edge, Value
path, OUT = sys.argv[1], LineSettings(direction=Direction.OUTPUT)
"""


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder whose path is short enough for a socket's."""
    with tempfile.TemporaryDirectory() as directory:
        yield Path(directory)


def _start(chip: GpioChip, code: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", _HEAD + code, str(chip.path)], env={**os.environ, **environment()},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip


def _output(chip: GpioChip, code: str) -> str:
    with _start(chip, code) as program:
        output, _ = program.communicate(timeout=30)
    assert program.returncode == 0
    return output


def test_a_program_sees_the_chip_and_its_lines(folder: Path) -> None:
    with GpioChip(folder / "gpiochip3", lines=("", "TRIGGER", "BUZZER"), label="pinctrl", taken={2: "buzzer"}) as chip:
        seen = _output(chip, """
print(is_gpiochip_device(path), is_gpiochip_device("/dev/null"))
with Chip(path) as chip:
    info = chip.get_info()
    print(info.name, info.label, info.num_lines, chip.line_offset_from_id("TRIGGER"))
    for line in (1, 2):
        info = chip.get_line_info(line)
        print(info.name, info.consumer, info.used, info.direction.name)
""")  # fmt: skip
    assert seen == "True False\ngpiochip3 pinctrl 3 1\nTRIGGER None False INPUT\nBUZZER buzzer True INPUT\n"


@pytest.mark.parametrize("active_low", [False, True])
def test_each_edge_of_an_output_comes_with_the_time_at_which_it_was_set(folder: Path, active_low: bool) -> None:
    with GpioChip(folder / "gpiochip0") as chip:
        told = _output(chip, f"""
settings = LineSettings(direction=Direction.OUTPUT, active_low={active_low})
with Chip(path) as chip, chip.request_lines({{5: settings}}, consumer="pulses") as line:
    for value in (Value.ACTIVE, Value.INACTIVE) * 3:
        print(time.monotonic_ns())
        line.set_value(5, value)
        print(time.monotonic_ns())
""")  # fmt: skip
        edges = chip.wait_for_edges(6 + active_low)[active_low:]  # an active-low line becomes high at its request
        chip.wait_for_use(5, used=False)
    times = [int(line) for line in told.split()]
    assert [(edge.line, edge.high) for edge in edges] == [(5, not active_low), (5, active_low)] * 3
    assert all(
        before <= edge.time <= after
        for edge, before, after in zip(edges, times[::2], times[1::2], strict=True)
    )  # fmt: skip
    assert [request.consumer for request in chip.requests] == ["pulses"]


@pytest.mark.parametrize(
    ("request_", "error"),
    [("{2: OUT}", errno.EBUSY), ('{"NOWHERE": OUT}', errno.ENOENT)],
)
def test_requests_are_refused_as_the_kernel_does(folder: Path, request_: str, error: int) -> None:
    with GpioChip(folder / "gpiochip0", taken={2: "buzzer"}) as chip:
        assert _output(chip, f"""
try:
    Chip(path).request_lines({request_})
except OSError as error:
    print(error.errno)
""") == f"{error}\n"  # fmt: skip


def test_a_chip_that_may_not_be_opened(folder: Path) -> None:
    with GpioChip(folder / "gpiochip0", refusal=errno.EACCES) as chip:
        assert _output(chip, """
try:
    Chip(path)
except PermissionError:
    print("refused")
""") == "refused\n"  # fmt: skip


def test_an_input_that_bounces_is_one_edge(folder: Path) -> None:
    with GpioChip(folder / "gpiochip0") as chip, _start(chip, """
settings = LineSettings(edge_detection=Edge.RISING, debounce_period=timedelta(milliseconds=40))
with Chip(path) as chip, chip.request_lines({1: settings}) as line:
    for event in line.read_edge_events() + line.read_edge_events():
        print(event.event_type.name, event.line_offset, event.line_seqno, event.timestamp_ns <= time.monotonic_ns())
""") as program:  # fmt: skip
        chip.wait_for_use(1, used=True)
        for _ in range(2):
            for high in (True, False, True, False, True):
                chip.drive(1, high=high)
            chip.wait_until_settled(1)
            chip.drive(1, high=False)
            chip.wait_until_settled(1)
        seen, _ = program.communicate(timeout=30)
    assert seen == "RISING_EDGE 1 1 True\nRISING_EDGE 1 2 True\n"
    assert chip.requests[0].flags == LineFlag.INPUT | LineFlag.RISING


@pytest.mark.parametrize("active_low", [False, True])
def test_a_program_asks_for_the_level_of_its_lines_while_edges_wait(folder: Path, active_low: bool) -> None:
    with GpioChip(folder / "gpiochip0") as chip, _start(chip, f"""
settings = LineSettings(active_low={active_low}, edge_detection=Edge.BOTH)
out = LineSettings(direction=Direction.OUTPUT, output_value=Value.ACTIVE)
with Chip(path) as chip, chip.request_lines({{1: settings}}) as line, chip.request_lines({{2: out}}) as output:
    print(line.get_value(1).name, output.get_value(2).name, flush=True)
    sys.stdin.readline()
    print(line.get_value(1).name, line.read_edge_events()[0].event_type.name)
""") as program:  # fmt: skip
        assert program.stdout is not None
        before = program.stdout.readline()
        chip.drive(1, high=True)
        chip.wait_until_settled(1)
        seen, _ = program.communicate("go\n", timeout=30)
    low, high = ("ACTIVE", "INACTIVE") if active_low else ("INACTIVE", "ACTIVE")
    assert before + seen == f"{low} ACTIVE\n{high} {'FALLING' if active_low else 'RISING'}_EDGE\n"


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
def test_a_line_is_free_again_when_its_program_dies_and_keeps_its_level(folder: Path, how: signal.Signals) -> None:
    with GpioChip(folder / "gpiochip0") as chip, _start(chip, """
line = Chip(path).request_lines({0: OUT})
line.set_value(0, Value.ACTIVE)
sys.stdin.read()
""") as program:  # fmt: skip
        chip.wait_for_edges(1)
        program.send_signal(how)
        chip.wait_for_use(0, used=False)
        assert chip.high(0)


def test_other_files_are_as_without_the_shim(folder: Path) -> None:
    code = "import os, sys, socket; print(oct(os.stat('/dev/null').st_mode), os.path.realpath('/sys/dev/char/1:3'), "
    code += "oct(os.stat(sys.argv[1]).st_mode), open('/dev/null', 'rb').read())"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(folder / "gpiochips"))
        outputs = [
            subprocess.run(
                [sys.executable, "-c", code, str(folder / "gpiochips")], capture_output=True, check=True, env=each
            )
            for each in (dict(os.environ), {**os.environ, **environment()})
        ]
    assert outputs[0].stdout == outputs[1].stdout != b""
    assert outputs[1].stderr == b""
