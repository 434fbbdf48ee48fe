"""What is dear to make and the same for many tests, made once for all workers: kept by content under `.cache/tests`.

It is made again when any file of this checkout has changed but its pages, so what a test gets is always what its own
code makes.
"""

import fcntl
import hashlib
import os
import pickle
import shutil
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, Final

from bench.analysis.hill_logs import HillLog, write_hill_log
from simrig.world.scenario import Scenario

_ROOT: Final = Path(__file__).resolve().parents[2]
_KEPT: Final = _ROOT / ".cache" / "tests"
#: Folders that nothing that is kept depends on: pages, what is made or installed, and what programs record here.
_FOREIGN: Final = {"docs", "build", "dist", "recordings", "demo", "bench/results"}
_FOREIGN_NAMES: Final = {"node_modules", "__pycache__"}
_UNUSED_S: Final = 7200.0  # longer than a run of the tests: then what was made of another content is removed


def kept(name: str, make: Callable[[Path], None], *inputs: object) -> Path:
    """A folder with what `make` writes into it; not to be changed.

    Args:
        name: of the folder, without what tells its content; one for each `make`.
        make: fills an empty folder, in one process; the other ones wait.
        inputs: what `make` depends on beside this checkout, as `repr` tells it.
    """
    digest = hashlib.sha256(repr((_sources(), inputs)).encode()).hexdigest()[:16]
    folder = _KEPT / f"{name}-{digest}"
    _KEPT.mkdir(parents=True, exist_ok=True)
    with (_KEPT / f"{name}-{digest}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not folder.exists():
            _remove_unused()
            partial = folder.with_name(f"{folder.name}.partial")
            shutil.rmtree(partial, ignore_errors=True)  # of a run that was killed
            partial.mkdir()
            make(partial)
            partial.rename(folder)
    os.utime(folder)
    return folder


def kept_object(name: str, make: Callable[[], Any], *inputs: object) -> Any:
    """As `kept`, of one object that can be pickled; each call gives another one."""

    def write(folder: Path) -> None:
        (folder / "object.pickle").write_bytes(pickle.dumps(make()))

    return pickle.loads((kept(name, write, *inputs) / "object.pickle").read_bytes())  # noqa: S301 - written above


def kept_hill_log(scenario: Scenario, pulses: Sequence[int], name: str = "jump", **more: Any) -> HillLog:
    """As `bench.analysis.hill_logs.write_hill_log`, of a log that no test changes; `name` is that of the recording."""

    def write(folder: Path) -> None:
        log = write_hill_log(folder / name, scenario, pulses, **more)
        (folder / "truth.pickle").write_bytes(pickle.dumps(log.truth))

    folder = kept("hill", write, scenario, pulses, name, sorted(more.items()))
    truth = pickle.loads((folder / "truth.pickle").read_bytes())  # noqa: S301 - written above
    return HillLog(folder / f"{name}.mcap", folder / f"{name}.survey.json", truth)


@cache
def _sources() -> str:
    """A digest of the contents of this checkout."""
    digest = hashlib.sha256()
    for folder, folders, files in os.walk(_ROOT):
        here = Path(folder).relative_to(_ROOT)
        folders[:] = sorted(
            each
            for each in folders
            if not each.startswith(".") and each not in _FOREIGN_NAMES and str(here / each) not in _FOREIGN
        )
        for file in sorted(files):
            digest.update(f"{here / file}\0".encode())
            digest.update(hashlib.sha256(Path(folder, file).read_bytes()).digest())
    return digest.hexdigest()


def _remove_unused() -> None:
    """Logs are large, and a day of work has many contents; several processes may look at once."""
    for old in _KEPT.iterdir():
        with suppress(FileNotFoundError):
            if time.time() - old.stat().st_mtime > _UNUSED_S:
                shutil.rmtree(old) if old.is_dir() else old.unlink()
