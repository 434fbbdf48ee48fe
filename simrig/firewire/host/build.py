"""Compiles the shim, the C library that shows a process the emulated `/dev/fw*`.

The library stays in the user's cache directory, under a name made from its source and the compiler's options. So each
version is compiled once, however many processes ask for it at the same time.
"""

import hashlib
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Final

from rig.errors import BadInputError

SOURCES: Final = Path(__file__).resolve().parent / "shim"
OPTIONS: Final = (
    "-std=gnu11", "-O2", "-g", "-Wall", "-Wextra", "-Werror", "-fPIC", "-fvisibility=hidden", "-shared",
)  # fmt: skip
_LIBRARIES: Final = ("-ldl", "-lpthread")
_COMPILE_S: Final = 60


def shim() -> Path:
    """Path of the compiled shim; compiles it if this version is not in the cache.

    Raises:
        BadInputError: there is no compiler, no kernel header, or no place for the result.
    """
    library = _cache() / f"firewire-shim-{_version()}.so"
    if not library.exists():
        _compile(library)
    return library


def _version() -> str:
    digest = hashlib.sha256(" ".join(OPTIONS).encode())
    for source in sorted(SOURCES.iterdir()):
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
            "no place for the FireWire shim: this user has no home directory; set XDG_CACHE_HOME to one of its own"
        ) from None


def _compile(library: Path) -> None:
    """Compile into a new directory beside `library`, then move the result there in one step."""
    compiler = shutil.which("gcc")
    if compiler is None:
        raise BadInputError(
            "the emulated FireWire bus needs a C compiler, and gcc is not there: apt install gcc linux-libc-dev"
        )
    try:
        library.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=library.parent) as directory:
            fresh = Path(directory) / library.name
            _run([compiler, *OPTIONS, "-o", str(fresh), *map(str, sorted(SOURCES.glob("*.c"))), *_LIBRARIES])
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
        f"the FireWire shim does not compile ({complaints[0].strip()}): apt install gcc linux-libc-dev, and if it "
        "recurs report it with that line"
    )
