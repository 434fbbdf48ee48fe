"""Tasks on a real cluster of two processes, some of which kill their worker."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from rig.settings.file import CONFIG
from tests.season.files import campaign_file, log_file
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

#: Prints what is found of jumps here, and on two workers.
_HONESTY = """
import json
from functools import partial
from bench.analysis.honesty import run_honesty
from season.campaign import Cluster
from season.running.engine import engine, mapped
with engine(Cluster(workers=2), "127.0.0.1:0") as on:
    for each in (map, partial(mapped, on)):
        print(json.dumps(run_honesty(0.0, each, surveys=1)))
"""


def run_tiny(folder: Path, names: list[str], timeout_s: float = 60) -> dict[str, Any]:
    """Run tiny tasks; see `tests.season.tiny_tasks`."""
    program = f"from tests.season.tiny_tasks import main; main({str(folder)!r}, {','.join(names)!r}.split(','))"
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def runs(path: Path) -> int:
    """How often a task was begun."""
    return len(path.read_text().splitlines())


@pytest.mark.long
def test_a_task_that_kills_two_workers_is_set_aside_and_no_other_is_accused(tmp_path: Path) -> None:
    names = [*(f"tiny-{number}" for number in range(40)), "deadly-1", *(f"more-{number}" for number in range(40))]
    names += ["deadly-2", "wrong"]
    found = run_tiny(tmp_path, names)
    assert found["threads"] == 2
    assert found["dashboard"].startswith("http://127.0.0.1:")
    assert set(found["ended"]) == set(names)
    assert {name: said for name, said in found["ended"].items() if said != "done"} == {
        "deadly-1": "killed: 0.93 GiB", "deadly-2": "killed: 0.93 GiB", "wrong": "failed: wrong",
    }  # fmt: skip
    assert {runs(tmp_path / name) for name in names if name.startswith("deadly")} == {2}
    deaths = 4  # of workers; what ran there, or had ended and was not fetched yet, is run again
    assert {name: count for name in names if (count := runs(tmp_path / name)) > 1 + deaths} == {}


def test_while_no_task_ends_somebody_hears_that_they_run(tmp_path: Path) -> None:
    """So the state of a season is written while long logs are measured."""
    names = [f"patient-{number}" for number in range(4)]
    found = run_tiny(tmp_path, names)
    assert found["ended"] == dict.fromkeys(names, "done")
    assert found["begun_at_first"] == 2, "of four that are given to the workers"


def test_workers_start_beside_files_of_the_names_of_modules(tmp_path: Path) -> None:
    user, program = tmp_path / "user", tmp_path / "bin" / "program.py"
    for folder in (user, program.parent, tmp_path / "done"):
        folder.mkdir()
    for name in ("multiprocessing", "signal", "random", "rig", "numpy", "season"):
        (user / f"{name}.py").write_text(f'raise SystemExit("{name}.py of the user was imported")\n')
    call = f"main({str(tmp_path / 'done')!r}, ['one', 'two'])"
    program.write_text(f'from tests.season.tiny_tasks import main\nif __name__ == "__main__":\n    {call}\n')
    done = subprocess.run(
        [sys.executable, str(program)], cwd=user, capture_output=True, text=True, timeout=60, check=False
    )
    assert "was imported" not in done.stderr
    assert json.loads(done.stdout.splitlines()[-1])["ended"] == {"one": "done", "two": "done"}


def test_a_scheduler_that_does_not_answer_is_named(tmp_path: Path, loopback: Loopback) -> None:
    log_file(tmp_path / "hill" / "a.mcap")
    address = f"tcp://{loopback.host}:{loopback.free_port()}"
    done = run_svev("season", "run", str(campaign_file(tmp_path)), "--scheduler", address)
    assert done.returncode == 2
    assert f"{address}: no Dask scheduler answers there" in done.stderr


def test_a_simulation_on_many_processors_gives_the_same_figures() -> None:
    plan = ("plan", str(CONFIG / "networks" / "hill-1.toml"), "--samples", "300", "--json")
    here, spread = run_svev(*plan), run_svev(*plan, "--workers", "2")
    assert (here.returncode, spread.returncode) == (0, 0), spread.stderr
    assert "2 processors; dashboard: http://127.0.0.1:" in spread.stderr
    assert spread.stdout == here.stdout


@pytest.mark.long
@pytest.mark.timeout(500)
def test_honesty_on_many_processors_gives_the_same_figures() -> None:
    done = subprocess.run([sys.executable, "-c", _HONESTY], capture_output=True, text=True, timeout=400, check=False)
    assert done.returncode == 0, done.stderr
    here, spread = map(json.loads, done.stdout.splitlines())
    assert [case["draws"] for case in here] == [1, 1]
    assert spread == here


@pytest.mark.long
@pytest.mark.timeout(600)
def test_the_memory_of_the_scheduler_does_not_grow_with_the_season(tmp_path: Path) -> None:
    few = run_tiny(tmp_path, [f"a{number}" for number in range(100)])
    many = run_tiny(tmp_path, [f"b{number}" for number in range(10_000)], timeout_s=500)
    assert set(many["ended"].values()) == {"done"}
    assert len(many["ended"]) == 10_000
    assert many["most_mb"] < 300  # scheduler and client are in one process
    assert many["most_mb"] < few["most_mb"] + 60


@pytest.mark.long
def test_workers_of_another_scheduler_measure_too(tmp_path: Path, loopback: Loopback) -> None:
    logs = [log_file(tmp_path / "hill" / f"{number}.mcap", b"damaged") for number in range(3)]
    port = loopback.free_port()
    address = f"tcp://{loopback.host}:{port}"
    dask = [sys.executable, "-m", "dask"]
    options = ["--host", loopback.host, "--no-dashboard"]
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with (
        subprocess.Popen([*dask, "scheduler", "--port", str(port), *options], **quiet) as scheduler,
        subprocess.Popen([*dask, "worker", address, "--nthreads", "1", "--no-nanny", *options], **quiet) as worker,
    ):
        command = [sys.executable, "-m", "svev", "season", "run", str(campaign_file(tmp_path)), "--json"]

        def run() -> "subprocess.CompletedProcess[str]":
            return subprocess.run(
                [*command, "--scheduler", address], capture_output=True, text=True, timeout=100, check=False
            )

        wait_until(
            lambda: (done := run()).returncode == 0 or "has no workers" not in done.stderr, "it has a worker", 100
        )
        found = json.loads(run().stdout)
        for process in (worker, scheduler):
            process.terminate()
            process.wait(20)
    assert found["failed"] == len(logs)
