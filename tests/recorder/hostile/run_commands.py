"""Runs the commands that read logs over a folder of them, in this process, and says what each did, as JSON lines.

    python -m tests.recorder.hostile.run_commands FOLDER [NAME ...]

A process of its own, so that a limit can be set to its memory and its use of it be measured.
"""

import contextlib
import io
import json
import resource
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path

from recorder.catalogue.folder import Catalogue
from rig.errors import SvevError
from svev import console
from svev.cli import main
from tests.support.processes import peak_memory_bytes

_ADDRESS_SPACE = 3 << 30


def _commands(log: Path, out: Path) -> dict[str, Callable[[], int]]:
    new = out / "new.mcap"
    address = f"ipc://{out}/replay"
    return {
        "info": lambda: main(["info", str(log)]),
        "info --json": lambda: main(["info", str(log), "--json"]),
        "verify": lambda: main(["verify", str(log)]),
        "verify --json": lambda: main(["verify", str(log), "--json"]),
        "recover": lambda: main(["recover", str(log), "-o", str(new)]),
        "verify recovered": lambda: main(["verify", str(new)]) if new.exists() else 0,
        "compact": lambda: main(["compact", str(log), "-o", str(out / "compact.mcap")]),
        "replay": lambda: main(["replay", str(log), "--speed", "max", "--wait", "0", "--bind", address]),
        "catalogue": lambda: _catalogue(log),
    }


def _catalogue(log: Path) -> int:
    """The log's row, its tags and its images."""
    found = Catalogue(log.parent)
    found.entry(log.stem)
    for pulse in [tag.pulse for tag in found.tags(log.stem)][:3]:
        with contextlib.suppress(SvevError):
            found.image(log.stem, pulse)
    return 0


def _run(command: Callable[[], int]) -> dict[str, object]:
    """Exit code, complaints, how long it took, and the most memory that this process has used so far, MB."""
    complaints = io.StringIO()
    console._stdout.file, console._stderr.file = io.StringIO(), complaints
    begin, code, raised = time.monotonic(), -1, ""
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(complaints):
            code = command()
    except SvevError as error:
        code = error.exit_code
        complaints.write(f"{error}\n")
    except BaseException:  # noqa: BLE001 - every traceback is what is looked for
        raised = traceback.format_exc()
    return {
        "code": code,
        "complaints": complaints.getvalue(),
        "traceback": raised,
        "seconds": round(time.monotonic() - begin, 3),
        "peak_mb": peak_memory_bytes() // 1024**2,
    }


def run_all(folder: Path, names: list[str]) -> None:
    """Run all commands over the logs of a folder, or those that are named."""
    resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
    for log in sorted(folder.glob("*.mcap")):
        if names and log.stem not in names:
            continue
        with tempfile.TemporaryDirectory() as out:
            for name, command in _commands(log, Path(out)).items():
                result = {"log": log.stem, "command": name, **_run(command)}
                sys.__stdout__.write(json.dumps(result) + "\n")  # type: ignore[union-attr]


if __name__ == "__main__":
    run_all(Path(sys.argv[1]), sys.argv[2:])
