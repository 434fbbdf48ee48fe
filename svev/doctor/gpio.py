"""Examines the lines of the computer that the rig file names: that of the pulses, and that of a light barrier."""

from collections.abc import Iterator

from rig.errors import TriggerError
from rig.phrase import phrase
from rig.settings.model import RigSettings
from rig.settings.trigger import BarrierSettings, GpioLine, GpioTrigger
from svev.doctor.finding import Finding, Topic, failure, passed, warning
from triggering.sources.gpio.lines import CONSUMER, InputLine, consumer_of


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


def look_at_barrier(rig: RigSettings, interrupted: bool | None = None) -> Iterator[Finding]:
    """Is the chip there, may it be opened, is the line free or with svev, and is the beam whole?

    Args:
        rig: the rig.
        interrupted: whether the beam is, as this process sees that has the line; None: the line is asked if it is free.
    """
    barrier = rig.automatic.barrier
    if barrier is None:
        return
    line, chip = barrier.line, barrier.chip
    try:
        consumer, trigger = consumer_of(chip, line), rig.trigger
        if isinstance(trigger, GpioTrigger) and trigger.chip == chip and line in trigger.lines:
            what = "line {line} of {chip} is to serve both the pulses and the light barrier"
            remedy = "name another line for one of them in the rig file"
            yield failure(Topic.CAMERAS, "check_barrier_twice", what, remedy, line=line, chip=chip)
        elif consumer not in {"", CONSUMER}:
            what = "line {line} of {chip}, of the light barrier, is taken by {consumer}"
            remedy = "end that, or name another line as barrier under [automatic] in the rig file"
            yield failure(Topic.CAMERAS, "check_barrier_taken", what, remedy, consumer=consumer, line=line, chip=chip)
        else:
            if not consumer:
                with InputLine(chip, line, active_low=barrier.active_low) as asked:
                    interrupted = asked.active()
            yield _beam(barrier, interrupted)
    except TriggerError as error:
        remedy = "correct barrier under [automatic] in the rig file; it begins no recordings until then"
        yield failure(Topic.CAMERAS, "check_barrier_chip", "light barrier: {why}", remedy, why=error.said)


def _beam(barrier: BarrierSettings, interrupted: bool | None) -> Finding:
    """What the level of the line says of the beam; None: it is not known."""
    line, chip = barrier.line, barrier.chip
    if interrupted is None:
        what = "line {line} of {chip} is there for the light barrier: Check on the page tells its level"
        return passed(Topic.CAMERAS, "check_barrier", what, line=line, chip=chip)
    high = interrupted != barrier.active_low
    level = phrase("line_high", "high") if high else phrase("line_low", "low")
    if not interrupted:
        what = "line {line} of {chip} is {level}: the beam of the light barrier is whole"
        return passed(Topic.CAMERAS, "check_beam_whole", what, line=line, chip=chip, level=level)
    what = "line {line} of {chip} is {level}: the beam of the light barrier is interrupted"
    remedy = (
        "if nothing is in the beam, align the barrier and look at its cable; if it is whole, active_low of barrier "
        "under [automatic] in the rig file must be {other}"
    )
    other = "false" if barrier.active_low else "true"
    return warning(
        Topic.CAMERAS, "check_beam_interrupted", what, remedy, line=line, chip=chip, level=level, other=other
    )
