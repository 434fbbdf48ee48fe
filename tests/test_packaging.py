"""What travels in the wheel: the rooms, their data, and nothing that they need is undeclared."""

import ast
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Mapping, Sequence
from importlib import metadata
from pathlib import Path

import pytest

from rig.transport.launcher import program_command, program_environment
from svev import cli
from tests.service.serving import serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
PACKAGES: list[str] = PROJECT["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
#: `gi` is Debian's python3-gi, which pip does not install; `pydantic_core` is the part of pydantic that it pins itself;
#: `_typeshed` is there for the type checker only.
#: The last two are Blender's own, whose interpreter runs the module that imports them.
NOT_DECLARED = {"_typeshed", "gi", "pydantic_core", "bpy", "mathutils"}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """Names of the files in a freshly built wheel."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(command, cwd=ROOT, capture_output=True, timeout=60, check=True)
    (path,) = folder.glob("svev-*.whl")
    with zipfile.ZipFile(path) as archive:
        return set(archive.namelist())


def test_every_module_and_data_file_of_the_rooms_travels(wheel: set[str]) -> None:
    git = shutil.which("git")
    if git is None or not (ROOT / ".git").exists():
        pytest.skip("not a git checkout: there is no list of what belongs to the project")
    command = [git, "ls-files", *PACKAGES]
    tracked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=30, check=True)
    assert {name for name in tracked.stdout.splitlines() if (ROOT / name).exists()} <= wheel


def test_nothing_else_travels(wheel: set[str]) -> None:
    folders = {name.split("/")[0] for name in wheel}
    assert {folder for folder in folders if not folder.endswith(".dist-info")} == set(PACKAGES)


def test_the_command_is_installed() -> None:
    (entry,) = (entry for entry in metadata.entry_points(group="console_scripts") if entry.name == "svev")
    assert entry.value == "svev.__main__:main"


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _imported(path: Path) -> set[str]:
    """Top-level names that a module imports, at whatever place in it."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.split(".")[0])
    return found


@pytest.mark.parametrize("package", PACKAGES)
def test_everything_imported_is_declared(package: str) -> None:
    # pip would install it today as somebody else's dependency, and not install it tomorrow.
    declared = {_normal(re.split(r"[ <>=!~;\[]", line)[0]) for line in PROJECT["project"]["dependencies"]}
    providers = metadata.packages_distributions()
    for path in (ROOT / package).rglob("*.py"):
        for name in _imported(path) - set(sys.stdlib_module_names) - set(PACKAGES) - NOT_DECLARED:
            assert {_normal(provider) for provider in providers.get(name, [])} & declared, f"{path}: {name}"


def test_every_dependency_is_locked_with_hashes() -> None:
    locked = (ROOT / "requirements.lock").read_text()
    names = {_normal(name) for name in re.findall(r"^([A-Za-z0-9._-]+)==", locked, re.MULTILINE)}
    wanted = [*PROJECT["project"]["dependencies"], *PROJECT["dependency-groups"]["dev"]]
    assert {_normal(re.split(r"[ <>=!~;\[]", line)[0]) for line in wanted} <= names
    entries = re.split(r"^(?=[A-Za-z0-9._-]+==)", locked, flags=re.MULTILINE)[1:]
    assert all("--hash=sha256:" in entry for entry in entries)


@pytest.mark.parametrize("home", ["", "https://example.org/svev"])
def test_an_index_shows_the_readme_with_links_that_lead_somewhere(tmp_path: Path, home: str) -> None:
    project = tmp_path / "project"
    project.mkdir()
    text = (ROOT / "pyproject.toml").read_text()
    (project / "pyproject.toml").write_text(text.replace('home = ""', f'home = "{home}"'))
    for name in ("README.md", "LICENSE", "hatch_build.py"):
        shutil.copy(ROOT / name, project)
    command = [sys.executable, "-m", "hatchling", "metadata"]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, timeout=60, check=True)
    told = json.loads(done.stdout)
    links = re.findall(r"\]\(([^)]+)\)", told["readme"]["text"])
    assert all(link.startswith("https://") for link in links)
    assert ("https://example.org/svev/raw/main/docs/images/report.jpg" in links) is bool(home)
    assert ("https://example.org/svev/blob/main/docs/index.md" in links) is bool(home)
    assert all(url.startswith(home) for url in told.get("urls", {}).values())
    assert ("Homepage" in told.get("urls", {})) is bool(home)
    assert "Operating System :: POSIX :: Linux" in told["classifiers"]


def test_one_module_starts_programs_of_ours_and_leaves_the_present_folder_out() -> None:
    # Users have files of our names, which would be imported in our stead.
    for package in PACKAGES:
        for path in (ROOT / package).rglob("*.py"):
            if path != ROOT / "rig" / "transport" / "launcher.py":
                assert "sys.executable" not in path.read_text(), path


@pytest.fixture
def shadowed(tmp_path: Path) -> Path:
    """A folder with a file of each name that we import, ours and others', none of which can be imported."""
    for name in {*PACKAGES, *sys.stdlib_module_names, *metadata.packages_distributions()}:
        if name.isidentifier():
            (tmp_path / f"{name}.py").write_text(f'raise SystemExit("{name}.py of the user was imported")\n')
    return tmp_path


def _called(folder: Path, *words: str, environment: dict[str, str] | None = None) -> "subprocess.CompletedProcess[str]":
    """Run the installed command in a folder."""
    return _ran(
        folder, [str(Path(sys.executable).with_name("svev")), *words], {"PYTHONPATH": str(ROOT)} | (environment or {})
    )


def _ran(folder: Path, command: Sequence[str], environment: Mapping[str, str]) -> "subprocess.CompletedProcess[str]":
    own = {**os.environ, **environment}
    return subprocess.run(command, cwd=folder, env=own, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.long
@pytest.mark.parametrize("command", sorted(cli._COMMANDS))
def test_every_command_starts_beside_files_of_our_names(shadowed: Path, command: str) -> None:
    done = _called(shadowed, command, "--help")
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("start", "path"),
    [(("svev",), ":/opt"), (("svev",), "/opt:"), (("python", "-m", "svev"), ""), (("python", "-m", "svev"), ":/opt")],
)
def test_a_path_that_leads_to_the_present_folder_too_shows_it_last(
    tmp_path: Path, start: tuple[str, ...], path: str
) -> None:
    for name in PACKAGES:
        if name != "svev":  # after `python -m` that is what was asked for
            (tmp_path / f"{name}.py").write_text(f'raise SystemExit("{name}.py of the user was imported")\n')
    command = [str(Path(sys.executable).with_name(start[0])), *start[1:], "info", "--help"]
    done = _ran(tmp_path, command, {"PYTHONPATH": path})
    assert (done.returncode, done.stderr) == (0, "")


def _programs() -> list[str]:
    """Modules that are run as children; those of `bench` nobody starts beside files of his own."""
    paths = [path for package in PACKAGES if package != "bench" for path in (ROOT / package).rglob("*.py")]
    begin = [path for path in paths if re.search(r"^def main\(\) -> None:", path.read_text(), re.MULTILINE)]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in begin]
    return sorted({*names} - {"rig.transport.launcher_program"})  # it starts the others


@pytest.mark.long
@pytest.mark.parametrize("program", _programs())
def test_every_program_starts_beside_files_of_our_names(
    shadowed: Path, monkeypatch: pytest.MonkeyPatch, program: str
) -> None:
    monkeypatch.setenv("PYTHONPATH", ":")
    ours, theirs = socket.socketpair()
    ours.close()
    with theirs:
        done = subprocess.run(
            [*program_command(program), "child", str(theirs.fileno())], env=program_environment(), cwd=shadowed,
            pass_fds=[theirs.fileno()], capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
    assert done.stderr == "child: no configuration came; this program is started by svev\n"


@pytest.mark.long
def test_every_child_starts_beside_files_of_our_names(
    shadowed: Path, loopback: Loopback, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Simulated cameras, grabbers, recorder, and those of a service: its exports for instance."""
    rig = write_rig(shadowed, loopback, backend="aravis")
    recorded = _called(shadowed, "record", "--rig", str(rig), "--seconds", "2", "--out", "out", "--json")
    assert "was imported" not in recorded.stderr
    log = json.loads(recorded.stdout)["log"]
    exported = _called(shadowed, "export", log, "--out", "film.mp4")
    assert exported.returncode == 0, exported.stderr
    monkeypatch.chdir(shadowed)
    with serving(shadowed, rig, loopback) as running:
        running.arm()
        recording = running.post("/api/recordings", {})["id"]
        running.await_pulses(5)
        running.post(f"/api/recordings/{recording}/stop")
        running.await_state("armed")
        status, asked = running.call("POST", f"/api/recordings/{recording}/exports", {})
        assert status == 202, asked
        export = f"/api/exports/{asked['id']}"
        wait_until(lambda: running.get(export)["state"] in {"done", "failed"}, "the export is done", timeout_s=60.0)
        assert running.get(export)["state"] == "done"


@pytest.mark.parametrize("words", [("cameras", "show", "127.0.0.1"), ("record",), ("demo", "--seconds", "1")])
def test_without_aravis_one_sentence_says_what_to_install(
    tmp_path: Path, loopback: Loopback, words: tuple[str, ...]
) -> None:
    (tmp_path / "gi.py").write_text("raise ModuleNotFoundError(\"No module named 'gi'\")\n")
    if words == ("record",):
        rig = write_rig(tmp_path, loopback, backend="aravis")
        words = (*words, "--rig", str(rig), "--seconds", "1", "--out", "out")
    done = _called(tmp_path, *words, environment={"PYTHONPATH": f"{tmp_path}:{ROOT}"})
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    (said,) = [line for line in done.stderr.splitlines() if "Aravis" in line]
    assert "GigE Vision cameras need Aravis, which cannot be loaded (No module named 'gi'): run sudo apt-get" in said


def test_cameras_are_listed_without_aravis(tmp_path: Path) -> None:
    (tmp_path / "gi.py").write_text("raise ModuleNotFoundError(\"No module named 'gi'\")\n")
    done = _called(tmp_path, "cameras", "list", "--interface", "lo", environment={"PYTHONPATH": f"{tmp_path}:{ROOT}"})
    assert (done.returncode, done.stderr) == (0, "")
