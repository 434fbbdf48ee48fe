"""Libraries in C that stand between a program under test and the system: compiled here, preloaded into the program."""

import os
import subprocess
from pathlib import Path


def compiled(source: Path, folder: Path) -> Path:
    """The library made of a source file, in a folder."""
    library = folder / source.with_suffix(".so").name
    command = ["gcc", "-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror", str(source), "-o", str(library)]
    subprocess.run([*command, "-ldl", "-lpthread"], check=True, timeout=60)
    return library


def preloading(library: Path) -> dict[str, str]:
    """The variable of the environment that puts a library into a program and its children."""
    return {"LD_PRELOAD": " ".join([str(library), *filter(None, [os.environ.get("LD_PRELOAD")])])}
