"""The doctor and the line that makes the pulses: an emulated chip, seen through the real libgpiod."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from rig.settings.file import CONFIG
from simrig.gpio.abi import LineFlag
from simrig.gpio.build import environment
from simrig.gpio.chip import GpioChip

_PROGRAM = """
import sys
from pathlib import Path
from rig.settings.file import load_rig
from rig.settings.trigger import BarrierSettings, ExternalTrigger, GpioTrigger
from svev.doctor.gpio import look_at_barrier, look_at_gpio
from triggering.sources.gpio.lines import EdgeLine, OutputLine
rig, chip = load_rig(Path(sys.argv[1])), sys.argv[2]
def look(trigger):
    for found in look_at_gpio(rig.model_copy(update={"trigger": trigger})):
        print(found.level, found.code, found.what.replace(chip, "CHIP"), found.remedy, sep="|")
def gpio(chip, line, gate=None):
    return GpioTrigger(source="gpio", chip=chip, line=line, gate=gate)
look(ExternalTrigger())
look(gpio(chip, 0))
with OutputLine(chip, 0, active_low=False):
    look(gpio(chip, 0))
look(gpio(chip, "FAN"))
look(gpio(chip, 9))
look(gpio(chip, 0, {"line": 2}))
look(gpio(chip, 0, {"line": "FAN"}))
def watch(line, trigger=ExternalTrigger(), low=False, interrupted=None):
    barrier = BarrierSettings(chip=chip, line=line, active_low=low)
    automatic = rig.automatic.model_copy(update={"barrier": barrier})
    for found in look_at_barrier(rig.model_copy(update={"automatic": automatic, "trigger": trigger}), interrupted):
        print(found.level, found.code, found.what.replace(chip, "CHIP"), sep="|")
watch(0)
watch(2)
watch(2, low=True)
watch(0, low=True)
with EdgeLine(chip, 0, active_low=False, debounce_ms=5):
    watch(0)
    watch(0, interrupted=False)
    watch(0, low=True, interrupted=True)
watch(0, gpio(chip, 0))
watch(2, gpio(chip, 0, {"line": 2}))
watch(1)
watch(9)
"""


def test_the_doctor_says_whether_the_lines_can_make_pulses_and_watch_a_barrier() -> None:
    with (
        tempfile.TemporaryDirectory() as folder,
        GpioChip(Path(folder) / "gpiochip0", lines=("", "FAN", "BEAM"), taken={1: "fan"}) as chip,
    ):
        chip.drive(2, high=True)
        done = subprocess.run(
            [sys.executable, "-c", _PROGRAM, str(CONFIG / "rigs" / "sim.toml"), str(chip.path)],
            env={**os.environ, **environment()}, capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert (done.returncode, done.stderr) == (0, "")
        assert chip.edges == []
        assert all(LineFlag.INPUT in request.flags for request in chip.requests[1:])
    assert done.stdout.splitlines() == [
        "PASS|check_gpio|line 0 of CHIP is there (trigger.line)|",
        "PASS|check_gpio|line 0 of CHIP is there (trigger.line)|",
        (
            "FAIL|check_gpio_taken|line FAN of CHIP is taken by fan|end that, or name another line as trigger.line in "
            "the rig file"
        ),
        (
            "FAIL|check_gpio_chip|trigger.line: GPIO chip CHIP has no line 9, but lines 0 to 2: name one that gpioinfo "
            "lists in the rig file|no pulses are made until then"
        ),
        "PASS|check_gpio|line 0 of CHIP is there (trigger.line)|",
        "PASS|check_gpio|line 2 of CHIP is there (trigger.gate)|",
        "PASS|check_gpio|line 0 of CHIP is there (trigger.line)|",
        (
            "FAIL|check_gpio_taken|line FAN of CHIP is taken by fan|end that, or name another line as trigger.gate in "
            "the rig file"
        ),
        "PASS|check_beam_whole|line 0 of CHIP is low: the beam of the light barrier is whole",
        "WARN|check_beam_interrupted|line 2 of CHIP is high: the beam of the light barrier is interrupted",
        "PASS|check_beam_whole|line 2 of CHIP is high: the beam of the light barrier is whole",
        "WARN|check_beam_interrupted|line 0 of CHIP is low: the beam of the light barrier is interrupted",
        "PASS|check_barrier|line 0 of CHIP is there for the light barrier: Check on the page tells its level",
        "PASS|check_beam_whole|line 0 of CHIP is low: the beam of the light barrier is whole",
        "WARN|check_beam_interrupted|line 0 of CHIP is low: the beam of the light barrier is interrupted",
        "FAIL|check_barrier_twice|line 0 of CHIP is to serve both the pulses and the light barrier",
        "FAIL|check_barrier_twice|line 2 of CHIP is to serve both the pulses and the light barrier",
        "FAIL|check_barrier_taken|line 1 of CHIP, of the light barrier, is taken by fan",
        (
            "FAIL|check_barrier_chip|light barrier: GPIO chip CHIP has no line 9, but lines 0 to 2: name one that "
            "gpioinfo lists in the rig file"
        ),
    ]
