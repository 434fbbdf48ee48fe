"""Lines of an emulated chip, through the unmodified libgpiod: what they do, and in what words they refuse."""

import errno
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from simrig.gpio.build import environment
from simrig.gpio.chip import GpioChip

_HEAD = """
import sys
from pathlib import Path
from rig.errors import TriggerError
from triggering.sources.gpio.lines import EdgeLine, InputLine, OutputLine, chip_path
folder = Path(sys.argv[1])
chip = str(folder / "gpiochip0")
def said(action):
    try:
        action()
    except TriggerError as error:
        print(str(error).replace(f"{folder}/", ""))
"""


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder whose path is short enough for a socket's."""
    with tempfile.TemporaryDirectory() as directory:
        yield Path(directory)


def _run(folder: Path, code: str) -> list[str]:
    done = subprocess.run(
        [sys.executable, "-c", _HEAD + code, str(folder)], env={**os.environ, **environment()},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.splitlines()


def test_a_line_is_inactive_at_its_request_and_again_when_it_is_given_back(folder: Path) -> None:
    with GpioChip(folder / "gpiochip0", lines=("", "PULSES")) as chip:
        assert _run(folder, """
with OutputLine(chip, "PULSES", active_low=True) as line:
    line.set(True)
    print(line.name)
""") == ["line PULSES of gpiochip0"]  # fmt: skip
        assert [(edge.line, edge.high) for edge in chip.wait_for_edges(3)] == [(1, True), (1, False), (1, True)]
        assert [request.consumer for request in chip.requests] == ["svev"]


@pytest.mark.parametrize("active_low", [False, True])
def test_the_level_of_an_input_is_told_while_its_chip_is_there(folder: Path, active_low: bool) -> None:
    """Whoever asks is another process, so the level changes between two words from it."""
    code = """
with InputLine(chip, "GATE", active_low=sys.argv[2] == "True") as line:
    for _ in sys.stdin:
        said(lambda: print(line.active()))
        sys.stdout.flush()
"""
    command = [sys.executable, "-c", _HEAD + code, str(folder), str(active_low)]
    pipes: dict[str, Any] = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    with ExitStack() as powered:
        chip = powered.enter_context(GpioChip(folder / "gpiochip0", lines=("", "GATE")))
        with subprocess.Popen(command, env={**os.environ, **environment()}, **pipes) as program:

            def answer() -> str:
                assert program.stdout is not None
                print("?", file=program.stdin, flush=True)
                return str(program.stdout.readline().strip())

            chip.wait_for_use(1, used=True)
            for high in (False, True, False):
                chip.drive(1, high=high)
                assert answer() == str(high != active_low)
            powered.close()
            assert answer() == "line GATE of gpiochip0 fails (No such device): see that its GPIO chip is plugged in"
            program.communicate(timeout=60)


def test_chips_are_found_by_file_name_number_and_label(folder: Path) -> None:
    with (
        GpioChip(folder / "gpiochip0", label="pinctrl"),
        GpioChip(folder / "gpiochip1", label="usb"),
        GpioChip(folder / "gpiochip2", label="usb"),
        GpioChip(folder / "gpiochip3", refusal=errno.EACCES),
    ):
        assert _run(folder, """
print(*(chip_path(name, folder).name for name in ("gpiochip1", "2", chip, "pinctrl")))
said(lambda: chip_path("usb", folder))
said(lambda: chip_path("i2c", folder))
""") == [
            "gpiochip1 gpiochip2 gpiochip0 gpiochip0",
            "GPIO chip usb: gpiochip1, gpiochip2 have this label: name one of them as trigger.chip in the rig file",
            "GPIO chip i2c is not there: name one that gpiodetect lists as trigger.chip in the rig file",
        ]  # fmt: skip


def test_each_refusal_is_one_line_that_says_what_to_do(folder: Path) -> None:
    with (
        GpioChip(folder / "gpiochip0", lines=("", "BUZZER"), taken={1: "buzzer"}),
        GpioChip(folder / "gpiochip1", refusal=errno.EACCES),
    ):
        assert _run(folder, """
said(lambda: OutputLine(chip, 1, active_low=False))
said(lambda: OutputLine(chip, 2, active_low=False))
said(lambda: EdgeLine(chip, "GATE", active_low=False, debounce_ms=0))
said(lambda: OutputLine(str(folder / "gpiochip1"), 1, active_low=False))
said(lambda: OutputLine(str(folder / "gpiochip9"), 1, active_low=False))
said(lambda: OutputLine("/dev/null", 1, active_low=False))
""") == [
            "line 1 of gpiochip0 is taken by buzzer: end that, or name another line in the rig file",
            "GPIO chip gpiochip0 has no line 2, but lines 0 to 1: name one that gpioinfo lists in the rig file",
            "GPIO chip gpiochip0 has no line GATE, but lines 0 to 1: name one that gpioinfo lists in the rig file",
            ("GPIO chip gpiochip1 may not be opened by this user: sudo usermod -aG gpio $USER and log in again; "
            "without a group gpio, make one and a udev rule for it (docs/how-to/hill-pc.md)"),
            "GPIO chip gpiochip9 is not there: name one that gpiodetect lists as trigger.chip in the rig file",
            ("GPIO chip /dev/null cannot be opened (No such device): name one that gpiodetect lists as trigger.chip "
            "in the rig file"),
        ]  # fmt: skip
