"""Times of a real camera's frames slip by one period: nothing is mixed, and `svev record` says so and ends with 5."""

import json
from pathlib import Path

import pytest

from recorder.checking.verify import Verdict, verify
from rig.settings.file import load_rig
from tests.capture.rigs import write_rig
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.stamps import hill_pulses

RATE_HZ = 30.0
#: Long after all cameras are connected, and well before the recording ends.
FIRST, SECONDS = 450, 18


@pytest.mark.long
@pytest.mark.parametrize("periods", [-1, 1])
def test_times_that_slip_are_an_alarm_and_mix_nothing(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, periods: int
) -> None:
    slip = {
        "kind": "times_slip", "camera": "K2", "at_pulse": FIRST, "count": 100_000, "slip_ms": periods * 1000 / RATE_HZ,
    }  # fmt: skip
    path = write_rig(tmp_path, "aravis", loopback, faults=[slip], rate_hz=RATE_HZ)
    done = run_svev(
        "record", "--rig", str(path), "--seconds", str(SECONDS), "--out", str(tmp_path), "--json", timeout_s=120
    )
    assert done.returncode == 5, done.stderr
    result = json.loads(done.stdout)
    said = (
        "numbers, times and arrivals of the frames of K2 contradict each other, and its frames are not used: disarm, "
        "restart the camera, and arm again"
    )
    assert said in result["alarms"]
    assert said in done.stderr
    log = Path(result["log"])
    hill = hill_pulses(log, load_rig(path))
    assert {len(seen) for seen in hill.values()} == {1}
    report = verify(log)
    assert report.verdict is Verdict.PARTIAL
    assert report.recounted.misfiled == ()
    assert result["complete"] > 60
    assert result["causes"]["damaged"] > 60, result
    assert max(min(seen) for seen in hill.values()) > FIRST + 60
    what = f"times of a camera's frames slip one period {'back' if periods < 0 else 'on'} (GigE Vision)"
    fault_table.tell("Cameras and pulses", what, lost="none: its frames from then on, damaged", said=said, code=5)
