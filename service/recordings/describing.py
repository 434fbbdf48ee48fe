"""Recordings as the panel shows them: fields, counts and continuations, and what became of each pulse."""

from collections.abc import Sequence

from recorder.catalogue.entry import Entry, LogState
from recorder.catalogue.folder import Catalogue
from recorder.log.extent import CONTINUES
from rig.api.recordings import Causes, Counts, Pulses, PulseSummary, Recording, RecordingState, SessionFields
from rig.api.statement import Level, Statement
from rig.clocks import NS_PER_S
from rig.errors import UnknownRecordingError
from rig.tag import TripletTag
from service.recordings.listing import more_of, utc
from service.recordings.verdicts import LONGEST_SHOWN, verdict

_STATES = {
    LogState.CLOSED: RecordingState.FINISHED,
    LogState.WRITING: RecordingState.RECORDING,
    LogState.UNFINISHED: RecordingState.UNFINISHED,
    LogState.DAMAGED: RecordingState.DAMAGED,
}


def as_recording(entry: Entry) -> Recording:
    """Describe an entry of the catalogue for the panel."""
    causes = Causes(**{status.value: count for status, count in entry.causes.items()})
    counts = Counts(pulses=entry.pulses, complete=entry.complete, partial=entry.partial, causes=causes)
    known = {name: text[:LONGEST_SHOWN] for name, text in entry.session.items() if name in SessionFields.model_fields}
    return Recording(
        id=entry.id,
        state=_STATES[entry.state],
        started=None if entry.started is None else utc(entry.started),
        duration_s=round(entry.duration_s, 6),
        bytes=entry.bytes,
        counts=counts,
        session=SessionFields.model_construct(None, **known),  # unchecked: old logs may hold what is refused today
        verdict=verdict(entry),
        deleted=entry.deleted,
        favourite=entry.favourite,
        tags=entry.tags,
        more=more_of(entry.session),
        continues=entry.session.get(CONTINUES, "")[:LONGEST_SHOWN],
        parts=entry.parts or (entry.id,),
    )


class Chain:
    """Which recordings go on with which; only the later log says what it continues.

    Args:
        catalogue: of the folder.
        entries: some of it, or some of its trash.
    """

    def __init__(self, catalogue: Catalogue, entries: Sequence[Entry]) -> None:
        self._catalogue = catalogue
        self._ids = {part for entry in entries for part in (entry.id, *entry.parts)}
        self._next = {entry.id: entry.next_part for entry in entries if entry.next_part}
        deleted = any(entry.deleted for entry in entries)
        parts = {entry.id: entry.parts or (entry.id,) for entry in entries}
        following = catalogue.following([part for each in parts.values() for part in each], deleted=deleted)
        self._following = {
            first: following[part] for first, each in parts.items() for part in each if part in following
        }

    def pointing_on(self, recording: Recording) -> Recording:
        """A recording with the id of the one that goes on with it; its verdict says if a part of it is gone."""
        if (by := self._following.get(recording.id)) is not None:
            recording = recording.model_copy(update={"continued_by": by})
        said = recording.verdict
        if recording.continues and not self._is_here(recording.continues):
            said = _without_part(
                recording,
                "verdict_part_gone",
                recording.continues,
                "Goes on from {}, which is not here: the beginning is missing",
                "Look for the first part on the other disk, or in a copy",
            )
        elif (after := self._next.get(recording.id, "")) and not self._is_here(after):
            said = _without_part(
                recording,
                "verdict_next_part_gone",
                after,
                "Goes on in {}, which is not here: the end is missing",
                "Look for that part in the trash, or in a copy",
            )
        return recording if said is recording.verdict else recording.model_copy(update={"verdict": said})

    def _is_here(self, part: str) -> bool:
        """Whether a part lies in the folder or in its trash."""
        if part in self._ids:
            return True
        try:
            self._catalogue.entry(part)
        except UnknownRecordingError:
            return False
        return True


def _without_part(recording: Recording, code: str, part: str, text: str, advice: str) -> Statement:
    """The verdict on a recording of which a part is gone, unless something graver is said of it."""
    told = recording.verdict
    if told.level is Level.ERROR:
        return told
    return Statement(
        level=Level.WARNING,
        code=code,
        text=f"{text.format(part)}. {told.text}",
        advice=advice,
        values={"before": part, "rest": told.said},
    )


def as_pulses(recording_id: str, tags: tuple[TripletTag, ...]) -> Pulses:
    """Summarize the tags of a recording for the panel."""
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
