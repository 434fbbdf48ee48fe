"""`svev record` with pulses that are GigE Vision action commands: real processes, real Aravis, real packets."""

import json
from pathlib import Path

from mcap.reader import make_reader

from rig.health import Health
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from rig.transport import wire
from service.status.measurements import measurements
from tests.capture.rigs import write_rig
from tests.service.trigger.armed import armed
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.stamps import hill_pulses


def test_scheduled_commands_by_broadcast_are_recorded_unmixed_and_their_answers_are_in_the_log(
    tmp_path: Path, loopback: Loopback
) -> None:
    path = write_rig(tmp_path, "aravis", loopback, source="action", rate_hz=8.0)
    keys = 'source = "action"\nscheduled = true\nlead_ms = 50\nbroadcast = ["127.255.255.255"]'
    path.write_text(path.read_text().replace('source = "action"', keys))
    out = str(tmp_path / "logs")
    done = run_svev("record", "--rig", str(path), "--seconds", "2", "--out", out, "--json", timeout_s=90)
    assert done.returncode in {0, 5}, done.stderr  # 5: the busy machine did not send a command in time
    result = json.loads(done.stdout)
    if done.returncode == 0:
        assert result["alarms"] == []
    assert result["complete"] > result["pulses"] / 2
    log = Path(result["log"])
    assert {len(pulses) for pulses in hill_pulses(log, load_rig(path)).values()} == {1}
    with log.open("rb") as file:
        messages = [message.data for *_, message in make_reader(file).iter_messages(topics=["/health"])]
    health = wire.decoder(Health).decode(messages[-1])
    answers = [camera.actions for camera in health.cameras if camera.actions is not None]
    assert len(answers) == 3
    assert min(each.acknowledged for each in answers) > 0
    assert {each.refused for each in answers} == {0}
    _are_told(load_rig(path), health)


def _are_told(rig: RigSettings, health: Health) -> None:
    """Status and metrics show the answers of a health record."""
    status = armed(rig, health)
    wanted = {camera.name: camera.actions.acknowledged for camera in health.cameras if camera.actions}
    assert {camera.name: camera.actions.acknowledged for camera in status.cameras if camera.actions} == wanted
    (family,) = (each for each in measurements(status, health) if each.name == "svev_actions_acknowledged")
    assert {sample.labels["camera"]: sample.value for sample in family.samples} == wanted
