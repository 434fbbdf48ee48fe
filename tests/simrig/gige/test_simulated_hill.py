"""The cameras as processes: start, faults of the whole process, and no orphan ever."""

import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import IO

import pytest

from rig.errors import BadInputError, ProcessDiedError
from simrig.programs.simulated_hill import SimulatedHill
from simrig.world.faults import Fault, FaultKind
from tests.simrig.gige.conftest import TRAINING
from tests.simrig.gige.raw_client import CCP, GvcpClient
from tests.simrig.gige.receiver import Receiver
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

SCPS = 0x0D04
ROOT = Path(__file__).parents[3]


def hill(loopback: Loopback, count: int = 1, scenario: Path = TRAINING, **options: object) -> SimulatedHill:
    addresses = {f"K{index + 1}": address for index, address in enumerate(loopback.cameras(count))}
    return SimulatedHill(scenario, addresses, 100.0, width=320, height=240, test_pattern=True, **options)  # type: ignore[arg-type]


def gone(pid: int) -> bool:
    """Whether a process is no more (or only waits for somebody to take notice)."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] in "ZX"
    except OSError:
        return True


def test_all_cameras_see_the_same_pulses(loopback: Loopback) -> None:
    with hill(loopback, 3) as simulated:
        assert list(simulated.pids) == ["K1", "K2", "K3"]
        first, second, third = (Receiver(address) for address in loopback.cameras(3))
        seen: dict[Receiver, set[int]] = {first: set(), second: set(), third: set()}

        def the_same() -> bool:
            for receiver, pulses in seen.items():  # on a busy machine the last one may begin when the first has ended
                pulses.update(frame.pulse for frame in receiver.frames(20))
            return len(set.intersection(*seen.values())) >= 10

        with first, second, third:
            wait_until(the_same, "ten pulses that all of them have seen", 60)
            statistics = simulated.statistics()
    for name, camera in statistics.items():
        assert camera.acquiring, name
        assert camera.controlled, name
        assert camera.frames >= 19, name  # a frame is received before it is counted
        assert camera.bytes > 19 * 320 * 240, name
        assert 0 < camera.cpu_s < 30, name
        assert all(sent > simulated.train.time(pulse) for pulse, sent in camera.last_packets.items())
    assert simulated.pids == {}


def test_a_camera_is_killed_and_comes_back_with_default_settings(loopback: Loopback) -> None:
    (address,) = loopback.cameras(1)
    with hill(loopback) as simulated, GvcpClient(address) as client:
        receiver = Receiver(address)
        receiver.start()
        assert len(receiver.frames(3)) == 3
        pid = simulated.pids["K1"]
        assert client.read(SCPS) & 0xFFFF == 9000
        simulated.kill("K1")
        assert gone(pid)
        assert simulated.pids == {}
        assert simulated.statistics() == {}
        receiver.frames(30, timeout_s=0.05)
        assert receiver.frames(1, timeout_s=0.1) == []
        with pytest.raises(BadInputError, match="dead: restart it"):
            simulated.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K1"))
        simulated.restart("K1")
        assert simulated.pids["K1"] != pid
        assert (client.read(CCP), client.read(SCPS) & 0xFFFF) == (0, 1400)
        receiver.drop()
        with Receiver(address) as again:
            assert [frame.block_id for frame in again.frames(3)] == [1, 2, 3]


def test_a_frozen_camera_sees_no_pulses(loopback: Loopback) -> None:
    (address,) = loopback.cameras(1)
    with hill(loopback) as simulated, Receiver(address) as receiver:
        before = receiver.frames(3)
        simulated.freeze("K1")
        before += receiver.frames(30, timeout_s=0.3)
        assert len(before) < 13
        assert simulated.statistics() == {}
        with pytest.raises(BadInputError, match="frozen: thaw it"):
            simulated.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K1"))
        simulated.thaw("K1")
        frames = [frame for frame in before + receiver.frames(20) if frame.status == "success"]
        missed = simulated.statistics()["K1"].missed
    assert 20 < missed < 60
    pulses = [frame.pulse for frame in frames]
    assert max(later - earlier for earlier, later in pairwise(pulses)) > 20
    ids = [frame.block_id for frame in frames]
    assert ids == list(range(ids[0], ids[0] + len(ids)))


def test_a_restart_that_the_scenario_plans(loopback: Loopback, scenario_with: Callable[[str], Path]) -> None:
    scenario = scenario_with('[[faults]]\nkind = "restart"\ncamera = "K1"\nat_pulse = 300\nduration_s = 0.2\n')
    (address,) = loopback.cameras(1)
    with hill(loopback, scenario=scenario) as simulated, GvcpClient(address) as client:
        pid = simulated.pids["K1"]
        receiver = Receiver(address)
        receiver.start()
        wait_until(lambda: simulated.pids.get("K1") not in (pid, None), "another process is there")
        assert client.read(CCP) == 0
        pulses = [frame.pulse for frame in receiver.frames(30, timeout_s=0.1) if frame.status == "success"]
        assert max(pulses) < 310
        receiver.drop()


def test_a_freeze_at_run_time(loopback: Loopback) -> None:
    (address,) = loopback.cameras(1)
    with hill(loopback) as simulated, Receiver(address) as receiver:
        begin = receiver.frames(1)[0].pulse + 20
        simulated.inject(Fault(kind=FaultKind.FROZEN, camera="K1", at_pulse=begin, duration_s=0.3))
        pulses = [frame.pulse for frame in receiver.frames(60) if frame.status == "success"]
    assert set(range(begin + 10, begin + 20)).isdisjoint(pulses)
    assert max(pulses) > begin + 30


def test_faults_at_run_time(loopback: Loopback) -> None:
    (address,) = loopback.cameras(1)
    with hill(loopback) as simulated, Receiver(address) as receiver:
        pulse = receiver.frames(1)[0].pulse + 30
        simulated.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K1", at_pulse=pulse))
        assert pulse not in {frame.pulse for frame in receiver.frames(40)}
        with pytest.raises(BadInputError, match="is past"):
            simulated.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K1", at_pulse=pulse))
        with pytest.raises(BadInputError, match="is past"):
            simulated.inject(Fault(kind=FaultKind.FROZEN, camera="K1", at_pulse=pulse, duration_s=1.0))
        with pytest.raises(BadInputError, match='no camera "K9"'):
            simulated.inject(Fault(kind=FaultKind.LOST_FRAME, camera="K9"))


def test_an_address_in_use_is_said_in_one_line(loopback: Loopback) -> None:
    with hill(loopback, 2):
        message = (
            f"^address {loopback.cameras(1)[0]}:3956 is in use by another program: stop it or choose another address$"
        )
        with pytest.raises(BadInputError, match=message), hill(loopback):
            pass


def test_an_address_of_another_machine(loopback: Loopback) -> None:
    simulated = SimulatedHill(TRAINING, {"K1": "192.0.2.7"}, 30.0, test_pattern=True)
    with pytest.raises(BadInputError, match=r"192\.0\.2\.7.* none of this machine's: choose another"), simulated:
        pass


@pytest.mark.parametrize(
    ("addresses", "options", "message"),
    [
        ({"K9": "127.0.0.11"}, {}, 'no camera "K9"'),
        ({"K1": "camera"}, {}, "address"),
        ({"K1": "127.0.0.11"}, {"width": 641}, "width"),
        ({"K1": "127.0.0.11"}, {"first_block_id": 0}, "first_block_id"),
    ],
)
def test_bad_options(addresses: dict[str, str], options: dict[str, object], message: str) -> None:
    with pytest.raises(BadInputError, match=message):
        SimulatedHill(TRAINING, addresses, 30.0, **options)  # type: ignore[arg-type]


def test_a_camera_that_dies_by_itself_is_noticed(loopback: Loopback) -> None:
    with hill(loopback) as simulated:
        os.kill(simulated.pids["K1"], signal.SIGKILL)
        wait_until(lambda: not simulated.pids, "the process is dead")
        with pytest.raises(ProcessDiedError, match="camera K1 ended by itself"):
            simulated.statistics()


PARENT = """
import json, sys
from pathlib import Path
from simrig.programs.simulated_hill import SimulatedHill

scenario, *addresses = sys.argv[1:]
with SimulatedHill(Path(scenario), dict(zip(("K1", "K2"), addresses)), 30.0, test_pattern=True) as hill:
    hill.freeze("K2")
    print(json.dumps(list(hill.pids.values())), flush=True)
    sys.stdin.read()
"""


def test_no_orphan_when_the_parent_is_killed(loopback: Loopback) -> None:
    arguments = [sys.executable, "-c", PARENT, str(TRAINING), *loopback.cameras(2)]
    with subprocess.Popen(arguments, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT) as parent:
        assert parent.stdout is not None
        pids = json.loads(parent.stdout.readline())
        assert len(pids) == 2
        assert not any(gone(pid) for pid in pids)
        parent.kill()
        parent.wait(5)
    wait_until(lambda: all(gone(pid) for pid in pids), "the cameras are gone, the frozen one too")


@contextmanager
def camera_program(*lines: str) -> Iterator[tuple[subprocess.Popen[str], IO[str]]]:
    """The program of a camera, told these lines on its control channel, and the answers that come from there."""
    ours, theirs = socket.socketpair()
    with ours, ours.makefile("r") as answers:
        with theirs:
            process = subprocess.Popen(
                [sys.executable, "-m", "simrig.programs.gige_camera", "K1", str(theirs.fileno())], cwd=ROOT,
                pass_fds=(theirs.fileno(),), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
            )  # fmt: skip
        ours.settimeout(20)
        ours.sendall("".join(f"{line}\n" for line in lines).encode())
        with process:
            try:
                yield process, answers
            finally:
                process.kill()


def test_the_process_answers_nonsense_with_an_error_and_goes_on(loopback: Loopback) -> None:
    config = {
        "name": "K1", "address": loopback.cameras(1)[0], "scenario": str(TRAINING), "rate_hz": 30, "epoch": 0,
        "ptp_offset_ns": 0, "test_pattern": True,
    }  # fmt: skip
    nonsense = ("nonsense", "[]", '{"type": "Dance"}', '{"type": "Inject", "fault": {}}')
    with camera_program(json.dumps({"type": "GigeCamera", "config": config})) as (process, answers):
        told = [json.loads(answers.readline())["type"]]
        with socket.socket(fileno=os.dup(answers.fileno())) as ours:
            for line in nonsense:
                ours.sendall(f"{line}\n".encode())
                told.append(json.loads(answers.readline())["type"])
            ours.sendall(b'{"type": "Quit"}\n')
        assert told == ["Done", "Refused", "Refused", "Refused", "Refused"]
        assert answers.read() == ""
        assert process.communicate(timeout=20)[0] == ""
        assert process.returncode == 0


def test_a_configuration_that_is_wrong_ends_the_process_with_2() -> None:
    with camera_program('{"type": "GigeCamera", "config": {"adress": 1}}') as (process, _):
        said = process.communicate(timeout=20)[0]
    assert process.returncode == 2
    assert "K1: the configuration is wrong" in said
    assert "name" in said
    assert "Traceback" not in said


def test_a_scenario_that_cannot_be_read_ends_the_process_with_2(loopback: Loopback) -> None:
    config = {
        "name": "K1", "address": loopback.cameras(1)[0], "scenario": "missing.toml", "rate_hz": 30, "epoch": 0,
        "ptp_offset_ns": 0,
    }  # fmt: skip
    with camera_program(json.dumps({"type": "GigeCamera", "config": config})) as (process, answers):
        refused = json.loads(answers.readline())
        assert process.communicate(timeout=20)[0] == ""
    assert process.returncode == 2
    assert refused["type"] == "Refused"
    assert "missing.toml: no such file" in refused["reason"]
