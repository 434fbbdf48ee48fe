"""Answers of the service as lines for people, for `svev ctl`, read as the models that the API describes."""

from collections.abc import Callable
from functools import partial
from typing import Any, Final, Literal

from pydantic import BaseModel, ValidationError

from rig.api.measuring import Measurement
from rig.api.recordings import NextJumper, Recording, Trash
from rig.api.start_list import StartList
from rig.api.statement import Statement
from rig.api.status import Status
from rig.errors import SvevError

Kind = Literal["status", "recording", "measurement", "next jumper", "start list", "trash", "removed"]


def lines_of(kind: Kind, answer: Any) -> list[str]:
    """An answer for people. Fields that this program does not know are passed over.

    Raises:
        SvevError: it is none of this kind: the service is of another version.
    """
    model, words = _KINDS[kind]
    try:
        return words(model.model_validate(answer, extra="ignore"))
    except ValidationError as error:
        first = error.errors()[0]
        what = f"{'.'.join(map(str, first['loc']))}: {first['msg']}"
        text = f"the service is of another version, and answers otherwise ({what}): call its own svev, or use --json"
        raise SvevError(text) from None


def _status(status: Status) -> list[str]:
    """State, cameras, disk, seconds held, recording in progress."""
    disk, measuring = status.disk, status.measuring
    lines = [f"{status.state:10} {_said(status.statement)}"]
    lines += [f"{camera.name:10} {_said(camera.statement)}" for camera in status.cameras]
    trash = f" and {disk.trash_gb:g} GB in the trash" if disk.trash_gb else ""
    left = f"{disk.jumps_left} jumps of {disk.jump_s:g} s left"
    lines.append(f"disk       {disk.free_gb:g} GB free{trash}, {left}")
    if status.preroll.seconds:
        lines.append(f"held       the last {status.preroll.seconds:.1f} s")
    if status.recording is not None:
        lines += [f"recording  {line}" for line in _recording(status.recording)]
    if measuring.recording is not None or measuring.waiting:
        now = f"{measuring.recording} ({measuring.state})" if measuring.recording else "nothing"
        lines.append(f"measuring  {now}, {measuring.waiting} waiting")
    return lines


def _recording(recording: Recording) -> list[str]:
    """Id, size, verdict, who, in one line."""
    who = " ".join(text for text in (recording.session.bib, recording.session.athlete) if text)
    size = f"{recording.duration_s:.1f} s, {recording.bytes / 1e6:.1f} MB"
    return [f"{recording.id}  {size:22} {_said(recording.verdict)}" + (f"  [{who}]" if who else "")]


def _measurement(found: Measurement) -> list[str]:
    """The state, then a line for each jump."""
    words = {"waiting": f"waiting, {found.before} before it", "none": "not measured"}
    state = words.get(found.state, found.state)
    lines = [f"{found.recording}: {state}" + ("" if found.problem is None else f": {found.problem.text}")]
    lines += [f"jump {jump.jump}: {jump.verdict}" for jump in found.figures]
    return lines + ([f"files: {', '.join(found.files)}"] if found.files else [])


def _next_jumper(jumper: NextJumper) -> list[str]:
    fields = jumper.session.model_dump() | jumper.more
    return ["  ".join(f"{name} {text}" for name, text in fields.items() if text) or "nobody in particular is next"]


def _start_list(found: StartList) -> list[str]:
    """The round, then one line for each jumper, the next one marked."""
    lines = [f"round {found.round}, {len(found.lines)} jumpers"]
    for line in found.lines:
        mark = "next" if line.id == found.next.line else line.mark
        fields = (line.athlete, line.club, f"gate {line.gate}" if line.gate else "", *line.more.values())
        lines.append(f"{mark:8} {line.bib:>4}  {', '.join(text for text in fields if text)}")
    return lines if found.next.line is not None else [*lines, "next:", *_next_jumper(found.next)]


def _trash(words: str, what: Trash) -> list[str]:
    return [f"{what.recordings} recordings {words}, {what.bytes / 1e9:.2f} GB"]


def _said(statement: Statement) -> str:
    return f"{statement.text} -> {statement.advice}" if statement.advice else statement.text


_KINDS: Final[dict[Kind, tuple[type[BaseModel], Callable[[Any], list[str]]]]] = {
    "status": (Status, _status),
    "recording": (Recording, _recording),
    "measurement": (Measurement, _measurement),
    "next jumper": (NextJumper, _next_jumper),
    "start list": (StartList, _start_list),
    "trash": (Trash, partial(_trash, "in the trash")),
    "removed": (Trash, partial(_trash, "removed for good")),
}
