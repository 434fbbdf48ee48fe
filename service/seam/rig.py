"""The running service as the panel sees it: the state of the rig and the commands that change it."""

from collections.abc import Callable, Iterable
from typing import Literal, Protocol

from prometheus_client.metrics_core import Metric

from rig.api.automatic import AutomaticChange, JumpMark, Marked
from rig.api.export import ExportJob, ExportOrder
from rig.api.parts import PartsChange, PartsView
from rig.api.recordings import Recording, RecordingOrder, StopOrder
from rig.api.rehearsal import RehearsalOrder, Rehearsals
from rig.api.status import ArmOrder, DoctorReport, Event, RigView, Status
from rig.api.trigger import BurstOrder, TriggerChange, TriggerView
from rig.phrase import Phrase
from service.seam.archive import Archive, Exports
from service.seam.cameras import CalibrationHelper, Cameras
from service.seam.start_list import Jumpers


class RigService(Archive, Cameras, Protocol):
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

    def acknowledge(self, alarm: int) -> Status:
        """Note that somebody has seen an alarm. UnknownAlarmError: it is over."""
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

    def mark(self, mark: JumpMark) -> Marked:
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

    @property
    def exports(self) -> Exports:
        """The exports of recordings: those under way, and those that are kept."""
        ...

    def start_export(self, recording_id: str, order: ExportOrder) -> ExportJob:
        """Ask for an export. StateForbidsError: the recording is still being written; StorageError: no room."""
        ...

    @property
    def calibrating(self) -> CalibrationHelper:
        """Helps to calibrate the cameras."""
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

    def parts(self) -> PartsView:
        """How recordings are split from the next one on."""
        ...

    def change_parts(self, change: PartsChange) -> PartsView:
        """Change when a recording goes on in its next part, keep that in the rig file. StorageError: not kept."""
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
