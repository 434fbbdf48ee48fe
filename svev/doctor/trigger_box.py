"""Examines the serial port of a trigger box, without opening it: opening would reset the box."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

from rig.settings.model import RigSettings
from rig.settings.trigger import TriggerBoxTrigger
from svev.doctor.finding import Finding, Topic, failure, passed
from triggering.sources.triggerbox.line import why_not_open


def look_at_trigger_box(rig: RigSettings) -> Iterator[Finding]:
    """Is the port there, and may this user open it?"""
    if not isinstance(rig.trigger, TriggerBoxTrigger) or rig.simulation is not None:
        return
    port = rig.trigger.port
    number = 0
    if not Path(port).exists():
        number = errno.ENOENT
    elif not os.access(port, os.R_OK | os.W_OK):
        number = errno.EACCES
    elif not Path(port).is_char_device():
        number = errno.ENOTTY
    if number:
        remedy = "without it there are no pulses"
        why = why_not_open(port, number, os.strerror(number))
        yield failure(Topic.CAMERAS, "check_trigger_box_away", "{why}", remedy, why=why)
        return
    yield passed(
        Topic.CAMERAS, "check_trigger_box", "the port of the trigger box, {port}, is there and may be opened", port=port
    )
