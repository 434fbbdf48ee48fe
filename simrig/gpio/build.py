"""Compiles the shim that shows a process emulated GPIO chips."""

import os
from pathlib import Path
from typing import Final

from simrig.preload import build

SOURCES: Final = Path(__file__).resolve().parent / "shim"


def shim() -> Path:
    """Path of the compiled shim.

    Raises:
        BadInputError: it cannot be compiled.
    """
    return build.shim("gpio", SOURCES)


def environment() -> dict[str, str]:
    """Environment variables that a process needs to see emulated chips.

    Raises:
        BadInputError: as `shim`.
    """
    preload = [str(shim()), *filter(None, [os.environ.get("LD_PRELOAD")])]
    return {"LD_PRELOAD": " ".join(preload)}
