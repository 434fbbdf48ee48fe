"""A camera whose cable carries too little: its frames come too late, and that is said, not that it is absent."""

import json
import re
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from tests.capture.rigs import write_rig
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable

pytestmark = pytest.mark.long


@pytest.mark.parametrize("mbit_s", [40.0, 15.0])
def test_frames_of_a_slow_link_are_lost_not_absent(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, mbit_s: float
) -> None:
    """The camera sends 74 Mbit/s. At 15 Mbit/s a frame needs 160 ms."""
    faults = [
        {"kind": "slow_link", "camera": "K2", "at_pulse": pulse, "duration_s": 3.0, "mbit_s": mbit_s}
        for pulse in range(240, 3000, 240)
    ]
    rig = write_rig(tmp_path, "aravis", loopback, faults=faults)
    done = run_svev("record", "--rig", str(rig), "--seconds", "10", "--out", str(tmp_path), "--json", timeout_s=90)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["pulses"] == 300
    assert result["causes"]["lost"] > 20
    assert result["causes"]["absent"] == 0
    said = [event.message for event in verify(Path(result["log"])).events if event.name == "K2"]
    (slow,) = {re.sub(r"\d+ ms", "N ms", text) for text in said if "its frames come too late" in text}
    assert "the link is too slow" in slow
    assert not any(text.startswith("gone") for text in said), "a new connection would cost frames and mend nothing"
    fault_table.tell(
        "Cameras and pulses",
        f"the link of a camera takes {mbit_s:g} Mbit/s of 74",
        lost=f"none: {result['causes']['lost']} frames of K2, lost",
        said=f"K2 {slow}",
        code=0,
    )
