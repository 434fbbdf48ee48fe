"""What `make install` puts into a prefix, examined by systemd's own tools."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tests.systemd.prefixes import SYSTEMD, VERSION, units_into


def _run(*command: str | Path) -> str:
    result = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        stdin=subprocess.DEVNULL,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout + result.stderr


@pytest.fixture
def prefix(tmp_path: Path) -> Path:
    """A prefix with the units, and a program for them to start."""
    prefix = tmp_path / "prefix"
    units_into(prefix, "#!/bin/sh\n")
    return prefix


def _analyze(*arguments: str | Path) -> str:
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed")
    return _run("systemd-analyze", *arguments)


def test_systemd_finds_nothing_wrong_with_the_unit(prefix: Path) -> None:
    assert _analyze("verify", prefix / "lib/systemd/system/svev.service") == ""


def test_the_sandbox_is_tight(prefix: Path) -> None:
    unit = prefix / "lib/systemd/system/svev.service"
    # Exposure is given in tenths, from 0 (closed) to 100 (open); ours is 27, of which 5 are ProtectClock=, which
    # would forbid to ask how well the kernel knows UTC; a unit without a sandbox has 96.
    _analyze("security", "--offline=true", "--threshold=28", "--no-pager", unit)


def test_users_and_directories_are_understood(prefix: Path, tmp_path: Path) -> None:
    if shutil.which("systemd-sysusers") is None or shutil.which("systemd-tmpfiles") is None:
        pytest.skip("systemd is not installed")
    root = tmp_path / "root"
    (root / "etc").mkdir(parents=True)
    _run("systemd-sysusers", f"--root={root}", prefix / "lib/sysusers.d/svev.conf")
    members = dict(line.split(":", 1) for line in (root / "etc/group").read_text().splitlines())
    assert members["video"].endswith(":svev")
    assert members["dialout"].endswith(":svev")
    assert members["gpio"].endswith(":svev")
    configured = root / "usr/lib/tmpfiles.d"
    configured.mkdir(parents=True)
    shutil.copy(prefix / "lib/tmpfiles.d/svev.conf", configured)
    described = _run("systemd-tmpfiles", "--cat-config", f"--root={root}")
    assert "/var/lib/svev/recordings" in described


def test_no_place_is_left_open(prefix: Path) -> None:
    setup = prefix / "lib/svev/versions" / VERSION / "setup"  # the scripts that fill them in
    installed = [path for path in prefix.rglob("*") if path.is_file() and path.parent != setup]
    assert len(installed) > 7
    for path in installed:
        assert b"@PREFIX@" not in path.read_bytes(), path
        assert b"@CONFIG@" not in path.read_bytes(), path


def test_installing_again_keeps_what_the_owner_has_written(prefix: Path) -> None:
    (prefix / "etc/svev/rig.toml").write_text("mine")
    (prefix / "etc/svev/options").write_text("mine too")
    units_into(prefix, "#!/bin/sh\n")
    assert (prefix / "etc/svev/rig.toml").read_text() == "mine"
    assert (prefix / "etc/svev/options").read_text() == "mine too"


def test_uninstalling_removes_all_but_the_configuration(prefix: Path) -> None:
    said = _run(SYSTEMD / "uninstall", prefix)
    left = sorted(str(path.relative_to(prefix)) for path in prefix.rglob("*") if path.is_symlink() or path.is_file())
    assert left == ["etc/svev/options", "etc/svev/rig.toml"]
    assert str(prefix / "etc/svev") in said


def test_a_relative_prefix_is_refused() -> None:
    result = subprocess.run([SYSTEMD / "install", "here"], capture_output=True, text=True, timeout=60, check=False)
    assert result.returncode == 2
    assert "PREFIX must be an absolute path" in result.stderr
