"""The computer's clock is set while a recording goes on: its times go on, and the log says by how much it was set."""

import json
import os
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from rig.clocks import NS_PER_S
from tests.capture.rigs import write_rig
from tests.support import preloaded
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

_CLOCK = Path(preloaded.__file__).with_name("set_clock.c")


@pytest.mark.parametrize("by_s", [86_400, -0.75])
def test_a_clock_that_is_set_is_an_event_and_no_time_of_the_log_jumps(
    tmp_path: Path, loopback: Loopback, by_s: float
) -> None:
    control, logs = tmp_path / "clock", tmp_path / "logs"
    control.write_bytes(struct.pack("=q", 0))
    moved = preloaded.preloading(preloaded.compiled(_CLOCK, tmp_path))
    command = [sys.executable, "-m", "svev", "record", "--rig", str(write_rig(tmp_path, "sim", loopback)), "--json"]
    recording = subprocess.Popen(
        [*command, "--seconds", "4", "--out", str(logs)], stdout=subprocess.PIPE,
        env={**os.environ, **moved, "SVEV_TEST_CLOCK": str(control)},
    )  # fmt: skip
    wait_until(lambda: any(log.stat().st_size > 5_000_000 for log in logs.glob("*.mcap")), "recording", 60)
    with control.open("r+b") as file:
        file.write(struct.pack("=q", round(by_s * NS_PER_S)))
    result = json.loads(recording.communicate(timeout=60)[0])
    assert recording.returncode in {0, 5}, "5: this computer was too slow for some frames"
    checked = verify(Path(result["log"]))
    said = [event.message for event in checked.events if "clock was set" in event.message]
    text = "the computer's clock was set by {:+.3f} s, or it was suspended; the times in the log go on"
    assert said == [text.format(by_s)]
    assert not checked.damaged
    assert not checked.ended_early
    assert not checked.off_time
