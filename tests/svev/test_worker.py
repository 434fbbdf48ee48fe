"""`svev worker` as a process of its own."""

import json
import signal
from pathlib import Path

from rig.settings.file import CONFIG
from simrig.world.scenario import load_scenario
from simrig.world.survey import survey
from tests.support.commands import start_svev
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until


def test_a_closed_terminal_ends_it_like_ctrl_c(tmp_path: Path, loopback: Loopback) -> None:
    balls = tmp_path / "survey.json"
    balls.write_text(json.dumps(survey(load_scenario(CONFIG / "scenarios" / "training.toml"))))
    addresses = ("--connect", loopback.endpoint(), "--bind", loopback.endpoint())
    with start_svev("worker", *addresses, "--survey", str(balls), "--json") as worker:
        wait_until(lambda: "end with Ctrl-C" in worker.written()[1], "waiting for triplets", 60)
        worker.send_signal(signal.SIGHUP)
        said, complaint = worker.communicate(60)
    assert (worker.returncode, json.loads(said)["pulses"]) == (0, 0), complaint
