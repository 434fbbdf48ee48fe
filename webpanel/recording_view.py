"""Recordings as the panel shows them, from what the catalogue knows."""

from datetime import UTC, datetime

from recorder.catalogue_entry import Entry, LogState
from rig.clocks import NS_PER_S
from rig.tag import TripletTag
from webpanel.models import (
    Causes,
    Counts,
    Level,
    Pulses,
    PulseSummary,
    Recording,
    RecordingState,
    SessionFields,
    Statement,
)

_STATES = {
    LogState.CLOSED: RecordingState.FINISHED,
    LogState.UNFINISHED: RecordingState.UNFINISHED,
    LogState.DAMAGED: RecordingState.DAMAGED,
}


def to_recording(entry: Entry) -> Recording:
    """One recording of the catalogue."""
    causes = Causes(**{status.value: count for status, count in entry.causes.items()})
    counts = Counts(pulses=entry.pulses, complete=entry.complete, partial=entry.partial, causes=causes)
    known = {name: text for name, text in entry.session.items() if name in SessionFields.model_fields}
    return Recording(
        id=entry.id,
        state=_STATES[entry.state],
        started=None if entry.started is None else datetime.fromtimestamp(entry.started / NS_PER_S, UTC),
        duration_s=round(entry.duration_s, 6),
        bytes=entry.bytes,
        counts=counts,
        session=SessionFields.model_construct(None, **known),  # an old log may hold what would be refused today
        verdict=verdict(entry),
        deleted=entry.deleted,
    )


def verdict(entry: Entry) -> Statement:
    """What a recording is good for, in a line; `values["failures"]` reads e.g. "K2 1 lost, 1 missed; K3 2 absent"."""
    level, code, text, advice = _judge(entry)
    values: dict[str, str | int | float] = {
        "pulses": entry.pulses, "complete": entry.complete, "partial": entry.partial, "missing": entry.missing,
        "failures": _failures(entry),
    }  # fmt: skip
    return Statement(level=level, code=f"verdict_{code}", text=text, advice=advice, values=values)


def _judge(entry: Entry) -> tuple[Level, str, str, str]:
    if entry.trouble:
        return Level.ERROR, "trouble", entry.trouble, ""
    if entry.state is LogState.DAMAGED:
        text = f"Parts cannot be read or are not there; {entry.pulses} pulses are readable"
        return Level.ERROR, "damaged", text, "Run svev verify on it"
    if entry.state is LogState.UNFINISHED:
        text, advice = f"Never closed; its {entry.pulses} pulses are readable", "svev recover makes a proper log of it"
        return Level.WARNING, "unfinished", text, advice
    if not entry.pulses:
        return Level.WARNING, "empty", "No pulse came", "Look at the trigger"
    if entry.partial:
        text = f"{entry.partial} of {entry.pulses} pulses lack a frame: {_failures(entry)}"
        return Level.WARNING, "partial", text, ""
    return Level.GOOD, "complete", f"Complete: all {entry.pulses} pulses", ""


def _failures(entry: Entry) -> str:
    cameras = (
        f"{name} " + ", ".join(f"{count} {status.value}" for status, count in causes.items())
        for name, causes in entry.failures.items()
    )
    return "; ".join(cameras)


def to_pulses(recording_id: str, tags: tuple[TripletTag, ...]) -> Pulses:
    """The pulses of a recording, from its tags."""
    if not tags:
        return Pulses(id=recording_id, cameras=(), columns=(), shape=(0, 0), pulses=())
    first = tags[0]
    return Pulses(
        id=recording_id,
        cameras=tuple(camera.name for camera in first.cameras),
        columns=tuple(camera.columns for camera in first.cameras),
        shape=first.shape,
        pulses=tuple(
            PulseSummary(
                pulse=tag.pulse,
                time_s=round((tag.time - first.time) / NS_PER_S, 6),
                statuses=tuple(camera.status for camera in tag.cameras),
            )
            for tag in tags
        ),
    )
