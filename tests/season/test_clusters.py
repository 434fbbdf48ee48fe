"""Two clusters of two workers each, in network namespaces of their own, as on computers that share a disk."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

import pytest

from tests.analysis.measured import measured_jump
from tests.season.files import campaign_file
from tests.season.test_run import contents, no_logs, told
from tests.support.waiting import wait_until

_QUIET: Final[dict[str, Any]] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
_WORKERS: Final = 2


def _allowed(*command: str) -> bool:
    return subprocess.run(command, check=False, timeout=20, **_QUIET).returncode == 0


@contextmanager
def _program(*command: str) -> Iterator["subprocess.Popen[bytes]"]:
    with subprocess.Popen(command, **_QUIET) as process:
        try:
            yield process
        finally:
            process.terminate()
            process.wait(30)


@contextmanager
def _cluster(number: int) -> Iterator[str]:
    """A scheduler and its workers in a namespace that a cable of its own leads to; gives the scheduler's address."""
    net, cable = f"10.{100 + os.getpid() % 100}.{number}", f"sv{os.getpid() % 100_000}-{number}"
    with ExitStack() as stack:
        holder = stack.enter_context(_program("unshare", "--net", "sleep", "infinity"))
        outside = Path("/proc/self/ns/net").readlink()
        wait_until(lambda: Path(f"/proc/{holder.pid}/ns/net").readlink() != outside, "it has its namespace", 20)
        inside = ("nsenter", f"--net=/proc/{holder.pid}/ns/net")
        for command in (
            ("ip", "link", "add", cable, "type", "veth", "peer", "name", "eth0", "netns", str(holder.pid)),
            ("ip", "address", "add", f"{net}.1/24", "dev", cable),
            ("ip", "link", "set", cable, "up"),
            (*inside, "ip", "address", "add", f"{net}.2/24", "dev", "eth0"),
            (*inside, "ip", "link", "set", "eth0", "up"),
            (*inside, "ip", "link", "set", "lo", "up"),
        ):
            subprocess.run(command, check=True, timeout=20)
        stack.callback(_allowed, "ip", "link", "delete", cable)
        dask, here = (*inside, sys.executable, "-m", "dask"), ("--host", f"{net}.2", "--no-dashboard")
        address = f"tcp://{net}.2:8786"
        stack.enter_context(_program(*dask, "scheduler", "--port", "8786", *here))
        for _ in range(_WORKERS):
            stack.enter_context(_program(*dask, "worker", address, "--nthreads", "1", "--no-nanny", *here))
        yield address


def _run(campaign: Path, address: str) -> "subprocess.Popen[str]":
    command = [sys.executable, "-m", "svev", "season", "run", str(campaign), "--scheduler", address, "--json"]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _await_workers(address: str) -> None:
    program = f"from distributed import Client; assert len(Client({address!r}, timeout=5).nthreads()) == {_WORKERS}"
    wait_until(lambda: _allowed(sys.executable, "-c", program), "its workers are there", 120)


@pytest.mark.long
@pytest.mark.timeout(900)
def test_two_clusters_measure_as_one_computer_does(tmp_path: Path) -> None:
    if not (os.geteuid() == 0 and _allowed("unshare", "--net", "ip", "link", "set", "lo", "up")):
        pytest.skip("this machine allows no network namespaces, or has no `ip`")
    alone = measured_jump()
    with _cluster(1) as first, _cluster(2) as second:
        running = []
        for name, address in (("one", first), ("two", second)):
            no_logs(tmp_path / name / "hill", range(30))
            shutil.copy(alone.log.path, tmp_path / name / "hill")
            _await_workers(address)
            running.append(_run(campaign_file(tmp_path / name), address))
        for process in running:
            out, err = process.communicate(timeout=400)
            assert process.returncode == 0, err
            found = json.loads(out)
            assert (found["done"], found["failed"], found["jumps"]) == (1, 30, 1)
    assert told(tmp_path / "one" / "hill") == told(tmp_path / "two" / "hill")
    for name in ("one", "two"):
        ours = contents((tmp_path / name / "hill" / alone.log.path.name).with_suffix(".season"))
        theirs = contents(alone.result)
        assert ours.keys() == theirs.keys()
        assert [each for each in ours if ours[each] != theirs[each]] == []
