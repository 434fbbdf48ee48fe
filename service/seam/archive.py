"""The part of the seam that is about recordings which exist: found, corrected, looked at, taken away."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Protocol

import numpy as np
from numpy.typing import NDArray

from rig.api.athletes import Athlete, AthleteJump, JumpQuery
from rig.api.comparison import Comparison, Span
from rig.api.export import ExportJob
from rig.api.looking import Moment, Note, VoiceNote
from rig.api.measuring import Measurement
from rig.api.recordings import Pulses, Recording, RecordingQuery, SessionChange, Trash


@dataclass(frozen=True, slots=True)
class Download:
    """A recording as a file to take away.

    Attributes:
        name: of the file; it says who jumped.
        size: bytes.
        modified: when the recording was last written, UNIX time, s.
        tag: another one whenever the file's bytes are others.
        corrected: the session in it differs from that of the log: it was changed after the recording.
        open: opens it.
    """

    name: str
    size: int
    modified: float
    tag: str
    corrected: bool
    open: Callable[[], BinaryIO]


@dataclass(frozen=True, slots=True)
class FoundRecordings:
    """What a query finds.

    Attributes:
        total: how many recordings fit, on all pages.
        recordings: those of the page that was asked for, in its order.
    """

    total: int
    recordings: list[Recording]


class Archive(Protocol):
    """All recordings of the folder, with the one in progress. Any thread may call any method.

    Raises (each where it applies):
        UnknownRecordingError: there is no recording of this id.
        StateForbidsError: the present state of the recording forbids the call.
        SvevError: the call failed; the message says what to do.
    """

    def change_session(self, recording_id: str, change: SessionChange) -> Recording:
        """Change session fields of a recording, also of the one in progress."""
        ...

    def delete_recording(self, recording_id: str) -> Recording:
        """Put a recording into the trash; not the one in progress. If it is there already, nothing changes."""
        ...

    def restore_recording(self, recording_id: str) -> Recording:
        """Take a recording out of the trash. If it is not there, nothing changes."""
        ...

    def trash(self) -> Trash:
        """How much lies in the trash."""
        ...

    def empty_trash(self) -> Trash:
        """Remove everything in the trash for good; returns what was removed."""
        ...

    def remove_recording(self, recording_id: str) -> Trash:
        """Remove a recording of the trash for good. StateForbidsError: it does not lie there."""
        ...

    def recordings(self, query: RecordingQuery) -> FoundRecordings:
        """The recordings that a query finds, with the one in progress."""
        ...

    def recording(self, recording_id: str) -> Recording:
        """One recording, in the trash or not."""
        ...

    def download(self, recording_id: str) -> Download:
        """A recording as a file, with its session as it was corrected. StateForbidsError: it is still being written."""
        ...

    def checksum(self, recording_id: str, wanted: Callable[[], bool]) -> str:
        """SHA-256 of that file, in hexadecimal; reads all of it while it is `wanted`, unless it was asked before."""
        ...

    def known_checksum(self, download: Download) -> str:
        """SHA-256 of a file if it was asked for before, otherwise empty."""
        ...

    def zipped(self, recording_ids: Sequence[str]) -> tuple[int, Iterator[bytes]]:
        """Several recordings as one archive (ZIP): its size in bytes, and they piece by piece. Errors come at once."""
        ...

    def pulses(self, recording_id: str) -> Pulses:
        """What became of each pulse of a recording."""
        ...

    def image(self, recording_id: str, pulse: int) -> NDArray[np.uint8]:
        """One triplet of a recording to look at, uint8, (rows, columns) or (rows, columns, 3); the caller owns it."""
        ...

    def liveliest_pulse(self, recording_id: str) -> int:
        """The pulse to show a recording by: the middle of the stretch in which most moves."""
        ...

    def moment(self, recording_id: str, *, jump: int = 1, by_motion: bool = False) -> Moment:
        """The pulse at which to open a jump; `by_motion`: where most moves, even if its take-off was measured."""
        ...

    def measurement(self, recording_id: str, *, jumps: bool) -> Measurement:
        """The measured jumps of a recording, with all figures if `jumps`, and the progress of its measuring."""
        ...

    def athletes(self) -> list[Athlete]:
        """Whose jumps were measured, by name."""
        ...

    def measured_jumps(self, query: JumpQuery) -> list[AthleteJump]:
        """The measured jumps that a query finds, newest first; none that lies in the trash."""
        ...

    def compare_spans(self, athlete: str, first: Span, second: Span) -> Comparison:
        """Whether an athlete's jumps of two spans differ by more than chance. StateForbidsError: a recording runs."""
        ...

    def comparison_page(self, first: tuple[str, int], second: tuple[str, int], language: str) -> str:
        """The page that compares two measured jumps, each given by recording and number."""
        ...

    def measure(self, recording_id: str) -> Measurement:
        """Have a recording measured, again if it was. StateForbidsError: it is deleted, or nobody says by what."""
        ...

    def give_up_measuring(self, recording_id: str) -> Measurement:
        """Do not measure a recording that waits for it, or is being measured; an earlier result stays."""
        ...

    def measured_file(self, recording_id: str, name: str) -> Path:
        """A file of the result. UnknownRecordingError: none has this name. StateForbidsError: it says an old name."""
        ...

    def notes(self, recording_id: str) -> list[Note]:
        """The notes at single pulses, in order."""
        ...

    def note(self, recording_id: str, pulse: int, text: str) -> list[Note]:
        """Set the note of a pulse; no text: remove it. StateForbidsError: there are too many."""
        ...

    def voice_notes(self, recording_id: str) -> list[VoiceNote]:
        """The spoken notes, in the order in which they were spoken."""
        ...

    def voice_file(self, recording_id: str, number: int) -> Download:
        """A spoken note as a file. UnknownRecordingError: there is none of this number."""
        ...

    def add_voice_note(self, recording_id: str, pulse: int, data: bytes) -> list[VoiceNote]:
        """Keep a spoken note (WebM) about a pulse. StateForbidsError: there are too many."""
        ...

    def remove_voice_note(self, recording_id: str, number: int) -> list[VoiceNote]:
        """Remove a spoken note for good; if there is none of this number, nothing changes."""
        ...


class Exports(Protocol):
    """Exports of recordings: one is made after the other, and none while a recording runs.

    Raises (each where it applies):
        UnknownExportError: there is none of this id.
        StateForbidsError: it is not done.
    """

    def jobs(self) -> list[ExportJob]:
        """All that are kept, newest first."""
        ...

    def job(self, job_id: str) -> ExportJob:
        """One of them."""
        ...

    def file(self, job_id: str) -> Path:
        """The file of a finished export."""
        ...

    def remove(self, job_id: str) -> ExportJob:
        """Remove an export and its file; an unfinished one is cancelled."""
        ...
