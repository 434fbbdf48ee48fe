"""Compiles the shim that shows a process the emulated `/dev/fw*`."""

from pathlib import Path
from typing import Final

from simrig.preload import build

SOURCES: Final = Path(__file__).resolve().parent / "shim"


def shim() -> Path:
    """Path of the compiled shim.

    Raises:
        BadInputError: it cannot be compiled.
    """
    return build.shim("firewire", SOURCES)
