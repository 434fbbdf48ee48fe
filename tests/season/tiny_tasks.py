"""A program that runs tiny tasks on a cluster of its own and prints what was told of each.

A process of its own, since Dask's loop thread lives as long as the interpreter.
"""

import json
import os
import signal
from pathlib import Path
from typing import Any

from season.campaign import Cluster
from season.running.engine import engine, run_tasks
from tests.support.processes import peak_memory_bytes
from tests.support.waiting import wait_until

WAITED = "waited"


class Heard:
    """What is told of tasks, by name; that they are waited for makes a file."""

    def __init__(self, waited: Path) -> None:
        self.waited = waited
        self.ended: dict[str, str] = {}
        self.begun_at_first = 0

    def started(self, _: str) -> None:
        self.begun_at_first += not self.ended

    def interrupted(self, name: str) -> None:
        """Nothing is kept."""

    def waiting(self) -> None:
        """What waits for this goes on."""
        self.waited.touch()

    def done(self, name: str, _: Any) -> None:
        self.ended[name] = "done"

    def failed(self, name: str, error: BaseException) -> None:
        self.ended[name] = f"failed: {error}"

    def killed(self, name: str, limit: str) -> None:
        self.ended[name] = f"killed: {limit}"


def note(path: Path) -> str:
    """A task: notes that it runs; does what its name says, and fails if each release gives memory back."""
    with path.open("a") as file:
        file.write(f"{os.getpid()}\n")
    if "deadly" in path.name:
        os.kill(os.getpid(), signal.SIGKILL)
    if "patient" in path.name:
        waited = path.with_name(WAITED)
        waited.unlink(missing_ok=True)
        wait_until(waited.exists, "the tasks are waited for")
    if "wrong" in path.name:
        raise ValueError("wrong")
    if "MALLOC_TRIM_THRESHOLD_" in os.environ:
        raise ValueError("page faults make jumps take a third longer")
    return path.name


def main(folder: str, names: list[str]) -> None:
    """Run tasks of these names, which note in a folder that they run."""
    heard = Heard(Path(folder) / WAITED)
    with engine(Cluster(workers=2, memory_gb=1.0), "127.0.0.1:0") as on:
        about = {"threads": on.threads, "dashboard": on.dashboard}
        run_tasks(on, note, ((name, Path(folder) / name) for name in names), heard)
    most_mb = peak_memory_bytes() / 1e6
    print(json.dumps({**about, "ended": heard.ended, "begun_at_first": heard.begun_at_first, "most_mb": most_mb}))  # noqa: T201 - read by the test
