"""`svev record` with a trigger box: svev starts it, and it tells of the pulses that reach no camera."""

import json
from pathlib import Path

from rig.settings.file import CONFIG
from tests.support.commands import run_svev
from tests.support.loopback import Loopback


def test_pulses_that_the_box_fired_and_no_camera_saw_are_in_the_log(tmp_path: Path, loopback: Loopback) -> None:
    """The cable is out for some pulses: without the box's word they would be a pause."""
    scenario = tmp_path / "hill.toml"
    gaps = [[pulse, pulse + 2] for pulse in range(0, 3000, 10)]
    scenario.write_text(f'base = "{CONFIG / "scenarios" / "training.toml"}"\npauses = {gaps}\n')
    rig = tmp_path / "rig.toml"
    rig.write_text(
        'name = "box"\n[trigger]\nsource = "triggerbox"\nrate_hz = 9.0\nsettle_s = 60\n'
        f'[network]\npublish = "{loopback.endpoint()}"\n'
        f'[simulation]\nscenario = "{scenario}"\n'
        '[[cameras]]\nname = "K1"\nbackend = "sim"\n[[cameras]]\nname = "K2"\nbackend = "sim"\n'
    )
    out = str(tmp_path / "logs")
    done = run_svev("record", "--rig", str(rig), "--seconds", "3", "--json", "--out", out, timeout_s=120)
    assert done.returncode == 5, done.stderr
    result = json.loads(done.stdout)
    assert result["pauses"] == []
    assert 4 <= result["partial"] <= 6, result
    assert result["causes"]["missed"] == 2 * result["partial"]
    assert sum(result["causes"].values()) == result["causes"]["missed"]
    assert [alarm.split(" has fired")[0] for alarm in result["alarms"]] == ["the source"]
    assert "trigger makes 8.9999 pulses per second, -8 ppm off trigger.rate_hz" in done.stderr
