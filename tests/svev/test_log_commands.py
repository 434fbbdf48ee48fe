"""`svev info`, `verify` and `replay`: exit codes, one line per error, one JSON object at the end."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import pytest
import zmq

from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.items import Chunk
from recorder.reading.log_reader import LogReader
from rig.clocks import DecimalNs, UtcNs
from rig.frame import FrameStatus
from rig.health import DiskHealth, Health, Latency, PairingHealth, PrerollHealth, ToldPulses
from rig.host.utc_clock import UtcState
from rig.tag import CameraTag
from rig.transport import wire
from svev.cli import main
from tests.recorder.logs import (
    ALL_OK,
    DESCRIPTION,
    LOST,
    OK,
    PERIOD_NS,
    READY_NS,
    SHAPE,
    START,
    make_tag,
    open_writer,
    write_log,
    write_pulse,
)
from tests.support.loopback import Loopback
from tests.support.repeats import repeats


@dataclass(frozen=True, slots=True)
class Done:
    """How a command ended and what it printed."""

    returncode: int
    stdout: str
    stderr: str


Svev = Callable[..., Done]


@pytest.fixture
def svev(capsys: pytest.CaptureFixture[str]) -> Svev:
    """Runs a command in this process."""

    def run(*arguments: object) -> Done:
        code = main([str(argument) for argument in arguments])
        return Done(code, *capsys.readouterr())

    return run


@pytest.fixture
def log(tmp_path: Path) -> Path:
    write_log(tmp_path / "log.mcap", (ALL_OK, (OK, LOST, OK), ALL_OK))
    return tmp_path / "log.mcap"


def test_info_tells_people(log: Path, svev: Svev) -> None:
    done = svev("info", log)
    assert (done.returncode, done.stderr) == (0, "")
    assert "3 pulses, 2 complete, 1 partial (frames: 1 lost)" in done.stdout
    assert "athlete Anna Berg, bib 17" in done.stdout
    assert "90 x 24 px of K1, K2, K3" in done.stdout


def test_verify_tells_people_what_is_missing_and_a_partial_log_is_no_error(log: Path, svev: Svev) -> None:
    done = svev("verify", log)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith(f"{log}: partial\n")
    assert "pulse 2: K2 lost" in done.stdout
    assert "info: recorder: recording started" in done.stdout


def test_info_prints_the_ledger_of_each_camera(log: Path, svev: Svev) -> None:
    assert "ledger     K2 2 ok, 1 lost, 0 missed, 0 damaged, 0 absent" in svev("info", log).stdout
    found = json.loads(svev("info", log, "--json").stdout)
    assert found["ledger"]["K1"] == {"ok": 3, "lost": 0, "missed": 0, "damaged": 0, "absent": 0}


@pytest.mark.parametrize(
    ("fired", "counts", "verdict", "more"),
    [
        ((1, 2, 3, 4), (4, 1, 0, 0), "agrees", ""),
        ((1, 2, 2.5, 3, 4), (5, 1, 1, 0), "does not agree", "; `svev verify --ledger` names each"),
    ],
)
def test_info_puts_the_sources_own_count_beside_the_tags(
    tmp_path: Path, svev: Svev, fired: Sequence[float], counts: tuple[int, int, int, int], verdict: str, more: str
) -> None:
    path, now = tmp_path / "log.mcap", UtcNs(START + 5 * PERIOD_NS)
    told = ToldPulses(
        first=1, times_ns=tuple(DecimalNs(round(pulse * PERIOD_NS)) for pulse in fired), uncertainty_us=20.0,
        until_ns=DecimalNs(round(4.4 * PERIOD_NS)),
    )  # fmt: skip
    pairing = PairingHealth(4, 0, 0, 0, PERIOD_NS / 1e3, 1.0, 2.0, alarm=False, cameras=())
    health = Health(
        cameras=(), pairing=pairing, free_triplets=4, unpublished=0, preroll=PrerollHealth(0, 0, 0, 0),
        recording=None, disk=DiskHealth(None), latency=Latency({}, 0, 0), host_time_ns=DecimalNs(5 * PERIOD_NS),
        fired=(told,),
    )  # fmt: skip
    write_log(path, (ALL_OK, (FrameStatus.MISSED,) * 3, ALL_OK, ALL_OK), health=(wire.encode(health), now))
    pulses, unseen, untagged, unfired = counts
    said = f"{pulses} pulses fired, {unseen} of them seen by no camera, {untagged} without a tag"
    line = f"source     own count {verdict}: {said}; {unfired} tagged that it did not fire{more}"
    assert line in svev("info", path).stdout.splitlines()
    found = json.loads(svev("info", path, "--json").stdout)["source"]
    assert tuple(found[name] for name in ("fired", "unseen", "untagged", "unfired")) == counts
    assert len(found["findings"]) == counts[2]


def test_info_says_how_well_utc_is_known(tmp_path: Path, svev: Svev) -> None:
    fields = UtcState(True, "chrony", 0.0, 20.0, 812.0).to_fields()
    write_log(tmp_path / "log.mcap", description=replace(DESCRIPTION, rig={"name": "hill", **fields}))
    lines = svev("info", tmp_path / "log.mcap").stdout.splitlines()
    assert "utc        synchronized by chrony, off by 20 us (estimated), 812 us at most; 0 us being corrected" in lines
    assert "rig        name hill" in lines


def test_a_recomputed_ledger_that_agrees_is_one_line(log: Path, svev: Svev) -> None:
    done = svev("verify", "--ledger", log)
    assert (done.returncode, done.stderr) == (0, "")
    line = (
        "the recomputed ledger agrees with the tags: 3 pulses, 3 cameras: 8 ok, 1 lost, 0 missed, 0 damaged, 0 absent"
    )
    assert done.stdout.splitlines()[-1] == line


def test_a_tag_that_the_frame_numbers_contradict_is_named(tmp_path: Path, svev: Svev) -> None:
    """The frame numbers of the log go on with the pulses: K2 took the frame that is said to be missed."""
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK, (OK, FrameStatus.MISSED, OK), ALL_OK))
    assert svev("verify", path).returncode == 0
    done = svev("verify", "--ledger", path)
    assert done.returncode == 7
    assert "\n  pulse 2: K2 is tagged missed and was lost: its frame numbers say" in done.stdout
    assert "its ledger does not agree with its tags: pulse 2: K2" in done.stderr
    (difference,) = json.loads(svev("verify", path, "--ledger", "--json").stdout)["ledger"]["differences"]
    assert (difference["pulse"], difference["camera"], difference["found"]) == (2, "K2", "lost")


def write_tags(path: Path, change: Callable[[int, CameraTag], CameraTag], pulses: int = 120) -> None:
    """A log of complete pulses in which K2's part of each tag, (pulse, part), is changed; frames come after 5 ms."""
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(path, buffers) as log:
        for pulse in range(1, pulses + 1):
            tag = make_tag(pulse)
            late = UtcNs(tag.time + READY_NS)
            first, second, third = (msgspec.structs.replace(part, host_time=late) for part in tag.cameras)
            cameras = (first, change(pulse, second), third)
            write_pulse(log, buffers, msgspec.structs.replace(tag, cameras=cameras))
    buffers.close()


def frames_of_the_next_pulse(pulse: int, part: CameraTag) -> CameraTag:
    """From pulse 40 on, K2's times are one period early; at pulse 90 they come back, and no frame is left for it."""
    if pulse == 90:
        return CameraTag(part.name, part.columns, FrameStatus.MISSED)
    if not 40 <= pulse < 90:
        return part
    assert part.frame_id is not None
    assert part.host_time is not None
    assert part.trigger_count is not None
    return msgspec.structs.replace(
        part, frame_id=part.frame_id + 1, trigger_count=part.trigger_count + 1,
        host_time=UtcNs(part.host_time + PERIOD_NS),
    )  # fmt: skip


def number_of_the_pulse_before(pulse: int, part: CameraTag) -> CameraTag:
    assert part.frame_id is not None
    return msgspec.structs.replace(part, frame_id=part.frame_id - (pulse == 40))


@pytest.mark.parametrize(
    ("change", "said", "stretch"),
    [
        (frames_of_the_next_pulse, "pulses 40 to 89: K2 holds the frames of 1 pulse later: ", (40, 89, 1)),
        (
            number_of_the_pulse_before,
            "pulse 40: K2 is tagged ok: its frame number is 46, that of pulse 39 is 46, and its clock goes on",
            (40, 40, 0),
        ),
    ],
)
def test_frames_that_their_numbers_file_elsewhere_are_named_without_asking_for_the_ledger(
    tmp_path: Path, svev: Svev, change: Callable[[int, CameraTag], CameraTag], said: str, stretch: tuple[int, int, int]
) -> None:
    log = tmp_path / "log.mcap"
    write_tags(log, lambda _, part: part)
    assert svev("verify", log).returncode == 0
    log.unlink()
    write_tags(log, change)
    done = svev("verify", log)
    assert done.returncode == 7
    assert done.stdout.startswith(f"{log}: contradicted\n")
    assert f"\n  {said}" in done.stdout
    assert f"its ledger does not agree with its tags: {said}" in done.stderr
    again = svev("verify", log, "--json")
    assert again.returncode == 7
    found = json.loads(again.stdout)
    assert found["verdict"] == "contradicted"
    first = found["misfiled"][0]
    assert (first["camera"], first["pulse"], first["last_pulse"], first["by_pulses"]) == ("K2", *stretch)


@pytest.mark.parametrize("command", ["info", "verify"])
def test_json_is_one_object(log: Path, command: str, svev: Svev) -> None:
    found = json.loads(svev(command, log, "--json").stdout)
    assert (found["log"], found["pulses"], found["complete"], found["partial"]) == (str(log), 3, 2, 1)
    assert found["causes"] == {"lost": 1, "missed": 0, "damaged": 0, "absent": 0}


@pytest.mark.parametrize("command", ["info", "verify", "replay"])
@pytest.mark.parametrize(
    ("within_a_record", "code", "words"), [(True, 2, "truncated"), (False, 3, "closed")], ids=["cut", "unclosed"]
)
def test_an_unfinished_log_is_read_as_far_as_it_goes(
    log: Path, loopback: Loopback, command: str, within_a_record: bool, code: int, words: str, svev: Svev
) -> None:
    with LogReader(log) as reader:
        last_chunk = [item for item in reader.items() if isinstance(item, Chunk)][-1]
    end = last_chunk.offset + last_chunk.length
    log.write_bytes(log.read_bytes()[: end + 5 if within_a_record else end])
    more = ["--speed", "max", "--wait", "0", "--bind", loopback.endpoint()] if command == "replay" else []
    done = svev(command, log, "--json", *more)
    assert done.returncode == code
    found = json.loads(done.stdout)
    assert found["closed"] is False
    assert found["truncated"] is within_a_record
    assert found["triplets" if command == "replay" else "pulses"] == 3
    assert "Traceback" not in done.stderr
    assert words in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("command", ["info", "verify", "replay"])
@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        (b"", "is empty"),
        (b"\x89PNG\r\n\x1a\nxxxxxxx", "is not an MCAP log"),
        (
            b"\x89MCAP0\r\n" + b"\x01\x0c\0\0\0\0\0\0\0" + b"\x04\0\0\0ros2\0\0\0\0",
            'not written by svev (profile "ros2")',
        ),
        (b"\x89MCAP0\r\n\x01", "is cut off or damaged before it says what it is"),
    ],
)
def test_what_is_no_log_is_one_line_and_exit_2(
    tmp_path: Path, command: str, content: bytes | None, words: str, svev: Svev
) -> None:
    path = tmp_path / "foreign.mcap"
    if content is not None:
        path.write_bytes(content)
    done = svev(command, path)
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"svev: {path}: ")
    assert words in line


def test_replay_says_what_it_sent(log: Path, loopback: Loopback, svev: Svev) -> None:
    done = svev("replay", log, "--speed", "max", "--wait", "0", "--bind", loopback.endpoint())
    assert done.returncode == 0
    assert "sent 3 triplets" in done.stdout
    assert "nobody had subscribed when it began" in done.stdout


@pytest.mark.parametrize("speed", ["0", "0.05", "11", "fast", "-1", "nan"])
def test_a_speed_that_is_none_is_one_line_and_exit_2(log: Path, speed: str, svev: Svev) -> None:
    done = svev("replay", log, f"--speed={speed}")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert "not a speed; say a number from 0.1 to 10" in line


def test_ctrl_c_ends_a_reliable_replay_with_130(log: Path, loopback: Loopback) -> None:
    address = loopback.endpoint()
    command = [
        sys.executable,
        "-m",
        "svev",
        "replay",
        str(log),
        "--reliable",
        "--bind",
        address,
        "--speed",
        "0.1",
        "--json",
    ]
    with (
        zmq.Context() as context,
        context.socket(zmq.PULL) as worker,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process,
    ):
        worker.linger = 0
        worker.connect(address)
        assert worker.poll(20_000), "nothing came"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=20)
    assert process.returncode == 130, err
    assert json.loads(out)["interrupted"] is True
    assert "Traceback" not in err


@pytest.mark.parametrize("command", ["info", "verify", "replay"])
def test_help_shows_an_example_and_the_exit_codes(command: str, svev: Svev) -> None:
    text = " ".join(svev(command, "--help").stdout.split())
    assert f"Example: svev {command} recordings/jump.mcap" in text
    assert "Exit codes: 0" in text


@pytest.mark.parametrize("closed", repeats(["<&- >&- 2>&-", ">&-", ">&- 2>&-"]))
@pytest.mark.parametrize("command", ["verify LOG", "verify LOG --json", "info LOG --json", "schema"])
def test_without_standard_output_the_exit_code_tells(command: str, closed: str, tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, [ALL_OK] * 3)
    program = f"{sys.executable} -m svev {command.replace('LOG', str(path))} {closed}"
    done = subprocess.run(["/bin/sh", "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    path.write_bytes(path.read_bytes()[:-1])
    done = subprocess.run(["/bin/sh", "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == (0 if command == "schema" else 3)
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("command", ["verify LOG", "verify LOG --json", "info LOG"])
def test_a_full_disk_behind_standard_output_is_named(command: str, tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, [ALL_OK] * 3)
    program = f"{sys.executable} -m svev {command.replace('LOG', str(path))} >/dev/full"
    done = subprocess.run(["/bin/sh", "-c", program], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 4
    assert done.stderr == (
        "svev: standard output: cannot be written (No space left on device); make room there, or write it elsewhere\n"
    )
