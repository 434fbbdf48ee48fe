"""What travels in the wheel: the rooms, their data, and nothing that they need is undeclared."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

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
    assert entry.value == "svev.cli:main"


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
