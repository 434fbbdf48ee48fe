"""The main figures of the jumps that were measured live, from the file beside their log, `LOG.jumper.json`.

`service.processes.live_jumps` writes that file. Nothing is read here but its member `summaries` and the take-off. What
was measured in the whole log (`service.measuring.results`) goes before it.
"""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from recorder.log.beside import jumper_path, measured_path
from rig.api.jump import LastJump
from rig.host.files import TEXT_MAX, read_whole
from service.measuring.results import jumps_of


def summaries(log: Path) -> list[LastJump]:
    """The main figures of the jumps of a log that were measured live; none if their file is missing or damaged."""
    return _read(jumper_path(log))


def takeoff_pulse(log: Path, number: int = 1) -> float | None:
    """The take-off in a jump of a log, in pulses; None if there is no such jump, or it was not measured."""
    for path in _results(log):
        with suppress(OSError, ValueError, LookupError, TypeError, AttributeError, OverflowError):
            pulse = float(_jumps(path)[number]["takeoff"]["pulse"])
            round(pulse)
            return pulse
    return None


def middle_pulse(log: Path, number: int) -> int | None:
    """The middle of the pulses in which a jumper is in sight; None if there is no such jump, or no other one."""
    for path in _results(log):
        with suppress(OSError, ValueError, LookupError, TypeError, AttributeError):
            jumps = _jumps(path)
            pulses = jumps[number]["pulses"]
            return int(pulses[len(pulses) // 2]["pulse"]) if len(jumps) > 1 else None
    return None


def latest(folder: Path) -> LastJump | None:
    """The last jump of the latest recording in a folder that was measured; None if there is none."""
    logs: dict[Path, int] = {}
    for beside in (jumper_path, measured_path):
        pattern = beside(Path("*.mcap")).name
        for path in folder.glob(pattern):
            log = path.with_name(f"{path.name.removesuffix(pattern[1:])}.mcap")
            with suppress(OSError):  # deleted meanwhile
                logs[log] = log.stat().st_mtime_ns
    known = (jumps_of(log) or summaries(log) for log in sorted(logs, key=lambda log: logs[log], reverse=True))
    return next((jumps[-1] for jumps in known if jumps), None)


def _read(path: Path) -> list[LastJump]:
    try:
        return [LastJump.model_validate(each) for each in _content(path)["summaries"]]
    except (OSError, ValueError, ValidationError, KeyError, TypeError):
        return []


def _results(log: Path) -> tuple[Path, Path]:
    return measured_path(log) / "jumper.json", jumper_path(log)


def _jumps(path: Path) -> dict[int, Any]:
    """Jumps by their numbers."""
    return {int(jump.get("number", order)): jump for order, jump in enumerate(_content(path)["jumps"], 1)}


def _content(path: Path) -> Any:
    return json.loads(read_whole(path, TEXT_MAX, links=False))
