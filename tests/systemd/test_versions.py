"""Versions side by side: installed from a bundle, undone when a step fails, pruned when nobody runs them.

The bundle holds a small package in place of Svev, so that an installation takes a second. What a real upgrade does to a
service that records, test_upgrade.py examines.
"""

import hashlib
import platform
import shutil
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.systemd.prefixes import SYSTEMD

pytestmark = pytest.mark.long

# It runs until its standard input ends, as a service would until it is stopped.
_CLI = """
import sys
def command_line(): pass
def main():
    print(sys.prefix, flush=True)
    sys.stdin.read()
"""
_SETTINGS = """
from rig.errors import SvevError
def load_rig(path):
    if "wrong" in path.read_text():
        raise SvevError("it is wrong: correct it")
"""
_PACKAGE = {
    "svev/__init__.py": "", "svev/cli.py": _CLI,
    "rig/__init__.py": "", "rig/errors.py": "class SvevError(Exception): pass",
    "rig/settings/__init__.py": "", "rig/settings/file.py": _SETTINGS,
    "svev-9.dist-info/METADATA": "Metadata-Version: 2.1\nName: svev\nVersion: 9\n",
    "svev-9.dist-info/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    "svev-9.dist-info/entry_points.txt": "[console_scripts]\nsvev = svev.cli:main\n",
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle with one small wheel."""
    bundle = tmp_path_factory.mktemp("bundle")
    wheel = bundle / "wheels" / "svev-9-py3-none-any.whl"
    wheel.parent.mkdir()
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, text in _PACKAGE.items():
            archive.writestr(name, text)
        archive.writestr("svev-9.dist-info/RECORD", "".join(f"{name},,\n" for name in _PACKAGE))
    shutil.copytree(SYSTEMD, bundle / "systemd")
    (bundle / "docs" / "how-to").mkdir(parents=True)
    (bundle / "docs" / "how-to" / "hill-pc.md").touch()
    (bundle / "config" / "rigs").mkdir(parents=True)
    (bundle / "config" / "rigs" / "hill-gige.toml").write_text("fine")
    (bundle / "requirements.txt").write_text(
        f"./wheels/{wheel.name} --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}\n"
    )
    (bundle / "python").write_text(f"3.{platform.python_version_tuple()[1]} {platform.machine()}\n")
    return bundle


@pytest.fixture(autouse=True)
def no_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is installed is found, even if the tests are run with a path to the checkout."""
    monkeypatch.delenv("PYTHONPATH", raising=False)


@pytest.fixture
def bundle(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "bundle", symlinks=True)


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    return tmp_path / "prefix"


def _run(bundle: Path, script: str, prefix: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [bundle / "systemd" / script, prefix], capture_output=True, text=True, timeout=120, check=False
    )


def _install(bundle: Path, version: str, prefix: Path) -> None:
    (bundle / "version").write_text(f"{version}\n")
    done = _run(bundle, "install", prefix)
    assert done.returncode == 0, done.stderr


def _versions(prefix: Path) -> list[str]:
    """Versions that are there, oldest first, without the time at which they were installed."""
    return sorted(path.name.split("-")[0] for path in (prefix / "lib/svev/versions").iterdir())


def _starts(prefix: Path) -> str:
    """The version that starts."""
    done = subprocess.run(
        [prefix / "bin" / "svev"], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30, check=True
    )
    return Path(done.stdout).name.split("-")[0]


def _everything(prefix: Path) -> Iterator[tuple[str, object]]:
    """Names and contents of all files and links, except those that Python compiles while it runs."""
    for path in sorted(prefix.rglob("*")):
        if path.suffix != ".pyc" and not path.is_dir():
            yield str(path), path.readlink() if path.is_symlink() else path.read_bytes()


def _damage_the_wheel(bundle: Path, prefix: Path) -> None:
    with (bundle / "wheels" / "svev-9-py3-none-any.whl").open("ab") as wheel:
        wheel.write(b"\0")


def _spoil_the_rig_file(bundle: Path, prefix: Path) -> None:
    (prefix / "etc/svev/rig.toml").write_text("wrong")


def _stand_in_the_way(bundle: Path, prefix: Path) -> None:
    # The last file to be replaced, when all others are those of the new version.
    (bundle / "systemd" / "svev.service").write_text("of the new version\n")
    (prefix / "lib/sysctl.d/90-svev.conf.new/here").mkdir(parents=True)


@pytest.mark.parametrize("spoil", [_damage_the_wheel, _spoil_the_rig_file, _stand_in_the_way])
def test_if_a_step_fails_all_is_as_before(bundle: Path, prefix: Path, spoil: Callable[[Path, Path], None]) -> None:
    _install(bundle, "1", prefix)
    spoil(bundle, prefix)
    before = dict(_everything(prefix))
    (bundle / "version").write_text("2\n")

    done = _run(bundle, "install", prefix)

    assert done.returncode not in {0, None}
    assert "not installed" in done.stderr
    after = dict(_everything(prefix))
    assert {name for name in before | after if before.get(name) != after.get(name)} == set()
    assert _starts(prefix) == "1"


def test_versions_that_nobody_needs_are_removed(bundle: Path, prefix: Path) -> None:
    _install(bundle, "1", prefix)
    with subprocess.Popen([prefix / "bin" / "svev"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as running:
        assert running.stdout is not None
        assert b"/1-" in running.stdout.readline()
        _install(bundle, "2", prefix)
        _install(bundle, "3", prefix)
        assert _versions(prefix) == ["1", "2", "3"], "1 runs, 2 is the one before"
        running.communicate(timeout=30)
    _install(bundle, "4", prefix)
    assert _versions(prefix) == ["3", "4"]

    assert _run(bundle, "rollback", prefix).returncode == 0
    assert _starts(prefix) == "3"
    # What was installed can remove itself: the bundle may be gone.
    subprocess.run([prefix / "lib/svev/current/setup/uninstall", prefix], check=True, timeout=30, capture_output=True)
    assert {name for name, _ in _everything(prefix)} == {
        str(prefix / "etc/svev/rig.toml"), str(prefix / "etc/svev/options")
    }  # fmt: skip


def test_two_at_once_do_not_disturb_each_other(bundle: Path, prefix: Path) -> None:
    (bundle / "version").write_text("1\n")
    lock = prefix / "lib/svev/.lock"
    lock.parent.mkdir(parents=True)
    command = ["flock", str(lock), "sh", "-c", "echo; cat"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        done = _run(bundle, "install", prefix)
        assert (done.returncode, "another installation" in done.stderr) == (2, True)
        holder.communicate(timeout=30)


def test_a_bundle_for_another_python_is_refused(bundle: Path, prefix: Path) -> None:
    (bundle / "version").write_text("1\n")
    (bundle / "python").write_text("2.7 vax\n")
    done = _run(bundle, "install", prefix)
    assert done.returncode == 2
    assert "for Python 2.7 on vax" in done.stderr
