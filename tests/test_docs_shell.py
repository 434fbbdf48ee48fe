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
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, chdir, contextmanager
from pathlib import Path
from typing import Final

import pytest

from rig.settings.file import CONFIG
from simrig.programs.simulated_hill import SimulatedHill
from tests.analysis.measured import measured_jump
from tests.reader_files import PREPARED
from tests.service.serving import Serving, serving
from tests.support.commands import run_svev
from tests.support.kept import kept
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig
from tests.support.waiting import wait_until
from tests.svev.setup.terminal import Terminal
from tests.test_docs import FENCE, PAGES, ROOT

#: What is not run, by the beginning of the command, and why.
NOT_RUN: Final = {
    r"make |bash \.ci/run": "targets of the Makefile: `make check` and CI are these",
    r"sudo |pipx |(?:printf|echo) .*\| sudo|su -|apt |adduser |exit$|systemctl ": "changes the computer, as root",
    r"git clone |cd svev|source \.venv|tar xf ": "the checkout and the bundle: .ci/try-wheel, tests/systemd",
    r"rsync ": "needs another computer",
}
#: Commands that go on until somebody stops them, and what they say when they are ready.
GOES_ON: Final = {
    r"svev serve ": "svev: panel at ",
    r"svev digitize ": "svev: measure at ",
    r"svev ctl log": "recording",
    r"svev worker ": "results at ",
}
#: Commands that the next ones of the page need to go on, and what they say when they are ready.
BESIDE: Final = {r"dask scheduler": "Scheduler at:", r"dask worker": "Registered to:"}
#: Commands that ask a person, and what they ask first. All answers: tests/svev/setup.
ASKS: Final = {r"svev setup": "English or Norwegian"}
#: Commands that record at 30 Hz: on a busy computer frames are missing, and exit code 3 says so.
_KEEPS_TIME: Final = re.compile(r"svev (doctor|demo|rehearse|record|verify \S+\*|analyze \S+\*)")


def _commands(page: Path) -> list[str]:
    blocks = [body for language, body in FENCE.findall(page.read_text()) if language == "sh"]
    return [line for body in blocks for line in body.replace("\\\n", " ").splitlines() if line.strip()]


def _why_not(command: str) -> str | None:
    return next((why for pattern, why in NOT_RUN.items() if re.match(pattern, command)), None)


def _says(patterns: Mapping[str, str], command: str) -> str | None:
    return next((words for pattern, words in patterns.items() if re.match(pattern, command)), None)


def _asks_the_service(command: str) -> bool:
    return command.startswith(("svev ctl ", "curl "))


def _asks_a_camera(command: str) -> bool:
    return command.startswith("svev cameras ")


def _pages(*, asking: bool) -> list[Path]:
    """Pages with commands that are run: those that ask a running service, or the others."""
    return [
        page
        for page in PAGES
        if any(
            _why_not(each) is None and _asks_the_service(each) is asking and not _asks_a_camera(each)
            for each in _commands(page)
        )
    ]


def test_every_reason_is_needed_and_every_command_of_svev_is_run() -> None:
    commands = [command for page in PAGES for command in _commands(page)]
    for pattern in (*NOT_RUN, *GOES_ON, *BESIDE, *ASKS):
        assert any(re.match(pattern, command) for command in commands), f"no page has a command like {pattern}"
    of_svev = [command for command in commands if command.startswith("svev ")]
    assert all(_why_not(command) is None for command in of_svev)


def test_blocks_with_commands_are_shell_blocks() -> None:
    for page in PAGES:
        for language, body in FENCE.findall(page.read_text()):
            if language != "sh":
                assert not re.search(r"^svev [a-z]", body, re.MULTILINE), f"{page.name}: write ```sh before it"


@pytest.fixture(scope="module")
def recorded() -> Path:
    """A folder with `recordings/jump.mcap`, its survey, poses, pictures, and `results/jump`; not to be changed."""
    return kept("docs-shell", _record)


def _record(folder: Path) -> None:
    (folder / "recordings").mkdir()
    jump = measured_jump()
    shutil.copy(jump.log.path, folder / "recordings" / "jump.mcap")
    shutil.copy(jump.log.survey, folder / "survey.json")
    shutil.copytree(jump.result, folder / "results" / "jump")
    for command in (
        "svev orient results/jump/network.json -o poses.json",
        "svev export recordings/jump.mcap --out pictures --images tiff",
    ):
        done = _run(folder, command)
        assert done.returncode == 0, done.stderr


def _environment(folder: Path) -> dict[str, str]:
    """In which `svev` is that of this checkout."""
    programs = folder / "bin"
    if not programs.exists():
        programs.mkdir()
        for name in ("svev", "dask"):
            program = programs / name
            program.write_text(f'#!/bin/sh\nexec {sys.executable} -m {name} "$@"\n')
            program.chmod(0o755)
    return {**os.environ, "PATH": f"{programs}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}


def _run(folder: Path, command: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command of a page in its folder.

    One of `svev` is forked by the launcher, with the arguments that the shell makes of it: most only start and end.
    """
    ours = command.startswith("svev ")
    asked = f"svev() {{ printf '%s\\0' \"$@\"; }}; {command}" if ours else command
    done = subprocess.run(
        ["/bin/bash", "-c", asked],
        cwd=folder,
        env={**_environment(folder), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    if not ours:
        return done
    assert not done.stderr, f"{command}: no command of svev alone"
    with chdir(folder):  # a program begins where it is launched
        return run_svev(*done.stdout.split("\0")[:-1], timeout_s=400, environment=environment)


@contextmanager
def _going_on(folder: Path, command: str, ready: str, **environment: str) -> Iterator[None]:
    """Run a command of a page that goes on, until it has said that it is ready; stop it at the end, as with Ctrl-C.

    Args:
        folder: of the reader.
        command: of the page.
        ready: what it says then.
        environment: more of it.
    """
    said = folder / f"said-{'-'.join(command.split()[:2])}.txt"
    place = {**_environment(folder), **environment}
    asked = ["/bin/bash", "-c", f"exec {command}"]
    with (
        said.open("w") as output,
        subprocess.Popen(asked, cwd=folder, env=place, stdout=output, stderr=output) as process,
    ):
        try:
            wait_until(lambda: ready in said.read_text() or process.poll() is not None, f"{command}: {ready}", 120, 0.1)
            assert process.poll() is None, said.read_text()
            yield
            process.send_signal(signal.SIGINT)
            assert process.wait(60) in {0, 130}, said.read_text()
        finally:
            if process.poll() is None:
                process.kill()


@pytest.fixture
def place(recorded: Path, tmp_path: Path, loopback: Loopback) -> Path:
    """What a reader has in his folder."""
    log = "recordings/jump.mcap"
    (tmp_path / log).parent.mkdir()
    shutil.copy(recorded / log, tmp_path / log)
    for name in ("season/2026-11-21T19-40-18Z.mcap", "jump.mcap"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        os.link(tmp_path / log, tmp_path / name)
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
    scheduler = loopback.free_port()
    with ExitStack() as stack:
        for command in _commands(page):
            if _why_not(command) is not None or _asks_the_service(command) or _asks_a_camera(command):
                continue
            its = _at_own_address(command, loopback, scheduler)
            if (ready := _says(BESIDE, command)) is not None:
                stack.enter_context(_going_on(place, its, ready))
            elif (ready := _says(GOES_ON, command)) is not None:
                with _going_on(place, its, ready):
                    pass
            elif (question := _says(ASKS, command)) is not None:
                _break_off(its, question, place)
            else:
                if "poses.json" in its and "-o poses.json" not in its and not (place / "poses.json").exists():
                    shutil.copy(recorded / "poses.json", place)  # of another page
                done = _run(place, re.sub(r"\bLOG\b", "jump.mcap", its))
                allowed = {0, 3} if _KEEPS_TIME.match(command) else {0}
                assert done.returncode in allowed, f"{command}\n{done.stdout}\n{done.stderr}"


def _break_off(command: str, question: str, place: Path) -> None:
    """Call a command at a terminal, and press Ctrl-C when it asks."""
    with Terminal(*command.split()[1:], "--folder", str(place / "asked")) as terminal:
        terminal.await_text(question)
        terminal.type("\x03")
        assert terminal.end() == 130
    assert not (place / "asked").exists()


def _at_own_address(command: str, loopback: Loopback, scheduler: int) -> str:
    """A command, at addresses where no test beside this one is."""
    host = loopback.host
    if command.startswith("svev serve "):
        return f"{re.sub(r'--host [0-9.]+', '', command)} --host {host} --port {loopback.free_port()}"
    if command.startswith("svev worker "):
        return f"{command} --bind {loopback.endpoint()}"
    if command.startswith("dask scheduler"):
        return f"dask scheduler --host {host} --port {scheduler} --no-dashboard"
    if command.startswith("dask worker"):
        command = f"{command.partition('#')[0]} --host {host} --no-dashboard --no-nanny"
    return command.replace("tcp://one:8786", f"tcp://{host}:{scheduler}")


@pytest.mark.long
@pytest.mark.parametrize(
    "page", [page for page in PAGES if any(map(_asks_a_camera, _commands(page)))], ids=lambda page: page.stem
)
def test_the_commands_of_a_page_find_and_move_a_camera(page: Path, tmp_path: Path, loopback: Loopback) -> None:
    at, free = loopback.cameras(2)
    shutil.copytree(CONFIG, tmp_path / "config")
    with SimulatedHill(CONFIG / "scenarios" / "training.toml", {"K1": at}, 30.0, broadcast="127.255.255.255"):
        for command in filter(_asks_a_camera, _commands(page)):
            its = re.sub(r"\b192\.168\.11\.2\b", free, command).replace(" SERIAL ", f" {at} ")
            if not its.startswith("svev cameras show"):
                its += " --interface lo"  # other tests' cameras are left alone
            done = _run(tmp_path, its)
            assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
            assert {"list": at, "set-ip": free, "show": "ExposureTime"}[command.split()[2]] in done.stdout


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
            if (ready := _says(GOES_ON, command)) is not None:
                with _going_on(tmp_path, its, ready, SVEV_URL=service.url):
                    pass
                continue
            done = _run(tmp_path, its, SVEV_URL=service.url)
            assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


def _end_recording(service: Serving) -> None:
    status = service.get("/api/status")
    if status["state"] == "recording":
        service.post(f"/api/recordings/{status['recording']['id']}/stop")
    service.await_state("armed")
