"""All cameras go, or freeze, during a recording: every pulse has a tag, or the recording says that there is a pause."""

import json
import re
from contextlib import nullcontext
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from recorder.reading.info import info
from rig.api.recordings import Counts
from rig.clocks import host_now
from rig.frame import FrameStatus
from service.headless import HeadlessRig
from service.processes.simulation import simulated_hill
from simrig.programs.simulated_hill import SimulatedHill
from tests.capture.rigs import make_rig, write_rig
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable

pytestmark = pytest.mark.long

NAMES = ("K1", "K2", "K3")
BUSES = {"aravis": "GigE Vision", "iidc": "FireWire"}


@pytest.mark.parametrize("come_back", [True, False])
def test_pulses_without_any_camera_are_tagged_absent(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, come_back: bool
) -> None:
    rig, epoch = make_rig(tmp_path, "aravis", loopback), host_now()
    path, gone = tmp_path / "log.mcap", dict[str, int]()
    with simulated_hill(rig, epoch) as hill:
        assert isinstance(hill, SimulatedHill)

        def on_event(line: str) -> None:
            name = line.partition(" ")[0]
            if line.startswith(f"{name} gone") and name not in gone:
                gone[name] = latest[-1].pulses
                if come_back and len(gone) == len(NAMES):
                    returned.append(latest[-1].complete)
                    for each in NAMES:
                        hill.restart(each)

        def on_progress(counts: Counts) -> None:
            latest.append(counts)
            if counts.pulses > 20 and not killed:
                killed.append(counts.pulses)
                for name in NAMES:
                    hill.kill(name)

        def seen_enough() -> bool:
            """All were away for two seconds, or all are back and their triplets whole."""
            if come_back:
                return bool(returned) and latest[-1].complete >= returned[0] + 30
            return len(gone) == len(NAMES) and latest[-1].pulses >= max(gone.values()) + 60

        killed, returned, latest = list[int](), list[int](), [Counts()]
        with HeadlessRig(rig, "", on_event, lambda _: nullcontext({})) as running:
            running.wait_until_warm()
            running.start_recording(path, session={}, seconds=90)
            ended = running.wait_until_finished(on_progress, seen_enough)
    report = verify(path)
    assert ended.pauses == report.ledger.pauses() == ()
    assert (report.verdict, report.ledger.pulses) == ("partial", ended.counts.pulses)
    away = [run for run in report.ledger.failed.runs if len(run.cameras) == len(NAMES)]
    if come_back:
        assert away
        assert away[-1].last + 30 <= report.ledger.pulses
    else:
        assert report.ledger.failed.causes[FrameStatus.ABSENT] > 3 * 60
        assert away[-1] == report.ledger.failed.runs[-1]
        assert away[-1].last == report.ledger.pulses
    assert report.ledger.rate_hz == pytest.approx(30, abs=0.05)
    fault_table.tell(
        "Cameras and pulses",
        f"all cameras lose their power{', and come back' if come_back else ''}",
        lost=f"none: {report.ledger.failed.causes[FrameStatus.ABSENT]} frames, absent",
        said=f"K1 gone: (why), and so on; svev verify: {report.verdict}",
        code="-",
    )


@pytest.mark.parametrize("backend", ["aravis", "iidc"])
def test_a_recording_in_which_all_cameras_froze_is_never_called_clean(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, backend: str
) -> None:
    """Nobody can tell this from a trigger that pauses: the frame numbers go on without a hole."""
    faults = [
        {"kind": "frozen", "camera": name, "at_pulse": pulse, "duration_s": 1.5}
        for pulse in range(210, 3000, 150)
        for name in NAMES
    ]
    rig = write_rig(tmp_path, backend, loopback, faults=faults)
    done = run_svev("record", "--rig", str(rig), "--seconds", "8", "--out", str(tmp_path), "--json", timeout_s=90)
    assert done.returncode == 5, done.stderr
    assert "no pulses for" in done.stderr.splitlines()[-1]
    assert "look at the trigger" in done.stderr
    result = json.loads(done.stdout)
    assert result["pauses"]
    assert (
        max(pause["seconds"] for pause in result["pauses"]) > 1.3
    )  # others may be cut off by the beginning or the end
    report, said = verify(Path(result["log"])), info(Path(result["log"])).to_json()
    assert report.verdict == "partial"
    assert len(said["pauses"]) == len(report.to_json()["pauses"]) == len(result["pauses"])
    last = re.sub(r" after pulse.*?; ", "; ", re.sub(r", and \d+ more pauses", "", done.stderr.splitlines()[-1]))
    fault = f"all cameras freeze together ({BUSES[backend]})"
    fault_table.tell("Cameras and pulses", fault, lost="a pause", said=last, code=5)
