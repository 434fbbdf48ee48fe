"""`make` on a system that lacks a package of Debian's says so in one line."""

import os
import subprocess
from pathlib import Path

from tests.systemd.prefixes import SYSTEMD

_SCRIPT = SYSTEMD.parent / ".ci" / "system-packages"
#: What a system answers where Chromium is a snap: everything is there but its package.
_PROGRAMS = {
    "dpkg-query": 'case "$3" in chromium*) exit 1 ;; *) echo -n installed ;; esac',
    "apt-get": "exit 0",
    "apt-cache": "exit 0",
    "sudo": '"$@"',
}


def test_a_system_without_a_package_is_refused_in_one_line(tmp_path: Path) -> None:
    for name, body in _PROGRAMS.items():
        program = tmp_path / name
        program.write_text(f"#!/bin/sh\n{body}\n")
        program.chmod(0o755)
    environment = {**os.environ, "PATH": f"{tmp_path}:{os.environ['PATH']}"}

    def called(what: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run([_SCRIPT, what], env=environment, capture_output=True, text=True, timeout=30, check=False)

    refused = called("develop")
    assert refused.returncode == 2
    (line,) = refused.stderr.splitlines()
    assert "has no package chromium-headless-shell" in line
    assert (called("run").returncode, called("run").stderr) == (0, "")
