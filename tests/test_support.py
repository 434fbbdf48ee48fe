"""The watch over the tests is watched itself: tests that leak on purpose are caught, and the culprit is named."""

import re
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from tempfile import NamedTemporaryFile, TemporaryDirectory

import pytest

from tests.support import loopback as loopback_blocks
from tests.support.leaks import Snapshot, used_elsewhere
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parent.parent

LEAKING = """
import os, socket, subprocess, sys, threading
from pathlib import Path
import pytest, zmq

kept, shared = [], []
SLEEP = [sys.executable, "-c", "import time; time.sleep(60)"]

def test_child():
    kept.append(subprocess.Popen(SLEEP))

def test_zombie():
    child = subprocess.Popen([sys.executable, "-c", ""], stdout=subprocess.PIPE)
    child.stdout.read()
    child.stdout.close()
    kept.append(child)

def test_orphan():
    # The middle process is gone at once, so its child has another parent than us.
    middle = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'])"
    subprocess.run([sys.executable, "-c", middle], check=True)

def test_thread():
    event = threading.Event()
    kept.append(event)
    threading.Thread(target=event.wait, name="forgotten", daemon=True).start()

def test_context():
    context = zmq.Context()
    context.socket(zmq.PUB).close()
    kept.append(context)

def test_listening():
    server = socket.socket()
    server.bind(("127.0.0.1", 0))
    server.listen()
    kept.append(server)

def test_memory():
    # It stays open until it is removed, so that tests beside this one see whose it is.
    memory = Path(f"/dev/shm/svev-leak-{os.getpid()}").open("wb")
    kept.append(memory)
    shared.append(memory.name)

def test_memfd():
    kept.append(os.memfd_create("ring"))

def test_file(tmp_path):
    kept.append((tmp_path / "log").open("wb"))

def test_events():
    kept.extend(os.eventfd(0) for _ in range(3))

def test_failure_is_not_drowned_in_complaints():
    server = socket.socket()
    kept.append(server)
    raise ValueError("the test's own failure")

def test_clean():
    with zmq.Context() as context, context.socket(zmq.PUB) as publisher:
        publisher.bind("tcp://127.0.0.1:0")
    subprocess.run([sys.executable, "-c", ""], check=True)

def teardown_module():
    for name in shared:
        os.unlink(name)
"""

CULPRITS = {
    "test_child": r"process \d+ still runs: .*time\.sleep\(60\)",
    "test_zombie": r"process \d+ ended but nobody waited for it",
    "test_orphan": r"process \d+ still runs: .*time\.sleep\(60\)",
    "test_thread": r"thread still runs: forgotten",
    "test_context": r"library thread still runs: ZMQbg",
    "test_listening": r"socket still open: tcp 127\.0\.0\.1:\d+ listening",
    "test_memory": r"shared memory still there: /dev/shm/svev-leak-\d+",
    "test_memfd": r"file still open: /memfd:ring",
    "test_file": r"file still open: .*/log",
    "test_events": r"file still open: anon_inode:\[eventfd\]",
}


def _pytest(folder: Path, source: str, *options: str) -> str:
    (folder / "test_inner.py").write_text(source)
    command = [
        sys.executable, "-m", "pytest", "-p", "tests.support.plugin", "-p", "no:cacheprovider", "-p", "no:xdist",
        "--leak-grace", "0.2", "--rootdir", str(folder), "-c", "/dev/null", "-rs", *options, str(folder),
    ]  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=60, check=False)
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    return _pytest(tmp_path_factory.mktemp("leaking"), LEAKING)


@pytest.mark.parametrize(("test", "culprit"), CULPRITS.items())
def test_what_a_test_leaves_behind_is_named(report: str, test: str, culprit: str) -> None:
    part = re.search(rf"ERROR at teardown of {test} _+\n(.*?)(?=\n_{{3,}}|\n={{3,}})", report, re.DOTALL)
    assert part, report
    assert f"{test} left behind" in part[1]
    assert re.search(culprit, part[1])


def test_clean_tests_and_failed_tests_get_no_complaint(report: str) -> None:
    assert "test_clean left behind" not in report
    assert "the test's own failure" in report
    assert "teardown of test_failure" not in report
    assert "the test session left behind" not in report
    assert f"1 failed, {len(CULPRITS) + 1} passed, {len(CULPRITS)} errors" in report


def test_a_session_fixture_that_leaks_is_caught(tmp_path: Path) -> None:
    source = """
import subprocess, sys
import pytest

@pytest.fixture(scope="session")
def camera():
    return subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])

def test_it(camera):
    assert camera.poll() is None
"""
    assert re.search(r"the test session left behind.*\n.*process \d+ still runs", _pytest(tmp_path, source))


def test_a_launcher_in_place_of_one_that_is_gone_is_no_leak(tmp_path: Path) -> None:
    source = """
import os, signal
from rig.transport.launcher import launcher

def test_another():
    gone = launcher()
    os.kill(gone.pid, signal.SIGKILL)
    while gone.runs:
        pass
    assert launcher().pid != gone.pid

def test_the_next_one():
    assert launcher().runs
"""
    report = _pytest(tmp_path, source)
    assert "2 passed" in report, report
    assert "left behind" not in report


def test_hardware_tests_run_only_when_asked_for(tmp_path: Path) -> None:
    source = "import pytest\n\n@pytest.mark.hardware\ndef test_camera(): pass\n"
    assert "needs real cameras; run with --hardware" in _pytest(tmp_path, source)
    assert "1 passed" in _pytest(tmp_path, source, "--hardware")


def test_one_that_is_to_run_when_the_others_are_done_is_long(tmp_path: Path) -> None:
    source = "import pytest\n\n@pytest.mark.alone\ndef test_waiting(): pass\n"
    assert "test_waiting is marked alone but not long: mark it long as well" in _pytest(tmp_path, source)


def test_those_that_may_take_longest_begin_first(tmp_path: Path) -> None:
    source = """
import pytest

def test_usual(): pass

@pytest.mark.timeout(20)
def test_short(): pass

@pytest.mark.timeout(400)
def test_long(): pass

@pytest.mark.timeout(900)
def test_longest(): pass
"""
    collected = _pytest(tmp_path, source, "--collect-only", "-q", "-o", "timeout=180")
    assert re.findall(r"::(test_\w+)", collected) == ["test_longest", "test_long", "test_usual", "test_short"]


def test_a_semaphore_of_another_program_is_no_leak() -> None:
    program = """
import multiprocessing, sys
semaphore = multiprocessing.get_context("spawn").Semaphore()
print(semaphore._semlock.name.removeprefix("/"), flush=True)
sys.stdin.read()
"""
    command = [sys.executable, "-c", program]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdin is not None
        assert other.stdout is not None
        path = Path("/dev/shm") / f"sem.{other.stdout.readline().strip()}"  # noqa: S108 - looked at, not written
        assert path.exists()
        assert used_elsewhere(path)
        other.stdin.close()


def test_a_folder_of_another_program_is_no_shared_memory() -> None:
    with TemporaryDirectory(dir="/dev/shm") as folder, NamedTemporaryFile(dir="/dev/shm") as file:
        found = Snapshot.take("none").shared_memory
    assert Path(file.name) in found
    assert Path(folder) not in found


def test_two_runs_at_once_get_different_addresses(loopback: Loopback) -> None:
    worker = int(loopback.block.split(".")[1]) - 10
    with loopback_blocks.claim(worker) as other:
        assert other.block != loopback.block
        assert not set(other.cameras(3)) & set(loopback.cameras(3))


def test_what_does_not_come_true_is_named() -> None:
    with pytest.raises(AssertionError, match=r"after 0.05 s still not so: the camera is back"):
        wait_until(lambda: False, "the camera is back", timeout_s=0.05)


def test_a_short_path_is_short(short_path: Path) -> None:
    assert len(str(short_path / "publish.sock")) < 60


def test_what_is_long_in_coming_is_looked_at_more_rarely() -> None:
    looks: list[float] = []

    def come() -> bool:
        looks.append(time.monotonic())
        return looks[-1] - looks[0] > 1.0

    wait_until(come, "it has come", poll_s=0.001)
    assert len(looks) < 400
    apart = [after - before for before, after in pairwise(looks)]
    assert all(gap >= 0.04 for gap in apart[-3:])
    wait_until(lambda: True, "it is there at once", timeout_s=0)
