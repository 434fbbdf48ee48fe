"""Prefixes as `make install` makes them, without installing the packages."""

import subprocess
from pathlib import Path

SYSTEMD = Path(__file__).parents[2] / "systemd"
VERSION = "0-test"


def units_into(prefix: Path, program: str) -> None:
    """Put units, rules, documentation and configuration into a prefix, with a text as the program."""
    folder = prefix / "lib/svev/versions" / VERSION
    (folder / "bin").mkdir(parents=True, exist_ok=True)
    script = folder / "bin" / "svev"
    script.write_text(program)
    script.chmod(0o755)
    steps = 'source "$0/places"; source "$0/versions"; places "$1"; fill_version "$2"; publish "$2"'
    subprocess.run(["/bin/bash", "-euc", steps, SYSTEMD, prefix, VERSION], check=True, timeout=30)
