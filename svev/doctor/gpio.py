"""Examines the lines of the computer that the rig file names: that of the pulses, and that of a light barrier."""

from collections.abc import Iterator

from rig.errors import TriggerError
from rig.settings.model import RigSettings
from rig.settings.trigger import GpioLine, GpioTrigger
from svev.doctor.finding import Finding, Topic, failure, passed
from triggering.sources.gpio.lines import CONSUMER, consumer_of


def look_at_gpio(rig: RigSettings) -> Iterator[Finding]:
    """Is the chip there, may it be opened, and is the line free? The line is left as it is."""
    trigger = rig.trigger
    if not isinstance(trigger, GpioTrigger):
        return
    yield from _look_at_line(trigger, "trigger.line", trigger.line)
    if trigger.gate is not None:
        yield from _look_at_line(trigger, "trigger.gate", trigger.gate.line)


def _look_at_line(trigger: GpioTrigger, setting: str, line: GpioLine) -> Iterator[Finding]:
    chip = trigger.chip
    try:
        consumer = consumer_of(chip, line)
    except TriggerError as error:
        what, remedy = "{setting}: {why}", "no pulses are made until then"
        yield failure(Topic.CAMERAS, "check_gpio_chip", what, remedy, setting=setting, why=error.said)
        return
    if consumer in {"", CONSUMER}:
        what = "line {line} of {chip} is there ({setting})"
        yield passed(Topic.CAMERAS, "check_gpio", what, line=line, chip=chip, setting=setting)
    else:
        what = "line {line} of {chip} is taken by {consumer}"
        remedy = "end that, or name another line as {setting} in the rig file"
        yield failure(
            Topic.CAMERAS, "check_gpio_taken", what, remedy, consumer=consumer, line=line, chip=chip, setting=setting
        )


def look_at_barrier(rig: RigSettings) -> Iterator[Finding]:
    """Is the chip there, may it be opened, and is the line free or with svev? The line is left as it is."""
    barrier = rig.automatic.barrier
    if barrier is None:
        return
    line, chip = barrier.line, barrier.chip
    try:
        consumer = consumer_of(chip, line)
    except TriggerError as error:
        remedy = "correct barrier under [automatic] in the rig file; it begins no recordings until then"
        yield failure(Topic.CAMERAS, "check_barrier_chip", "light barrier: {why}", remedy, why=error.said)
        return
    trigger = rig.trigger
    if isinstance(trigger, GpioTrigger) and trigger.chip == chip and line in trigger.lines:
        what = "line {line} of {chip} is to serve both the pulses and the light barrier"
        remedy = "name another line for one of them in the rig file"
        yield failure(Topic.CAMERAS, "check_barrier_twice", what, remedy, line=line, chip=chip)
    elif consumer in {"", CONSUMER}:
        what = "line {line} of {chip} is there for the light barrier"
        yield passed(Topic.CAMERAS, "check_barrier", what, line=line, chip=chip)
    else:
        what = "line {line} of {chip}, of the light barrier, is taken by {consumer}"
        remedy = "end that, or name another line as barrier under [automatic] in the rig file"
        yield failure(Topic.CAMERAS, "check_barrier_taken", what, remedy, consumer=consumer, line=line, chip=chip)
