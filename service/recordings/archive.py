"""Reads the recordings in the service's folder and describes them for the panel, each with its verdict."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analysis.images.activity import busiest_pulse, liveliest_pulse
from analysis.result.naming import bears_names
from recorder.catalogue.entry import Entry, LogState, Trouble
from recorder.catalogue.folder import Catalogue
from recorder.catalogue.trash import TrashContents
from recorder.log.extent import CONTINUES
from rig.api.athletes import Athlete, AthleteJump, JumpQuery, folded
from rig.api.comparison import Comparison, Span
from rig.api.export import ExportJob, ExportOrder
from rig.api.looking import Moment, MomentKind, Note, VoiceNote
from rig.api.measuring import Measurement
from rig.api.recordings import (
    Causes,
    Counts,
    Pulses,
    PulseSummary,
    Recording,
    RecordingQuery,
    RecordingState,
    SessionFields,
    Trash,
)
from rig.api.statement import Level, Statement
from rig.api.status import Status
from rig.clocks import NS_PER_S
from rig.errors import BadInputError, StateForbidsError, StillRecordingError, UnknownRecordingError
from rig.phrase import Phrase, Value
from rig.pulse import Pause
from rig.tag import TripletTag
from service.comparing.asking import Comparisons
from service.exports.jobs import Exports
from service.measuring.queue import Measurings
from service.measuring.results import is_outdated, jumps_in_full, result_downloads, result_file
from service.recordings import live_results
from service.recordings.digitized import digitized_downloads
from service.recordings.download import download_of, file_name, sha256_of, zipped, zipped_size
from service.recordings.listing import find, is_favourite, more_of, tags_of, utc
from service.recordings.measured_jumps import MeasuredJumps, athletes, wanted
from service.recordings.notes import check_voices, noted, notes_of, spoken, voice_file
from service.seam.archive import Download, FoundRecordings
from triggering.ledger.account import pauses_in_words

_STATES = {
    LogState.CLOSED: RecordingState.FINISHED,
    LogState.WRITING: RecordingState.RECORDING,
    LogState.UNFINISHED: RecordingState.UNFINISHED,
    LogState.DAMAGED: RecordingState.DAMAGED,
}

#: How the trouble with a file is said; its text ends in what to do.
_TROUBLES: Final = {
    Trouble.HEADLESS: (Level.ERROR, "headless", ""),
    Trouble.LINK: (Level.ERROR, "link", ""),
    Trouble.NO_FILE: (Level.ERROR, "no_file", ""),
    Trouble.SESSION: (Level.ERROR, "session", ""),
    Trouble.UNREADABLE: (Level.ERROR, "trouble", ""),
    Trouble.NONE: (Level.ERROR, "trouble", ""),
}
#: Verdicts on how a recording ended, which are followed by one on its pulses.
_ENDS: Final = frozenset({"disk_full", "ended_early", "forgotten"})
_ALL: Final = RecordingQuery()
#: Reasons for the end of a log that mean that there was no room for more.
_FULL: Final = frozenset({"disk_full", "disk_quota", "why_disk_reserve"})
#: Reasons that stand behind the path of the log itself.
_BEHIND_PATH: Final = frozenset({"why_disk_refuses", "why_reserve_reached"})
#: What a list repeats of a session field, however long the log has it.
_LONGEST_SHOWN: Final = 4000


class Archive(ABC):
    """The reading part of `service.seam.rig.RigService`: all recordings of the folder, with the one in progress.

    Attributes:
        exports: what is being exported, and what has been.

    Args:
        catalogue: of the folder.
        exports: of the same recordings.
        measurings: likewise.
    """

    def __init__(self, catalogue: Catalogue, exports: Exports, measurings: Measurings) -> None:
        self._catalogue, self.exports, self._measurings = catalogue, exports, measurings
        self._checksums: dict[str, str] = {}
        self._descriptions: dict[tuple[str, bool], tuple[Entry, Recording]] = {}
        self._jumps = MeasuredJumps(catalogue.directory)
        self._comparisons = Comparisons(catalogue.directory, lambda: self.status().recording is not None)

    @abstractmethod
    def status(self) -> Status:
        """The present status, which has the recording in progress."""

    def recordings(self, query: RecordingQuery = _ALL) -> FoundRecordings:
        """The recordings that a query finds, the one in progress among them."""
        current = self.status().recording
        entries = self._catalogue.entries(deleted=query.deleted)
        found = find(entries, query, lambda entry: self._described(entry).verdict.level)
        chain = _Chain(self._catalogue, entries)
        shown = [chain.pointing_on(self._described(entry)) for entry in found.entries]
        return FoundRecordings(found.total, [current if current and each.id == current.id else each for each in shown])

    def recording(self, recording_id: str) -> Recording:
        """One recording, in the trash or not."""
        current = self.status().recording
        if current and current.id == recording_id:
            return current
        return self._with_next_part(self._catalogue.entry(recording_id))

    def _with_next_part(self, entry: Entry) -> Recording:
        """Describe an entry, with the id of the recording that goes on with it."""
        chain = _Chain(self._catalogue, self._catalogue.entries(deleted=entry.deleted))
        return chain.pointing_on(as_recording(entry))

    def _described(self, entry: Entry) -> Recording:
        """Describe an entry for the panel, unless that was done before: the catalogue gives the same object then."""
        known = self._descriptions.get((entry.id, entry.deleted))
        if known is None or known[0] is not entry:
            known = self._descriptions[entry.id, entry.deleted] = entry, as_recording(entry)
        return known[1]

    def trash(self) -> Trash:
        """How much lies in the trash."""
        return _as_trash(self._catalogue.trash())

    def empty_trash(self) -> Trash:
        """Remove everything in the trash for good."""
        return _as_trash(self._catalogue.purge())

    def remove_recording(self, recording_id: str) -> Trash:
        """Remove one recording of the trash for good.

        Raises:
            StateForbidsError: it does not lie in the trash.
        """
        if not self._catalogue.entry(recording_id, prefer_deleted=True).deleted:
            raise StateForbidsError(f"recording {recording_id} is not in the trash: delete it first")
        return _as_trash(self._catalogue.remove(recording_id))

    def download(self, recording_id: str) -> Download:
        """A recording that has ended, as a file with its corrected session.

        Raises:
            StillRecordingError: it has not.
            BadInputError: the file may not be read, or is no regular file.
        """
        self._check_ended(recording_id)
        return download_of(self._catalogue.entry(recording_id), self._catalogue.file(recording_id))

    def start_export(self, recording_id: str, order: ExportOrder) -> ExportJob:
        """Ask for an export of a recording that has ended.

        Raises:
            StillRecordingError: it has not.
            StorageError: there is not room enough.
        """
        self._check_ended(recording_id)
        entry, log = self._catalogue.entry(recording_id), self._catalogue.file(recording_id)
        return self.exports.start(recording_id, log, file_name(recording_id, entry.session, ""), order)

    def measurement(self, recording_id: str, *, jumps: bool) -> Measurement:
        """What is known of the jumps of a recording: of the whole log, otherwise what was measured live.

        Args:
            recording_id: its id.
            jumps: with the jumps in full, pulse by pulse; they are of the whole log, never live.
        """
        log = self._catalogue.file(recording_id)
        known = self._measurings.measurement(recording_id, log)
        if jumps:
            known = known.model_copy(update={"jumps": jumps_in_full(log)})
        if known.figures or not (live := live_results.summaries(log)):
            return known
        return known.model_copy(update={"figures": tuple(live), "live": True})

    def athletes(self) -> list[Athlete]:
        """Whose jumps were measured, by name."""
        return athletes(self._jumps.of(self._catalogue.entries()))

    def measured_jumps(self, query: JumpQuery) -> list[AthleteJump]:
        """The measured jumps that a query finds, newest first; none that lies in the trash."""
        return wanted(self._jumps.of(self._catalogue.entries()), query)

    def compare_spans(self, athlete: str, first: Span, second: Span) -> Comparison:
        """Whether an athlete's jumps of two spans of time differ by more than chance.

        Raises:
            StateForbidsError: a recording runs.
            BadInputError: the spans overlap, one has no jump that was measured well, or they cannot be compared.
        """
        return self._comparisons.spans(self.measured_jumps(JumpQuery.model_construct(athlete=athlete)), first, second)

    def comparison_page(self, first: tuple[str, int], second: tuple[str, int], language: str) -> str:
        """The page that compares two measured jumps, each given by recording and number.

        Raises:
            UnknownRecordingError: there is no such measured jump.
            StateForbidsError: a recording runs.
            BadInputError: it is one and the same, or they cannot be compared.
        """
        if first == second:
            raise BadInputError("this is one jump: choose another one to compare it with")
        known = self.measured_jumps(JumpQuery())
        by_id = {(each.jump.recording, each.jump.jump): each for each in known}
        if missing := [jump for jump in (first, second) if jump not in by_id]:
            raise UnknownRecordingError(f"recording {missing[0][0][:100]!r} has no measured jump {missing[0][1]}")
        shown = [by_id[first], by_id[second]]
        names = {folded(each.athlete) for each in shown}
        others = [each for each in known if {folded(each.athlete)} == names and each not in shown] if all(names) else []
        return self._comparisons.page(shown, others, language)

    def measure(self, recording_id: str) -> Measurement:
        """Have the log of a recording measured, again if it was measured before.

        Raises:
            StateForbidsError: it lies in the trash, or the rig file does not say where the balls are.
        """
        if self._catalogue.entry(recording_id).deleted:
            raise StateForbidsError(f"recording {recording_id} is in the trash: restore it, then measure it")
        return self._measurings.want(recording_id, self._catalogue.file(recording_id))

    def give_up_measuring(self, recording_id: str) -> Measurement:
        """Do not measure a recording that waits for it, or is being measured; an earlier result stays."""
        self._measurings.give_up(recording_id, self._catalogue.file(recording_id))
        return self.measurement(recording_id, jumps=False)

    def measured_file(self, recording_id: str, name: str) -> Path:
        """A file of the result.

        Raises:
            UnknownRecordingError: there is none of this name.
            StateForbidsError: it says a name that was corrected since.
        """
        log = self._catalogue.file(recording_id)
        file = result_file(log, name)
        if file is None:
            raise UnknownRecordingError(f"recording {recording_id} has no result {name[:100]!r}: measure it")
        if bears_names(name) and is_outdated(log):
            raise StateForbidsError(f"{name} of {recording_id} gets the corrected name: try again in a moment")
        return file

    def _check_ended(self, recording_id: str) -> None:
        current = self.status().recording
        here = current is not None and current.id == recording_id
        if here or self._catalogue.entry(recording_id).state is LogState.WRITING:
            raise StillRecordingError(f"recording {recording_id} is still being written: stop it first")

    def checksum(self, recording_id: str, wanted: Callable[[], bool]) -> str:
        """SHA-256 of that file, in hexadecimal.

        Raises:
            StateForbidsError: it is not `wanted` any more.
        """
        download = self.download(recording_id)
        known = self.known_checksum(download)
        if not known:
            known = self._checksums[download.tag] = sha256_of(download, wanted)
        return known

    def known_checksum(self, download: Download) -> str:
        """SHA-256 of a file if it was asked for before, otherwise empty."""
        return self._checksums.get(download.tag, "")

    def zipped(self, recording_ids: Sequence[str]) -> tuple[int, Iterator[bytes]]:
        """Several recordings and what belongs to them as one archive: its size, and its bytes piece by piece."""
        downloads: list[Download] = []
        for recording_id in dict.fromkeys(recording_ids):
            file = self.download(recording_id)
            log = self._catalogue.file(recording_id)
            downloads += [file, *result_downloads(log, file.name), *digitized_downloads(log, file.name)]
            downloads += [self.voice_file(recording_id, note.number) for note in self.voice_notes(recording_id)]
        return zipped_size(downloads), zipped(downloads)

    def pulses(self, recording_id: str) -> Pulses:
        """What became of each pulse of a recording."""
        return _as_pulses(recording_id, self._catalogue.tags(recording_id))

    def image(self, recording_id: str, pulse: int) -> NDArray[np.uint8]:
        """One triplet of a recording, uint8, (rows, columns), or blue, green, red, (rows, columns, 3)."""
        return self._catalogue.image(recording_id, pulse)

    def liveliest_pulse(self, recording_id: str) -> int:
        """The pulse to show a recording by: the middle of the stretch in which most moves."""
        return liveliest_pulse(self._catalogue.file(recording_id))

    def moment(self, recording_id: str, *, jump: int = 1, by_motion: bool = False) -> Moment:
        """The pulse at which to open a recording: the take-off if the jump was measured, otherwise where most moves.

        Args:
            recording_id: id of the recording.
            jump: number of its jump.
            by_motion: where most moves, in any case: to be compared with a recording that was not measured. Of several
                measured jumps it is the middle of the pulses that show this one.
        """
        log = self._catalogue.file(recording_id)
        if not by_motion and (exact := live_results.takeoff_pulse(log, jump)) is not None:
            whole = result_file(log, "jumper.json") is not None
            return Moment(pulse=round(exact), kind=MomentKind.TAKEOFF, exact=exact, from_log=whole)
        pulse = live_results.middle_pulse(log, jump)
        pulse = busiest_pulse(log) if pulse is None else pulse
        return Moment(pulse=pulse, kind=MomentKind.NONE if pulse is None else MomentKind.ACTIVITY)

    def notes(self, recording_id: str) -> list[Note]:
        """The notes at single pulses, in order."""
        return notes_of(self._catalogue.entry(recording_id).session)

    def note(self, recording_id: str, pulse: int, text: str) -> list[Note]:
        """Set the note of a pulse; no text: remove it.

        Raises:
            StateForbidsError: there are too many.
        """
        session = self._catalogue.entry(recording_id).session
        if changes := noted(session, pulse, text):
            session = self._catalogue.change_session(recording_id, changes).session
        return notes_of(session)

    def voice_notes(self, recording_id: str) -> list[VoiceNote]:
        """The spoken notes, in the order in which they were spoken."""
        return spoken(self._catalogue.voice_notes(recording_id))

    def voice_file(self, recording_id: str, number: int) -> Download:
        """A spoken note as a file.

        Raises:
            UnknownRecordingError: there is none of this number.
        """
        stored, entry = self._catalogue.voice_notes(recording_id), self._catalogue.entry(recording_id)
        return voice_file(stored, number, file_name(recording_id, entry.session, ""))

    def add_voice_note(self, recording_id: str, pulse: int, data: bytes) -> list[VoiceNote]:
        """Keep a spoken note (WebM) about a pulse.

        Raises:
            BadInputError: it is no WebM file.
            StateForbidsError: there are too many.
        """
        check_voices(self._catalogue.voice_notes(recording_id))
        self._catalogue.add_voice_note(recording_id, pulse, data)
        return self.voice_notes(recording_id)

    def remove_voice_note(self, recording_id: str, number: int) -> list[VoiceNote]:
        """Remove a spoken note for good; if there is none of this number, nothing changes."""
        self._catalogue.remove_voice_note(recording_id, number)
        return self.voice_notes(recording_id)


def as_recording(entry: Entry) -> Recording:
    """Describe an entry of the catalogue for the panel."""
    causes = Causes(**{status.value: count for status, count in entry.causes.items()})
    counts = Counts(pulses=entry.pulses, complete=entry.complete, partial=entry.partial, causes=causes)
    known = {name: text[:_LONGEST_SHOWN] for name, text in entry.session.items() if name in SessionFields.model_fields}
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
        favourite=is_favourite(entry),
        tags=tags_of(entry),
        more=more_of(entry.session),
        continues=entry.session.get(CONTINUES, "")[:_LONGEST_SHOWN],
    )


class _Chain:
    """Which recordings go on with which; only the later log says what it continues.

    Args:
        catalogue: of the folder.
        entries: those of it, or those of its trash.
    """

    def __init__(self, catalogue: Catalogue, entries: Sequence[Entry]) -> None:
        self._catalogue = catalogue
        self._ids = {entry.id for entry in entries}
        self._following = {entry.session[CONTINUES]: entry.id for entry in entries if CONTINUES in entry.session}

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


def _as_trash(contents: TrashContents) -> Trash:
    return Trash(recordings=contents.recordings, bytes=contents.bytes)


def verdict(entry: Entry) -> Statement:
    """Say in one line what a recording is good for.

    `values["failures"]` reads e.g. "K2 1 lost, 1 missed; K3 2 absent", `values["rest"]` says of a recording that ended
    by itself what it is good for until then.
    """
    level, code, text, advice = _judge(entry)
    values = _values(entry)
    if code in _ENDS:
        _, rest, words, _ = _judge_account(entry)
        values["rest"] = Phrase(f"verdict_{rest}", words, dict(values))
    return Statement(level=level, code=f"verdict_{code}", text=text, advice=advice, values=values)


def _values(entry: Entry) -> dict[str, Value]:
    return {
        "pulses": entry.pulses, "complete": entry.complete, "partial": entry.partial, "missing": entry.missing,
        "failures": _failures(entry), "pauses": len(entry.pauses),
        "paused_s": round(sum(pause.seconds for pause in entry.pauses), 1), "disk": entry.disk,
        "longest_s": entry.forgotten_s, "why": _reason(entry.ended_early),
        "before": entry.session.get(CONTINUES, "")[:_LONGEST_SHOWN],
        "unrecorded": sum(pause.pulses for pause in entry.pauses if pause.between_logs),
    }  # fmt: skip


def _reason(said: Phrase) -> Phrase:
    """Why a log ended early, without its own path."""
    why = said.values.get("why")
    return why if said.code in _BEHIND_PATH and isinstance(why, Phrase) else said


def _judge(entry: Entry) -> tuple[Level, str, str, str]:
    if entry.trouble:
        level, code, advice = _TROUBLES[entry.kind]
        return level, code, entry.trouble, advice
    if entry.state is LogState.DAMAGED:
        text = f"Parts cannot be read or are not there; {entry.pulses} pulses are readable"
        advice = "svev recover makes a proper log of what can be read; svev verify says what is damaged"
        return Level.ERROR, "damaged", text, advice
    if entry.state is LogState.WRITING:
        return Level.INFO, "being_written", f"Another svev is recording it: {entry.pulses} pulses until now", ""
    if entry.state is LogState.UNFINISHED:
        text, advice = f"Never closed; its {entry.pulses} pulses are readable", "svev recover makes a proper log of it"
        return Level.WARNING, "unfinished", text, advice
    return _judge_end(entry)


def _judge_end(entry: Entry) -> tuple[Level, str, str, str]:
    """Judge a sound log: by how it ended, and by its pulses."""
    if not entry.pulses and not entry.ended_early.text:
        return Level.WARNING, "empty", "No pulse came", "Look at the trigger"
    level, code, text, advice = _judge_account(entry)
    if (why := _reason(entry.ended_early)).code in _FULL:
        text = f"The disk was full, and the recording ended early. {text}"
        return Level.WARNING, "disk_full", text, "Delete recordings and empty the trash, or record to another disk"
    if why.text:
        return Level.WARNING, "ended_early", f"Ended early: {why.text[:_LONGEST_SHOWN]}. {text}", advice
    if entry.forgotten_s:
        text = f"Ended by itself after {entry.forgotten_s:g} s, because nobody had stopped it. {text}"
        return Level.WARNING, "forgotten", text, advice
    return level, code, text, advice


def _judge_account(entry: Entry) -> tuple[Level, str, str, str]:
    if (before := entry.session.get(CONTINUES, "")) and (gap := _between_logs(entry)) is not None:
        text = f"Goes on from {before[:_LONGEST_SHOWN]}: {gap.pulses} pulses are in neither, {gap.seconds:.1f} s"
        text += f"; of its {entry.pulses} pulses {entry.partial} lack a frame"
        return Level.WARNING, "continued", text, "Look at both parts; svev verify says what is missing"
    lacking = f"{entry.partial} of {entry.pulses} pulses lack a frame: {_failures(entry)}"
    if entry.pauses:
        paused = pauses_in_words(entry.pauses)
        advice = "Look at the trigger, and at the cameras' events of that time: svev verify says when"
        if entry.partial:
            return Level.WARNING, "partial_paused", f"{lacking}; {paused}", advice
        return Level.WARNING, "paused", f"{entry.pulses} pulses, all complete, but {paused}", advice
    if entry.partial and entry.disk.text:
        return Level.WARNING, "partial_disk", lacking, entry.disk.text
    if entry.partial:
        return Level.WARNING, "partial", lacking, ""
    return Level.GOOD, "complete", f"Complete: all {entry.pulses} pulses", ""


def _between_logs(entry: Entry) -> Pause | None:
    """The pulses that neither this log has nor the one that it continues, if there are no other pauses."""
    gaps = [pause for pause in entry.pauses if pause.between_logs]
    return gaps[0] if len(gaps) == len(entry.pauses) == 1 else None


def _failures(entry: Entry) -> str:
    cameras = (
        f"{name} " + ", ".join(f"{count} {status.value}" for status, count in causes.items())
        for name, causes in entry.failures.items()
    )
    return "; ".join(cameras)


def _as_pulses(recording_id: str, tags: tuple[TripletTag, ...]) -> Pulses:
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
