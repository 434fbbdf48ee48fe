"""`svev record` as a user runs it: real processes, real signals, on the simulated hill."""

import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from recorder.checking.verify import verify
from recorder.reading.info import info
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.events import Event
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.settings.file import load_rig
from tests.capture.rigs import write_rig
from tests.support.commands import Command, start_svev
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable
from tests.support.repeats import repeats
from tests.support.stamps import hill_pulses
from tests.support.waiting import wait_until

PROCESSES = "Processes"


def _record(rig: Path, out: Path, seconds: float, *more: str) -> Command:
    return start_svev("record", "--rig", str(rig), "--seconds", str(seconds), "--out", str(out), "--json", *more)


def _result(process: Command, timeout_s: float = 60) -> tuple[int, dict[str, Any], str]:
    out, err = process.communicate(timeout=timeout_s)
    return process.wait(), json.loads(out) if out else {}, err


def _children(pid: int) -> dict[str, int]:
    """Child processes of `svev record` by their row in the process table."""
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            words = (entry / "cmdline").read_bytes().split(b"\0")
        except (FileNotFoundError, ProcessLookupError):
            continue
        if parent == pid and b"-m" in words:
            found[words[words.index(b"-m") + 2].decode()] = int(entry.name)
    return found


def _recording(out: Path) -> Callable[[], bool]:
    """True once a log in `out` has grown by some triplets."""
    return lambda: any(log.stat().st_size > 5_000_000 for log in out.glob("*.mcap"))


@pytest.mark.parametrize("backend", repeats(["aravis", "sim", "iidc", "mixed"]))
def test_every_pulse_is_recorded_whole_and_unmixed(tmp_path: Path, loopback: Loopback, backend: str) -> None:
    path = write_rig(tmp_path, backend, loopback)
    code, result, err = _result(_record(path, tmp_path / "logs", 2))
    assert (code, result["pulses"], result["complete"], result["partial"]) == (0, 60, 60, 0), err
    assert set(result["causes"].values()) == {0}
    assert result["bytes"] == Path(result["log"]).stat().st_size
    report = verify(Path(result["log"]))
    assert report.verdict == "clean", report
    assert report.recounted.agrees, report.recounted.differences
    assert info(Path(result["log"])).utc is not None
    hill = hill_pulses(Path(result["log"]), load_rig(path))
    assert [len(seen) for seen in hill.values()] == [1] * 60
    first = min(hill[PulseNumber(1)])
    assert {pulse: min(seen) for pulse, seen in hill.items()} == {n: first + n - 1 for n in range(1, 61)}
    assert _true_pulses(Path(result["log"])) == {n: first + n - 1 for n in range(1, 61)}


def _true_pulses(log: Path) -> dict[int, int]:
    """The hill pulse of each pulse of a log, by its truth."""
    truth = json.loads(log.with_suffix(".truth.json").read_text())
    assert [state["pulse"] for state in truth["pulses"]] == list(truth["hill_pulse_of_recording"].values())
    return {int(pulse): hill for pulse, hill in truth["hill_pulse_of_recording"].items()}


@pytest.mark.parametrize("backend", repeats(["aravis", "sim", "iidc"]))
def test_the_truth_is_found_without_stamps_beside_pauses_and_missed_pulses(
    tmp_path: Path, loopback: Loopback, backend: str
) -> None:
    """The pulses pause and K1 goes away again and again, so that the recording meets some whenever it begins."""
    pauses = [[pulse, pulse + 9] for pulse in range(15, 1800, 45)]
    faults = [{"kind": "missed_pulse", "camera": "K1", "at_pulse": pulse, "count": 7} for pulse in range(5, 1800, 45)]
    scenario = f"stamp = false\npauses = {pauses}"
    path = write_rig(tmp_path, backend, loopback, faults=faults, scenario=scenario)
    _, result, err = _result(_record(path, tmp_path / "logs", 3))
    log = Path(result["log"])
    assert "not written" not in err
    hill = _true_pulses(log)
    assert list(hill) == list(range(1, result["pulses"] + 1))
    assert not any(first <= pulse < end for pulse in hill.values() for first, end in pauses)
    tags = [tag for tag, _ in triplets(log)]
    for before, after in pairwise(tags):
        periods = (after.time - before.time) * 30 / 1e9
        assert hill[after.pulse] - hill[before.pulse] == round(periods)
    assert max(hill[after.pulse] - hill[before.pulse] for before, after in pairwise(tags)) == 10


@dataclass(frozen=True, slots=True)
class Befallen:
    """A fault that befalls single frames of a camera, what becomes of them, and how the table of faults calls it."""

    kind: str
    camera: str
    status: str
    words: str
    more: dict[str, Any] = field(default_factory=dict)

    def at(self, pulse: int) -> dict[str, Any]:
        """The fault at a pulse of the hill, as it stands in a scenario."""
        return {"kind": self.kind, "camera": self.camera, "at_pulse": pulse, **self.more}


_USUAL = (
    Befallen("missed_pulse", "K1", "missed", "a camera does not see a pulse"),
    Befallen("lost_frame", "K2", "lost", "a frame is lost in transfer"),
    Befallen("damaged_frame", "K3", "damaged", "a frame comes damaged"),
)
#: By back end; packets get lost on networks only, and on FireWire, which has a matrix of its own.
BEFALLEN = {
    "sim": _USUAL,
    "aravis": (
        *_USUAL,
        Befallen("missed_pulse", "K2", "missed", "the middle camera does not see a pulse"),
        Befallen("missed_pulse", "K3", "missed", "the last camera does not see a pulse"),
        Befallen(
            "lost_packets",
            "K2",
            "damaged",
            "packets of a frame are lost for good",
            {"packets": [3, 4], "resend": False},
        ),
        Befallen("lost_packets", "K3", "ok", "packets of a frame are lost, and sent again", {"packets": [3, 4]}),
        Befallen("lost_leader", "K1", "damaged", "the first packet of a frame is lost for good", {"resend": False}),
    ),
}


@pytest.mark.parametrize("backend", repeats(["aravis", "sim"]))
def test_each_fault_is_recorded_with_its_cause(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, backend: str
) -> None:
    """Faults come again and again, so that the recording meets some whenever it begins."""
    befallen = BEFALLEN[backend]
    faults = [each.at(pulse) for place, each in enumerate(befallen) for pulse in range(20 + 8 * place, 1800, 64)]
    path = write_rig(tmp_path, backend, loopback, faults=faults)
    code, result, err = _result(_record(path, tmp_path / "logs", 2.5))
    assert (code, result["pulses"]) == (0, 75), err
    log = Path(result["log"])
    hill = hill_pulses(log, load_rig(path))
    assert all(len(seen) == 1 for seen in hill.values())
    expected = {
        (min(hill[pulse]), each.camera): each.status
        for pulse in hill
        for each in befallen
        if each.at(min(hill[pulse])) in faults and each.status != "ok"
    }
    found = {
        (min(hill[tag.pulse]), camera.name): camera.status.value
        for tag, _ in triplets(log)
        for camera in tag.cameras
        if camera.status != "ok"
    }
    assert found == expected
    assert set(expected.values()) == {"missed", "lost", "damaged"}
    recounted = verify(log).recounted
    assert recounted.agrees, recounted.differences
    assert _true_pulses(log) == {pulse: min(seen) for pulse, seen in hill.items()}
    for each in befallen:
        fault = f"{each.words} ({'GigE Vision' if backend == 'aravis' else 'sim'})"
        lost = "none" if each.status == "ok" else "none: that frame"
        fault_table.tell("Cameras and pulses", fault, lost=lost, said=f"{each.camera} {each.status}", code=code)


def test_ctrl_c_ends_the_recording_properly(tmp_path: Path, loopback: Loopback, fault_table: FaultTable) -> None:
    process = _record(write_rig(tmp_path, "sim", loopback), tmp_path / "logs", 60)
    wait_until(_recording(tmp_path / "logs"), "recording")
    process.send_signal(signal.SIGINT)
    code, result, err = _result(process)
    assert code == 0, err
    assert result["stopped_early"]
    assert verify(Path(result["log"])).verdict == "clean"
    fault_table.tell(PROCESSES, "Ctrl-C during `svev record`", lost=0, said='"stopped_early": true', code=code)


def test_a_terminal_that_is_closed_ends_the_recording_properly(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    """The kernel and its shell send SIGHUP to all processes of its window, and standard error is taken away."""
    rig = write_rig(tmp_path, "sim", loopback)
    command = [sys.executable, "-m", "svev", "record", "--rig", str(rig), "--seconds", "60", "--json"]
    process = subprocess.Popen(
        [*command, "--out", str(tmp_path / "logs")],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stderr is not None
    with process.stdout:
        assert process.stderr.readline()
        process.stderr.close()
        wait_until(_recording(tmp_path / "logs"), "recording")
        for _ in range(2):
            os.killpg(process.pid, signal.SIGHUP)
        result = json.loads(process.stdout.read())
    code = process.wait(60)
    assert (code, result["stopped_early"]) == (0, True)
    assert verify(Path(result["log"])).verdict == "clean"
    what = "the terminal of `svev record` is closed (SIGHUP), nobody reads standard error"
    fault_table.tell(PROCESSES, what, lost=0, said='"stopped_early": true', code=code)


@pytest.mark.parametrize("number", repeats([signal.SIGTERM, signal.SIGINT]))
def test_a_signal_to_all_processes_at_once_ends_the_recording_properly(
    tmp_path: Path, loopback: Loopback, number: signal.Signals
) -> None:
    """As `timeout` sends it, to the program and then to its group, and systemd where a session ends."""
    command = [sys.executable, "-m", "svev", "record", "--rig", str(write_rig(tmp_path, "sim", loopback)), "--json"]
    process = subprocess.Popen(
        [*command, "--seconds", "60", "--out", str(tmp_path / "logs")], stdout=subprocess.PIPE, start_new_session=True
    )
    wait_until(_recording(tmp_path / "logs"), "recording")
    process.send_signal(number)
    os.killpg(process.pid, number)
    result = json.loads(process.communicate(timeout=60)[0])
    assert (process.returncode, result["stopped_early"]) == (0, True)
    checked = verify(Path(result["log"]))
    assert (checked.verdict, checked.ended_early) == ("clean", "")


def test_a_full_disk_behind_standard_error_ends_no_recording(tmp_path: Path, loopback: Loopback) -> None:
    rig, out = write_rig(tmp_path, "sim", loopback), tmp_path / "logs"
    command = [sys.executable, "-m", "svev", "record", "--rig", str(rig), "--seconds", "1", "--out", str(out), "--json"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=full, text=True, timeout=60, check=False)
    assert done.returncode == 0
    assert verify(Path(json.loads(done.stdout)["log"])).verdict == "clean"


@pytest.mark.parametrize("backend", repeats(["sim", "aravis"]))
def test_a_killed_grabber_costs_its_own_frames_only(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable, backend: str
) -> None:
    process = _record(write_rig(tmp_path, backend, loopback), tmp_path / "logs", 120)
    wait_until(_recording(tmp_path / "logs"), "recording")
    (log,) = (tmp_path / "logs").glob("*.mcap")
    os.kill(_children(process.pid)["K2"], signal.SIGKILL)
    wait_until(lambda: "SIGKILL" in _said_of(log, "K2"), "the death is in the log")
    wait_until(lambda: "connected" in _said_of(log, "K2").partition("SIGKILL")[2], "K2 is back", 60)
    size = log.stat().st_size
    wait_until(lambda: log.stat().st_size > size + 60_000_000, "more is recorded", 60)
    process.send_signal(signal.SIGINT)
    code, result, err = _result(process)
    assert code == 0, err
    assert "K2" in err
    assert result["causes"]["absent"] > 0
    fates = [[camera.status for camera in tag.cameras] for tag, _ in triplets(log)]
    assert all(FrameStatus.ABSENT not in (first, last) for first, _, last in fates), "the others go on"
    assert fates[-1][1] is not FrameStatus.ABSENT
    report = verify(log)
    assert not report.damaged
    assert report.recounted.agrees, report.recounted.differences
    lost = f"none: {result['causes']['absent']} frames of K2, absent"
    said = next(line for line in err.splitlines() if "SIGKILL" in line)
    fault_table.tell(PROCESSES, f"kill -9 of a grabber ({backend})", lost=lost, said=said, code=code)


def _said_of(log: Path, name: str) -> str:
    """What the events of a log, which may still grow, say of a camera."""
    with LogReader(log) as reader:
        events = [Event.from_protobuf(message.data or b"") for message in reader.messages("/events")]
    return " | ".join(event.message for event in events if event.name == name)


def test_a_killed_recorder_leaves_a_readable_log_and_no_process(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    process = _record(write_rig(tmp_path, "sim", loopback), tmp_path / "logs", 60)
    wait_until(_recording(tmp_path / "logs"), "recording")
    os.kill(_children(process.pid)["recorder"], signal.SIGKILL)
    code, _, err = _result(process)
    assert code == 6
    assert "svev verify" in err
    assert "Traceback" not in err
    (log,) = (tmp_path / "logs").glob("*.mcap")
    report = verify(log)
    assert report.ledger.pulses > 2
    assert not report.closed
    said = err.strip().splitlines()[-1]
    fault_table.tell(PROCESSES, "kill -9 of the recorder", lost="those from then on", said=said, code=code)


def test_a_killed_parent_leaves_a_finished_log_and_no_process(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    process = _record(write_rig(tmp_path, "aravis", loopback), tmp_path / "logs", 60)
    wait_until(_recording(tmp_path / "logs"), "recording")
    children = _children(process.pid)
    process.kill()
    process.communicate(timeout=10)
    wait_until(lambda: not any(Path(f"/proc/{pid}").exists() for pid in children.values()), "children gone", 15)
    (log,) = (tmp_path / "logs").glob("*.mcap")
    report = verify(log)
    assert report.closed
    said = next(event.message for event in report.events if "service process is gone" in event.message)
    what = "kill -9 of `svev record`"
    fault_table.tell(
        PROCESSES, what, lost="those from then on", said=f"{said} (event in the log)", code=process.returncode
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("[trigger]", "[trigger"), "rig.toml: not valid TOML"),
        (("rate_hz", "rate_herz"), 'unknown key "trigger.rate_herz"; did you mean "rate_hz"?'),
        (('"scenario.toml"', '"nowhere.toml"'), "nowhere.toml: no such file"),
        (("tcp://127", "tcp://300"), "cannot be bound"),
        (
            ('backend = "sim"', 'backend = "sim"\nregion = { width = 16384, height = 16384 }'),
            "a log takes 256 MB per pulse at most; make the cameras' regions smaller",
        ),
        (
            ("[[cameras]]", "[recorder]\ntriplets_s = 60\n[[cameras]]\nregion = { width = 9000, height = 9000 }"),
            "GB are available: lower recorder.triplets_s, which takes",
        ),
    ],
)
def test_bad_input_is_one_line_and_exit_2(
    tmp_path: Path, loopback: Loopback, change: tuple[str, str], words: str
) -> None:
    path = write_rig(tmp_path, "sim", loopback)
    text = path.read_text().replace(*change)
    path.write_text(text.replace("[recorder]\ntriplets_s = 60\n", "", text.count("[recorder]") - 1))
    code, _, err = _result(_record(path, tmp_path / "logs", 1))
    assert code == 2
    assert words in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("session", "has"),
    [("x" * 9000, "9000 characters"), ("two\nlines", "a control character"), ("\x1b[2J", "a control")],
)
def test_a_session_that_no_log_holds_is_refused(tmp_path: Path, loopback: Loopback, session: str, has: str) -> None:
    path = write_rig(tmp_path, "sim", loopback)
    code, _, err = _result(_record(path, tmp_path / "logs", 1, "--session", session))
    assert code == 2
    assert err.startswith(f"svev: --session has {has}")
    assert err.endswith("give a name of at most 200 characters in one line\n")
    assert not (tmp_path / "logs").exists()


def test_a_camera_that_is_not_there_is_named(tmp_path: Path, loopback: Loopback, fault_table: FaultTable) -> None:
    path = write_rig(tmp_path, "aravis", loopback)
    path.write_text(path.read_text().replace('[simulation]\nscenario = "scenario.toml"\n', "settle_s = 1.0\n"))
    code, _, err = _result(_record(path, tmp_path / "logs", 1))
    assert code == 2
    assert f"camera K1 at {loopback.cameras(1)[0]} does not answer" in err.splitlines()[-1]
    said = re.sub(r"[\d.]{7,}", "ADDRESS", err.strip().splitlines()[-1].replace(str(path), "RIG"))
    fault_table.tell("Cameras and pulses", "no camera answers at the start", lost="all", said=said, code=code)


def test_a_file_in_place_of_the_folder_is_named(tmp_path: Path, loopback: Loopback, fault_table: FaultTable) -> None:
    (tmp_path / "file").touch()
    code, _, err = _result(_record(write_rig(tmp_path, "sim", loopback), tmp_path / "file" / "logs", 1))
    assert (code, len(err.strip().splitlines())) == (2, 1)
    assert "is no folder; choose another --out" in err
    fault_table.tell("The disk", "a file stands where the folder should be", lost="all", said=err, code=code)


def test_a_recording_that_does_not_fit_is_refused(tmp_path: Path, loopback: Loopback, fault_table: FaultTable) -> None:
    path = write_rig(tmp_path, "sim", loopback)
    path.write_text(path.read_text().replace("[network]", "[recorder]\nreserve_gb = 1e9\n[network]"))
    code, _, err = _result(_record(path, tmp_path / "logs", 1))
    assert code == 4
    assert "there is room for 0 s and 1 s are wanted, beside the reserve" in err
    said = re.sub(r"1e\+09", "N", err)
    fault_table.tell("The disk", "the recording does not fit on the disk", lost="all", said=said, code=code)


def test_a_full_disk_ends_the_recording_and_what_is_written_is_whole(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    """A disk of 40 MB, mounted in a mount namespace of the test's own."""
    path = write_rig(tmp_path, "sim", loopback)
    path.write_text(path.read_text().replace("[network]", "[recorder]\nreserve_gb = 0\n[network]"))
    small = tmp_path / "small"
    small.mkdir()
    kept = tmp_path / "kept.mcap"
    script = (
        f"mount -t tmpfs -o size=40m none {small} && "
        f"{sys.executable} -c 'import sys, service.headless as r; r.check_room_for = lambda *_: None; "
        f"from svev.cli import main; sys.exit(main())' record --rig {path} --seconds 10 --out {small} --json; "
        f"code=$?; cp {small}/*.mcap {kept}; exit $code"
    )
    command = ["unshare", "--mount", "sh", "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    if "unshare" in done.stderr or "mount:" in done.stderr:
        pytest.skip("no mount namespace of our own is allowed here: a small disk cannot be made")
    assert done.returncode == 4, done.stderr
    assert "the disk is full" in done.stderr.splitlines()[-1]
    report = verify(kept)
    assert report.ledger.pulses > 20
    assert report.ledger.complete == report.ledger.pulses
    said = done.stderr.splitlines()[-1]
    fault_table.tell(
        "The disk", "the disk is full (a real one)", lost="those from then on", said=said, code=done.returncode
    )
