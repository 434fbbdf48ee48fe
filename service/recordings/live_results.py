"""The main figures of the jumps that were measured live, from the file beside their log, `LOG.jumper.json`.

`service.processes.live_jumps` writes that file. Nothing is read here but its member `summaries` and the take-off.
"""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from recorder.log.jumper_path import jumper_path
from rig.api.jump import LastJump
from rig.host.files import TEXT_MAX, read_whole


def summaries(log: Path) -> list[LastJump]:
    """The main figures of the jumps of a log that were measured live; none if their file is missing or damaged."""
    return _read(jumper_path(log))


def takeoff_pulse(log: Path) -> int | None:
    """The pulse of the take-off in the first jump of a log that was measured live; None if there is none."""
    try:
        pulse: float = _content(jumper_path(log))["jumps"][0]["takeoff"]["pulse"]
        return round(pulse)
    except (OSError, ValueError, KeyError, IndexError, TypeError, OverflowError):
        return None


def latest(folder: Path) -> LastJump | None:
    """The jump in a folder that was measured last; None if there is none."""
    found: list[tuple[int, Path]] = []
    for path in folder.glob(jumper_path(Path("*.mcap")).name):
        with suppress(OSError):  # deleted meanwhile
            found.append((path.stat().st_mtime_ns, path))
    known = (_read(path) for _, path in sorted(found, reverse=True))
    return next((jumps[-1] for jumps in known if jumps), None)


def _read(path: Path) -> list[LastJump]:
    try:
        return [LastJump.model_validate(each) for each in _content(path)["summaries"]]
    except (OSError, ValueError, ValidationError, KeyError, TypeError):
        return []


def _content(path: Path) -> Any:
    return json.loads(read_whole(path, TEXT_MAX, links=False))
