"""Compiles a shim, a C library that shows a process emulated devices: `/dev/fw*` or `/dev/gpiochip*`.

The library stays in the user's cache directory, under a name made from its source and the compiler's options. So each
version is compiled once, however many processes ask for it at the same time.
"""

import hashlib
import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from rig.errors import BadInputError

#: What all shims have in common.
COMMON: Final = Path(__file__).resolve().parent
OPTIONS: Final = (
    "-std=gnu11", "-O2", "-g", "-Wall", "-Wextra", "-Werror", "-fPIC", "-fvisibility=hidden", "-shared",
    f"-I{COMMON}",
)  # fmt: skip
_LIBRARIES: Final = ("-ldl", "-lpthread")
_COMPILE_S: Final = 60


def shim(name: str, sources: Path) -> Path:
    """Path of a compiled shim; compiles it if this version is not in the cache.

    Args:
        name: what it emulates, a part of the file's name.
        sources: folder of its source, to which that of `COMMON` is added.

    Raises:
        BadInputError: there is no compiler, no kernel header, or no place for the result.
    """
    parts = sorted(each for folder in (sources, COMMON) for each in folder.iterdir() if each.suffix in {".c", ".h"})
    library = _cache() / f"{name}-shim-{_version(parts)}.so"
    if not library.exists():
        _compile(library, [each for each in parts if each.suffix == ".c"])
    return library


def _version(parts: Sequence[Path]) -> str:
    digest = hashlib.sha256(" ".join(OPTIONS).encode())
    for source in parts:
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:16]


def _cache() -> Path:
    """The user's own cache directory: nobody else may put a library there."""
    base = os.environ.get("XDG_CACHE_HOME", "")
    if Path(base).is_absolute():
        return Path(base) / "svev"
    try:
        return Path.home() / ".cache" / "svev"
    except RuntimeError:
        raise BadInputError(
            "no place for the shim of emulated devices: this user has no home directory; set "
            "XDG_CACHE_HOME to one of its own"
        ) from None


def _compile(library: Path, sources: Sequence[Path]) -> None:
    """Compile into a new directory beside `library`, then move the result there in one step."""
    compiler = shutil.which("gcc")
    if compiler is None:
        raise BadInputError("emulated devices need a C compiler, and gcc is not there: apt install gcc linux-libc-dev")
    try:
        library.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as directory:
            fresh = Path(directory) / library.name
            _run([compiler, *OPTIONS, "-o", str(fresh), *map(str, sources), *_LIBRARIES])
            fresh.replace(library)
    except OSError as error:
        raise BadInputError(
            f"{library}: cannot be written ({error.strerror}): make room or set XDG_CACHE_HOME to another directory"
        ) from None


def _run(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, timeout=_COMPILE_S, check=False)
    if done.returncode == 0:
        return
    complaints = [line for line in done.stderr.splitlines() if "error" in line] or ["no reason given"]
    raise BadInputError(
        f"the shim of emulated devices does not compile ({complaints[0].strip()}): apt install gcc linux-libc-dev, "
        "and if it recurs report it with that line"
    )
