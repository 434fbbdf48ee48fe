"""`svev doctor` examines the serial port of a trigger box without opening it."""

import os
import pty
from pathlib import Path

import pytest

from rig.settings.trigger import TriggerBoxTrigger
from svev.doctor.finding import Level
from svev.doctor.trigger_box import look_at_trigger_box
from tests.support.rigs import SIM


@pytest.mark.parametrize(
    ("port", "simulated", "level", "word"),
    [
        ("terminal", False, Level.PASS, "may be opened"),
        ("none", False, Level.FAIL, "plug it in"),
        ("file", False, Level.FAIL, "correct trigger.port"),
        ("none", True, None, ""),
    ],
)
def test_the_port_is_examined(tmp_path: Path, port: str, simulated: bool, level: Level | None, word: str) -> None:
    ours, theirs = pty.openpty()
    try:
        (tmp_path / "terminal").symlink_to(os.ttyname(theirs))
        (tmp_path / "file").touch()
        trigger = TriggerBoxTrigger(source="triggerbox", port=str(tmp_path / port))
        changed = {"trigger": trigger} | ({} if simulated else {"simulation": None})
        findings = list(look_at_trigger_box(SIM.model_copy(update=changed)))
    finally:
        os.close(ours)
        os.close(theirs)
    assert [finding.level for finding in findings] == ([] if level is None else [level])
    assert all(word in finding.what for finding in findings)
