"""Each command in a shell block of the pages is run as it stands there, or it is said here why not.

A page's commands run one after another in a folder that holds what a reader has by then: a recording, its survey, a rig
file, results. `svev` is the program of this checkout.
"""

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from bench.analysis.hill_logs import write_hill_log
from rig.settings.file import CONFIG
from simrig.world.scenario import load_scenario
from tests.reader_files import PREPARED
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig
from tests.support.waiting import wait_until
from tests.test_docs import FENCE, PAGES, ROOT

#: What is not run, by the beginning of the command, and why.
NOT_RUN: Final = {
    r"make |bash \.ci/run": "targets of the Makefile: `make check` and CI are these",
    r"sudo |printf .*\| sudo|su -|apt |adduser |exit$|systemctl ": "changes the computer, as root",
    r"git clone |cd svev|source \.venv|tar xf ": "the checkout and the bundle: .ci/try-wheel, tests/systemd",
    r"rsync ": "needs another computer",
    r"svev setup": "asks a person: tests/svev/setup answers it at a terminal",
    r"svev cameras ": "needs a camera on a network port: tests/svev/test_cameras.py",
    r"svev doctor --bus firewire": "needs a FireWire card",
    r"svev demo --bus firewire": "tests/svev/test_demo.py runs it",
    r"svev worker ": "goes on until it is stopped: tests/analysis/test_analyze.py",
    r"svev analyze old\.mcap": "needs a survey of cameras of those names: tests/recorder/importing",
    r"dask |svev season run .* --scheduler": "needs a cluster that goes on: tests/season",
    r"svev season compare ": "needs thirty good jumps: tests/season/test_mixed_effects.py",
}
#: Commands that go on until somebody stops them, and what they say when they are ready.
GOES_ON: Final = {
    r"svev serve ": "svev: panel at ",
    r"svev digitize ": "svev: measure at ",
    r"svev ctl log": "recording",
}
#: Commands that record at 30 Hz: on a busy computer frames are missing, and exit code 3 says so.
_KEEPS_TIME: Final = re.compile(r"svev (doctor|rehearse|record|verify trial/|analyze trial/)")
_PULSES: Final = range(22, 72)  # of the simulated hill: one whole jump


def _commands(page: Path) -> list[str]:
    blocks = [body for language, body in FENCE.findall(page.read_text()) if language == "sh"]
    return [line for body in blocks for line in body.replace("\\\n", " ").splitlines() if line.strip()]


def _why_not(command: str) -> str | None:
    return next((why for pattern, why in NOT_RUN.items() if re.match(pattern, command)), None)


def _goes_on(command: str) -> str | None:
    return next((ready for pattern, ready in GOES_ON.items() if re.match(pattern, command)), None)


def _asks_the_service(command: str) -> bool:
    return command.startswith(("svev ctl ", "curl "))


def _pages(*, asking: bool) -> list[Path]:
    """Pages with commands that are run: those that ask a running service, or the others."""
    return [
        page
        for page in PAGES
        if any(_why_not(each) is None and _asks_the_service(each) is asking for each in _commands(page))
    ]


def test_every_reason_is_needed_and_most_commands_run() -> None:
    commands = [command for page in PAGES for command in _commands(page)]
    for pattern in (*NOT_RUN, *GOES_ON):
        assert any(re.match(pattern, command) for command in commands), f"no page has a command like {pattern}"
    of_svev = [command for command in commands if command.startswith("svev ")]
    assert len([command for command in of_svev if _why_not(command) is None]) > 60


def test_blocks_with_commands_are_shell_blocks() -> None:
    for page in PAGES:
        for language, body in FENCE.findall(page.read_text()):
            if language != "sh":
                assert not re.search(r"^svev [a-z]", body, re.MULTILINE), f"{page.name}: write ```sh before it"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with `recordings/jump.mcap`, its survey, poses, pictures, and `results/jump`."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "recordings").mkdir()
    log = write_hill_log(folder / "recordings" / "jump", load_scenario(CONFIG / "scenarios" / "training.toml"), _PULSES)
    shutil.copy(log.survey, folder / "survey.json")
    for command in (
        "svev analyze recordings/jump.mcap --survey survey.json -o results/jump",
        "svev orient results/jump/network.json -o poses.json",
        "svev export recordings/jump.mcap --out pictures --images tiff",
    ):
        done = _run(folder, command)
        assert done.returncode == 0, done.stderr
    return folder


def _environment(folder: Path) -> dict[str, str]:
    """In which `svev` is that of this checkout."""
    program = folder / "bin" / "svev"
    if not program.exists():
        program.parent.mkdir()
        program.write_text(f'#!/bin/sh\nexec {sys.executable} -m svev "$@"\n')
        program.chmod(0o755)
    return {**os.environ, "PATH": f"{program.parent}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}


def _run(folder: Path, command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command of a page in its folder."""
    return subprocess.run(
        ["/bin/bash", "-c", command],
        cwd=folder,
        env={**_environment(folder), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def _run_until_ready(folder: Path, command: str, ready: str, **environment: str) -> None:
    """Run a command of a page that goes on, and stop it, as with Ctrl-C, when it has said that it is ready.

    Args:
        folder: of the reader.
        command: of the page.
        ready: what it says then.
        environment: more of it.
    """
    said = folder / "said.txt"
    place = {**_environment(folder), **environment}
    asked = ["/bin/bash", "-c", f"exec {command}"]
    with (
        said.open("w") as output,
        subprocess.Popen(asked, cwd=folder, env=place, stdout=output, stderr=output) as process,
    ):
        try:
            wait_until(lambda: ready in said.read_text() or process.poll() is not None, f"{command}: {ready}", 120, 0.1)
            assert process.poll() is None, said.read_text()
            process.send_signal(signal.SIGINT)
            assert process.wait(60) in {0, 130}, said.read_text()
        finally:
            if process.poll() is None:
                process.kill()


@pytest.fixture
def place(recorded: Path, tmp_path: Path, loopback: Loopback) -> Path:
    """What a reader has in his folder."""
    log = "recordings/jump.mcap"
    for name in (log, "season/2026-11-21T19-40-18Z.mcap", "jump.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        os.link(recorded / log, tmp_path / name)
    for camera, view in (("K1", "left"), ("K2", "middle"), ("K3", "right")):
        shutil.copytree(recorded / "pictures" / camera, tmp_path / view)
    shutil.copy(recorded / "survey.json", tmp_path)
    shutil.copy(recorded / "results" / "jump" / "measurements.json", tmp_path / "mine.json")
    shutil.copytree(CONFIG, tmp_path / "config")
    rig = tmp_path / "config" / "rigs" / "sim.toml"
    # Tests that run beside this one publish too: at addresses of their own.
    rig.write_text(rig.read_text() + f'\n[network]\npublish = "{loopback.endpoint()}"\n')
    write_rig(tmp_path, loopback, backend="sim").rename(tmp_path / "my-hill.toml")
    return tmp_path


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", _pages(asking=False), ids=lambda page: page.stem)
def test_the_commands_of_a_page_run(page: Path, place: Path, recorded: Path, loopback: Loopback) -> None:
    for write in PREPARED.get(page.stem, ()):
        write(place)
    for command in _commands(page):
        if _why_not(command) is not None or _asks_the_service(command):
            continue
        if (ready := _goes_on(command)) is not None:
            _run_until_ready(place, _at_own_address(command, loopback), ready)
            continue
        if "poses.json" in command and "-o poses.json" not in command and not (place / "poses.json").exists():
            shutil.copy(recorded / "poses.json", place)  # of another page
        done = _run(place, re.sub(r"\bLOG\b", "jump.mcap", command))
        allowed = {0, 3} if _KEEPS_TIME.match(command) else {0}
        assert done.returncode in allowed, f"{command}\n{done.stdout}\n{done.stderr}"


def _at_own_address(command: str, loopback: Loopback) -> str:
    """A command that goes on, at an address where no test beside this one is."""
    if not command.startswith("svev serve "):
        return command
    return f"{re.sub(r'--host [0-9.]+', '', command)} --host {loopback.host} --port {loopback.free_port()}"


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("page", _pages(asking=True), ids=lambda page: page.stem)
def test_the_commands_of_a_page_run_beside_the_service(page: Path, tmp_path: Path, loopback: Loopback) -> None:
    (tmp_path / "list.csv").write_text("bib;athlete;gate;club\n1;Kari Nordmann;12;IL Svev\n2;Ola Nordmann;12;IL Svev\n")
    with serving(tmp_path, write_rig(tmp_path, loopback, backend="sim"), loopback) as service:
        service.arm()
        recording = service.post("/api/recordings", {"athlete": "Kari"})["id"]
        service.await_pulses(5)
        service.post(f"/api/recordings/{recording}/stop")
        for command in _commands(page):
            if _why_not(command) is not None or not _asks_the_service(command):
                continue
            if re.match(r"svev ctl (start|save) ", command):  # another example, not what follows the one before
                _end_recording(service)
            its = re.sub(r"\d{4}-\d\d-\d\dT[\d-]+Z", recording, command).replace("http://127.0.0.1:8000", service.url)
            if (ready := _goes_on(command)) is not None:
                _run_until_ready(tmp_path, its, ready, SVEV_URL=service.url)
                continue
            done = _run(tmp_path, its, SVEV_URL=service.url)
            assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


def _end_recording(service: Serving) -> None:
    status = service.get("/api/status")
    if status["state"] == "recording":
        service.post(f"/api/recordings/{status['recording']['id']}/stop")
    service.await_state("armed")
