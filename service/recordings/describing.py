"""Recordings as the panel shows them: fields and counts, which goes on with which, what became of each pulse."""

from collections.abc import Sequence
from typing import Any

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
    )


class Chain:
    """Which recordings go on with which; only the later log says what it continues.

    Args:
        catalogue: of the folder.
        entries: some of it, or some of its trash.
    """

    def __init__(self, catalogue: Catalogue, entries: Sequence[Entry]) -> None:
        self._catalogue = catalogue
        self._ids = {entry.id for entry in entries}
        deleted = any(entry.deleted for entry in entries)
        self._following = catalogue.following([entry.id for entry in entries], deleted=deleted)

    def pointing_on(self, recording: Recording) -> Recording:
        """A recording with the id of its next part, if it has one; its verdict says if the part before is gone."""
        update: dict[str, Any] = {}
        if (by := self._following.get(recording.id)) is not None:
            update["continued_by"] = by
        if self._lacks_part_before(recording):
            update["verdict"] = _without_part_before(recording)
        return recording.model_copy(update=update) if update else recording

    def _lacks_part_before(self, recording: Recording) -> bool:
        """Whether the part before lies neither in the folder nor in its trash."""
        if not recording.continues or recording.continues in self._ids:
            return False
        try:
            self._catalogue.entry(recording.continues)
        except UnknownRecordingError:
            return True
        return False


def _without_part_before(recording: Recording) -> Statement:
    """The verdict on a recording whose part before is gone, unless something graver is said of it."""
    told = recording.verdict
    if told.level is Level.ERROR:
        return told
    return Statement(
        level=Level.WARNING,
        code="verdict_part_gone",
        text=f"Goes on from {recording.continues}, which is not here: the beginning is missing. {told.text}",
        advice="Look for the first part on the other disk, or in a copy",
        values={"before": recording.continues, "rest": told.said},
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
