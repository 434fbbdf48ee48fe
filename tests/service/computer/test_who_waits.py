"""No data process waits for a process that does not read, and a supervisor does not wait for a recorder."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from recorder.reading.log_reader import LogReader
from rig.clocks import host_now
from rig.events import Event, Level
from rig.phrase import plain
from rig.transport.recorder_commands import RecorderOptions, StartRecording, StopRecording, TellEvent
from rig.transport.recorder_reports import RecordingFinished, RecordingStarted
from service.processes.rig_processes import RigProcesses
from service.processes.rig_programs import RECORDER
from tests.capture.rigs import make_rig, write_rig
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.waiting import wait_until

pytestmark = pytest.mark.long

WAIT_S = 60.0
#: `svev record` whose channels hold a second of reports: they would take a minute to fill.
SMALL_CHANNELS = """
import socket, sys
make = socket.socketpair
def small(*kind):
    pair = make(*kind)
    if kind:
        return pair
    for end in pair:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)
    return pair
socket.socketpair = small
from svev.cli import main
sys.exit(main())
"""


@pytest.mark.parametrize(
    ("backend", "ctrl_z"), [("sim", False), ("aravis", False), ("sim", True)], ids=["sim", "aravis", "Ctrl-Z"]
)
def test_a_stopped_parent_costs_no_pulse(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, backend: str, *, ctrl_z: bool
) -> None:
    rig, out = write_rig(tmp_path, backend, loopback), tmp_path / "logs"
    options = ["record", "--rig", str(rig), "--seconds", "8", "--out", str(out), "--json"]
    command = [sys.executable, "-c", SMALL_CHANNELS, *options]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0
    ) as process:
        try:
            wait_until(lambda: _size(out) > 5_000_000, "recording", WAIT_S)
            if ctrl_z:
                os.killpg(process.pid, signal.SIGTSTP)  # as a terminal does
            else:
                process.send_signal(signal.SIGSTOP)
            wait_until(lambda: _state(process.pid) == "T", "it stands still", WAIT_S)
            wait_until(lambda: _closed(out), "the recording goes on and ends while its parent stands still", WAIT_S)
        finally:
            process.send_signal(signal.SIGCONT)
        said, complaints = process.communicate(timeout=WAIT_S)
    result = json.loads(said)
    assert (process.returncode, result["pulses"]) == (0, 240), complaints
    assert result["complete"] > 220, "a machine that is overloaded may lose some"
    report = verify(Path(result["log"]))
    assert not report.damaged
    assert report.ledger.pulses == 240
    what = "Ctrl-Z" if ctrl_z else f"SIGSTOP to `svev record` ({backend})"
    said = "nothing: the recording goes on and ends, and the log is closed"
    fault_table.tell("Processes", what, lost=0, said=said, code=process.returncode)


def test_a_stopped_recorder_costs_the_supervisor_no_time_and_no_command(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    rig = make_rig(tmp_path, "sim", loopback)
    options = RecorderOptions(directory=tmp_path)
    path = tmp_path / "told.mcap"
    texts = [f"{number} {'x' * 500}" for number in range(3000)]
    with RigProcesses(rig, lambda _: None, epoch=host_now(), recorder=options) as processes:

        def turned(kind: type) -> bool:
            return any(isinstance(report, kind) for report in processes.turn(0.05))

        wait_until(lambda: bool(processes.turn(0.05)) and processes.seen.warm, "whole triplets come", WAIT_S, 0.0)
        processes.tell(StartRecording(path=path, session={}, preroll_s=0.0))
        wait_until(lambda: turned(RecordingStarted), "it records", WAIT_S, 0.0)
        recorder = processes.pids[RECORDER]
        os.kill(recorder, signal.SIGSTOP)
        for text in texts:
            processes.tell(TellEvent(event=Event.now(Level.INFO, "test", plain(text))))
        processes.tell(StopRecording())
        os.kill(recorder, signal.SIGCONT)
        wait_until(lambda: turned(RecordingFinished), "the recording is over", WAIT_S, 0.0)
    with LogReader(path) as reader:
        events = [Event.from_protobuf(message.data or b"") for message in reader.messages("/events")]
    assert [event.message for event in events if event.name == "test"] == texts
    said = "all commands are obeyed when it goes on"
    fault_table.tell("Processes", "SIGSTOP to the recorder, and SIGCONT", lost=0, said=said)


def _state(pid: int) -> str:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]


def _size(out: Path) -> int:
    return sum(log.stat().st_size for log in out.glob("*.mcap"))


def _closed(out: Path) -> bool:
    (log,) = out.glob("*.mcap")
    with log.open("rb") as file:
        file.seek(-8, os.SEEK_END)
        return file.read() == b"\x89MCAP0\r\n"
