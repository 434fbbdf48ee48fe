"""The seam between panel and service: what the panel may call, and the errors by which the service refuses."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal, Protocol

import numpy as np
from numpy.typing import NDArray
from prometheus_client.metrics_core import Metric

from rig.api.aids import CameraAids
from rig.api.automatic import AutomaticChange, Mark, Marked
from rig.api.balls import CameraBalls
from rig.api.export import ExportJob, ExportOrder
from rig.api.light import CameraLight, LightChange
from rig.api.looking import Moment, Note, VoiceNote
from rig.api.recordings import Pulses, Recording, RecordingOrder, RecordingQuery, SessionChange, StopOrder, Trash
from rig.api.rehearsal import RehearsalOrder, Rehearsals
from rig.api.start_list import JumperChange, LineChange, NewLine, Rules, StartList, Turn, UndoOrder
from rig.api.status import ArmOrder, DoctorReport, Event, RigView, Status
from rig.api.trigger import BurstOrder, TriggerChange, TriggerView
from rig.frame import FrameStatus
from rig.phrase import Phrase
from rig.pulse import RigPulse


@dataclass(frozen=True, slots=True)
class Preview:
    """The newest triplet, for the live view.

    Attributes:
        pulse: number of its pulse since the recorder was started.
        pixels: (rows, columns), uint8, or blue, green, red, (rows, columns, 3); the caller owns it.
        columns: first and one past the last column by camera.
        statuses: what became of the pulse, by camera.
    """

    pulse: RigPulse
    pixels: NDArray[np.uint8]
    columns: tuple[tuple[int, int], ...]
    statuses: tuple[FrameStatus, ...]


@dataclass(frozen=True, slots=True)
class CloseUp:
    """The newest frame of one camera, for setting it up.

    Attributes:
        pulse: number of its pulse since the recorder was started.
        status: what became of the frame.
        pixels: (rows, columns), uint8, or blue, green, red, (rows, columns, 3); the caller owns it.
        sharp: where it is in focus, (rows, columns); None: nobody asked.
    """

    pulse: RigPulse
    status: FrameStatus
    pixels: NDArray[np.uint8]
    sharp: NDArray[np.bool_] | None


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


class Jumpers(Protocol):
    """The start list and the next jumper, one for all. Any thread may call any method; each gives the list then.

    Raises (each where it applies):
        UnknownLineError: the start list has no such line.
        ChangedMeanwhileError: the call is about another state of the list than the present one.
        StateForbidsError: the list as it is forbids the call.
        BadInputError: a table cannot be read; the message names line and column.
    """

    def view(self) -> StartList:
        """The list as it is now."""
        ...

    def change_next(self, change: JumperChange) -> StartList:
        """Change session fields of the next jumper."""
        ...

    def skip(self, turn: Turn) -> StartList:
        """Pass over the next jumper; if another one is next by now, nothing changes."""
        ...

    def choose(self, line: int) -> StartList:
        """Make the jumper of a line the next one."""
        ...

    def add(self, new: NewLine) -> StartList:
        """Add a line at the end."""
        ...

    def change_line(self, line: int, change: LineChange) -> StartList:
        """Change a line, or move it."""
        ...

    def remove(self, line: int) -> StartList:
        """Remove a line."""
        ...

    def import_table(self, content: bytes) -> StartList:
        """Replace the list by a table of comma-separated values; an empty one clears it."""
        ...

    def change_rules(self, rules: Rules) -> StartList:
        """Change what happens from one jumper to the next."""
        ...

    def begin_round(self) -> StartList:
        """Have everybody wait again, from the top of the list."""
        ...

    def undo(self, order: UndoOrder) -> StartList:
        """Take the last change back."""
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
        """The file of one that is done."""
        ...

    def remove(self, job_id: str) -> ExportJob:
        """Remove one and its file; one that is not done is given up."""
        ...


class RigService(Protocol):
    """The running service. Any thread may call any method; none waits without a deadline.

    Raises (each where it applies):
        StateForbidsError: the present state forbids the call.
        UnknownRecordingError: there is no recording of this id.
        SvevError: the call failed; the message says what to do.
    """

    def status(self) -> Status:
        """The present status; cheap."""
        ...

    def arm(self, order: ArmOrder) -> Status:
        """Begin to arm; a rehearsal that runs is ended first.

        While arming only `min_cameras` counts, while armed nothing; disarming: StateForbidsError.
        """
        ...

    def rehearsals(self) -> Rehearsals:
        """The rehearsal that runs, and what the last one showed."""
        ...

    def rehearse(self, order: RehearsalOrder) -> Rehearsals:
        """Begin a rehearsal; if one runs, nothing changes. StateForbidsError: the rig is not idle, or is examined."""
        ...

    def end_rehearsal(self) -> Rehearsals:
        """End the rehearsal that runs, without a verdict; returns when the cameras are free."""
        ...

    def disarm(self) -> Status:
        """Begin to disarm. While disarming or idle, nothing changes; while recording, StateForbidsError."""
        ...

    def start_recording(self, order: RecordingOrder) -> Recording:
        """Start a recording of the next jumper; returns when its log is open. Only while armed."""
        ...

    def mark(self, mark: Mark) -> Marked:
        """Begin a recording that reaches back to before a mark, or note the mark in the one that runs."""
        ...

    def change_automatic(self, change: AutomaticChange) -> Status:
        """Let motion begin recordings, or not. StateForbidsError: nothing is watched for motion."""
        ...

    def stop_recording(self, recording_id: str, order: StopOrder) -> Recording:
        """Stop a recording; returns when its log is closed. A finished recording is returned unchanged."""
        ...

    @property
    def jumpers(self) -> Jumpers:
        """The start list and the next jumper."""
        ...

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

    @property
    def exports(self) -> Exports:
        """What is being exported, and what has been."""
        ...

    def start_export(self, recording_id: str, order: ExportOrder) -> ExportJob:
        """Ask for an export. StateForbidsError: the recording is still being written; StorageError: no room."""
        ...

    def checksum(self, recording_id: str) -> str:
        """SHA-256 of that file, in hexadecimal; reads all of it, unless it was asked for before."""
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

    def moment(self, recording_id: str) -> Moment:
        """The pulse at which to open a recording."""
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

    def preview(self, newer_than: RigPulse, timeout_s: float) -> Preview | None:
        """Wait for a triplet of another pulse than `newer_than`; None if none came in time."""
        ...

    def camera_aids(self, camera: str, newer_than: RigPulse, timeout_s: float) -> CameraAids | None:
        """How sharp and how bright the picture of a camera is; waits as `preview`. UnknownCameraError: no such one."""
        ...

    def close_up(self, camera: str, newer_than: RigPulse, timeout_s: float, *, peaking: bool) -> CloseUp | None:
        """The whole picture of a camera; waits as `preview`. UnknownCameraError: no such one."""
        ...

    def camera_balls(self, camera: str) -> CameraBalls:
        """Where a camera should show the balls of the survey. UnknownCameraError: no such camera."""
        ...

    def camera_light(self, camera: str) -> CameraLight:
        """Exposure and gain of a camera. UnknownCameraError: no such one."""
        ...

    def change_light(self, camera: str, change: LightChange) -> CameraLight:
        """Change exposure or gain of a camera, and keep them in the rig file if that is wished.

        UnknownCameraError: no such camera. BadInputError: out of range. StateForbidsError: a recording runs.
        StorageError: the rig file cannot be written.
        """
        ...

    def trigger(self) -> TriggerView:
        """Who makes the pulses, and at what rate."""
        ...

    def change_trigger(self, change: TriggerChange) -> TriggerView:
        """Change the rate of the pulses, keep it in the rig file, stop or start them. BadInputError: it cannot be."""
        ...

    def burst(self, order: BurstOrder) -> TriggerView:
        """Have so many pulses made. StateForbidsError: they run, or the rig is not armed, or others make them."""
        ...

    def events(self, after: int) -> list[Event]:
        """The events of the live log with numbers above `after` that are still kept, oldest first."""
        ...

    def tell(self, level: Literal["info", "warning"], name: str, said: Phrase) -> None:
        """Add an event to the live log and to the service's log."""
        ...

    def listen(self, wake: Callable[[], None]) -> Callable[[], None]:
        """Call `wake`, from any thread, whenever status or events have changed.

        Returns:
            A function that ends the calls.
        """
        ...

    def rig(self) -> RigView:
        """The rig file in use."""
        ...

    def doctor(self) -> DoctorReport:
        """Check everything that a recording depends on; takes some seconds. One call at a time."""
        ...

    def metrics(self) -> Iterable[Metric]:
        """The metric families of what has been measured so far."""
        ...

    def healthy(self) -> bool:
        """Whether the service itself works: the supervisor's loop turns and the recorder answers."""
        ...
