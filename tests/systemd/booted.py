"""The machine's own systemd, booted in namespaces of its own with the service as its only unit. Needs root."""

import os
import shutil
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.support.waiting import wait_until

CHECKOUT = Path(__file__).parents[2]
_GROUPS = Path("/sys/fs/cgroup/systemd")
_NAMESPACES = ("--mount", "--pid", "--net", "--cgroup", "--fork", "--kill-child")
_SYSTEMD = Path("/lib/systemd/systemd")


class Booted:
    """A running systemd.

    Attributes:
        out: the service's output goes into the file `log` of this directory.
    """

    def __init__(self, pid: int, out: Path) -> None:
        self._pid, self.out = pid, out

    def systemctl(self, *arguments: str) -> str:
        """What `systemctl` says; a failure fails the test."""
        done = subprocess.run(
            [*self._inside(), "systemctl", *arguments], capture_output=True, text=True, timeout=60, check=False
        )
        assert done.returncode == 0, f"{done.stderr}\n{self.log()}"
        return done.stdout

    def show(self, name: str) -> str:
        """One property of the service."""
        return self.systemctl("show", "--property", name, "--value", "svev.service").strip()

    def run(self, *command: str) -> str:
        """Output of a program that runs beside the service."""
        done = subprocess.run([*self._inside(), *command], capture_output=True, text=True, timeout=60, check=False)
        assert done.returncode == 0, done.stderr + self.log()
        return done.stdout

    def log(self) -> str:
        """What the service has said."""
        log = self.out / "log"
        return log.read_text() if log.exists() else ""

    def _inside(self) -> tuple[str, ...]:
        return "nsenter", f"--target={self._pid}", "--mount", "--pid", "--net"


def why_not() -> str:
    """Why systemd cannot be booted here; empty if it can."""
    if os.geteuid() != 0:
        return "booting systemd in namespaces needs root"
    if not _SYSTEMD.exists() or not shutil.which("nsenter"):
        return "systemd or util-linux is not installed"
    if not _GROUPS.is_dir():
        return "no control group hierarchy named systemd"
    trial = ["unshare", *_NAMESPACES, "true"]
    return "" if subprocess.run(trial, check=False, timeout=20).returncode == 0 else "namespaces are not permitted"


@contextmanager
def booted(prefix: Path) -> Iterator[Booted]:
    """Boot systemd with the unit of `prefix`, which must be called /opt/prefix inside."""
    if reason := why_not():
        pytest.skip(reason)
    out = prefix / "out"
    out.mkdir()
    out.chmod(0o777)
    group = _GROUPS / f"svev-test-{os.getpid()}"
    group.mkdir()
    # Into its control group first: the namespace begins where the process stands that makes it.
    line = f'echo $$ >"{group}/cgroup.procs" && exec unshare {" ".join(_NAMESPACES)} "$0" "$@"'
    boot = str(Path(__file__).with_name("boot"))
    with (out / "console").open("wb") as console:
        command = ["bash", "-c", line, boot, str(CHECKOUT), str(prefix)]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=console, stderr=console)
    try:
        yield Booted(_init(process.pid), out)
    finally:
        process.send_signal(signal.SIGKILL)  # unshare takes its child along, and with process 1 all others go
        process.wait(30)
        _remove(group)


def _init(unshare: int) -> int:
    """Process id, seen from here, of the systemd that `unshare` has forked, once `systemctl` can reach it."""
    children = Path(f"/proc/{unshare}/task/{unshare}/children")
    found: list[int] = []

    def started() -> bool:
        found[:] = [int(pid) for pid in children.read_text().split()] if children.exists() else []
        return bool(found) and Path(f"/proc/{found[0]}/root/run/systemd/private").exists()

    wait_until(started, "systemd answers")
    return found[0]


def _remove(group: Path) -> None:
    wait_until(
        lambda: not any(path.read_text() for path in group.rglob("cgroup.procs")), "the control group is empty", 20
    )
    for directory in sorted((path for path in group.rglob("*") if path.is_dir()), reverse=True):
        directory.rmdir()
    group.rmdir()
