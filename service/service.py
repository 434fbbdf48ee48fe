"""The service as the panel sees it (`service.seam.rig.RigService`): turns calls into commands to the supervisor."""

import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from typing import Final, Literal

from prometheus_client.metrics_core import Metric

from recorder.catalogue.folder import Catalogue
from rig import events
from rig.api.automatic import AutomaticChange, JumpMark, Marked
from rig.api.cameras.aids import CameraAids
from rig.api.cameras.balls import CameraBalls
from rig.api.cameras.light import CameraLight, LightChange
from rig.api.measuring import MeasuringQueue
from rig.api.parts import PartsChange, PartsView
from rig.api.recordings import Recording, RecordingOrder, SessionChange, StopOrder
from rig.api.rehearsal import RehearsalOrder, Rehearsals
from rig.api.status import ArmOrder, DoctorReport, Event, RigView, State, Status
from rig.api.trigger import BurstOrder, TriggerChange, TriggerView
from rig.errors import (
    RehearsingError,
    StateForbidsError,
    UnknownCameraError,
    UnknownRecordingError,
)
from rig.images.picture import shown
from rig.phrase import Phrase, phrase
from rig.pulse import RigPulse
from rig.transport.preview import PreviewImage, PreviewSlot
from service.aids import aids_of, close_up_of, shown_as
from service.aiming.balls import BallPlaces
from service.automatic.marks import Marks
from service.calibrating.helper import CalibrationHelper
from service.exports.jobs import Exports
from service.jumpers.book import JumperBook
from service.lights import Lights
from service.measuring.queue import Measurings
from service.parts import PartLimits
from service.recordings.archive import Archive
from service.recordings.describing import as_recording
from service.recordings.measured_jumps import MeasuredJumps
from service.recordings.trash_keeper import TrashKeeper
from service.rehearsals import Rehearser
from service.seam.cameras import CloseUp, Preview
from service.status.forbidden import FORBIDDEN
from service.status.measurements import measurements
from service.status.statements import rehearsing
from service.supervision.messages import Acknowledge, Arm, ChangeSession, Disarm, Start, Stop
from service.supervision.supervisor import Supervisor
from service.trains import Trains

_ANSWER_S: Final = 10.0
_LOG_OPENS_S: Final = 15.0
#: Closing a log of some GB may wait for a slow disk.
_LOG_CLOSES_S: Final = 60.0
#: After each request for a preview the recorder goes on copying images for this time.
_PREVIEW_LEASE_S: Final = 3.0
_PREVIEW_LOOK_S: Final = 0.02


class Service(Archive):
    """Any thread may call any method.

    Args:
        supervisor: owns the rig.
        jumpers: the start list and the next jumper.
        catalogue: of the folder of the recordings.
        exports: of these recordings.
        measurings: measures these recordings.
        jumps: that were measured in them.
        keeper: looks after the trash of this folder.
        slot: shared memory with the newest triplet.
        rehearser: makes rehearsals of the rig.
        lights: exposure, gain and region of the cameras.
        trains: the pulses, where svev makes them.
        balls: where the cameras should show the balls.
        calibrating: helps to calibrate the cameras.
        examine: the doctor; examines what disturbs nothing in the given state. It is told whether the beam of the light
            barrier is interrupted; None: it is not known.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        jumpers: JumperBook,
        catalogue: Catalogue,
        exports: Exports,
        measurings: Measurings,
        jumps: MeasuredJumps,
        keeper: TrashKeeper,
        slot: PreviewSlot,
        rehearser: Rehearser,
        lights: Lights,
        trains: Trains,
        parts: PartLimits,
        balls: BallPlaces,
        calibrating: CalibrationHelper,
        examine: Callable[[Status, bool | None], DoctorReport],
    ) -> None:
        super().__init__(catalogue, exports, measurings, jumps)
        self._supervisor, self._jumpers, self._keeper = supervisor, jumpers, keeper
        self._slot, self._rehearser, self._examine = slot, rehearser, examine
        self._lights, self._trains, self._parts = lights, trains, parts
        self._balls, self._calibrating = balls, calibrating
        #: Whoever needs the cameras while the rig is idle holds `_idle` until he has them; `_examining`: as long as.
        self._idle, self._examining = threading.Lock(), threading.Lock()
        self._marks = Marks(supervisor, slot, self.status, self.start_recording)
        self._closing = threading.Event()

    def status(self) -> Status:
        """The present status; the room on the disk counts what the trash holds."""
        status, shown = self._supervisor.status, self._jumpers.shown
        if shown.version > status.next_jumper.version:  # somebody has just edited him
            status = status.model_copy(update={"next_jumper": shown})
        if (automatic := self._marks.automatic) is not None:
            status = status.model_copy(update={"automatic": automatic})
        if (progress := self._rehearser.progress) is not None:
            said = rehearsing() if status.state is State.IDLE else status.statement
            status = status.model_copy(update={"rehearsal": progress, "statement": said})
        if (measuring := self._measurings.view) != MeasuringQueue():
            status = status.model_copy(update={"measuring": measuring})
        return self._keeper.counted_in(status)

    @property
    def jumpers(self) -> JumperBook:
        """The start list and the next jumper."""
        return self._jumpers

    def arm(self, order: ArmOrder) -> Status:
        """Begin to arm; a rehearsal gives way."""
        with self._idle:
            if self._rehearser.end():
                text = "the rehearsal is ended without a verdict: the rig is armed"
                self.tell("info", "rehearsal", phrase("event_rehearsal_ended", text))
            return self._begin_to_arm(order)

    def _begin_to_arm(self, order: ArmOrder) -> Status:
        return self._supervisor.ask(partial(Arm, min_cameras=order.min_cameras))

    def acknowledge(self, alarm: int) -> Status:
        """Note that somebody has seen an alarm."""
        self._supervisor.ask(partial(Acknowledge, alarm=alarm))
        return self.status()

    def rehearsals(self) -> Rehearsals:
        """The rehearsal that runs, and what the last one showed."""
        return self._rehearser.view()

    def rehearse(self, order: RehearsalOrder) -> Rehearsals:
        """Begin a rehearsal; if one runs, nothing changes."""
        with self._idle:
            if self._rehearser.progress is None:
                if (state := self.status().state) is not State.IDLE:
                    raise StateForbidsError(FORBIDDEN["rehearse", state])
                if not self._examining.acquire(blocking=False):
                    raise StateForbidsError(
                        phrase("rehearse_checking", "the rig is being checked: wait until that is done, then rehearse")
                    )
                try:
                    self._rehearser.begin(order.seconds)
                finally:
                    self._examining.release()
        return self._rehearser.view()

    def end_rehearsal(self) -> Rehearsals:
        """End the rehearsal that runs, without a verdict; returns when the cameras are free."""
        self._rehearser.end()
        return self._rehearser.view()

    def disarm(self) -> Status:
        """Begin to disarm."""
        return self._supervisor.ask(Disarm)

    def start_recording(self, order: RecordingOrder) -> Recording:
        """Start; returns when the log is open. What lies in the trash makes room for it if it must."""
        supervisor, status = self._supervisor, self.status()
        if status.rehearsal is not None and status.state is State.IDLE:
            raise RehearsingError(
                phrase(
                    "rehearsing_record", "a rehearsal has the cameras: arm the rig, which ends it, then start recording"
                )
            )
        if status.state is State.ARMED:
            self.exports.tidy()
            self._keeper.make_room(supervisor.rig.recorder.jump_s if order.duration_s is None else order.duration_s)
        return supervisor.ask(partial(Start, order=order), _LOG_OPENS_S)

    def mark(self, mark: JumpMark) -> Marked:
        """Begin a recording at the mark, with the seconds before; one that runs already only gets the mark."""
        return self._marks.mark(mark)

    def change_automatic(self, change: AutomaticChange) -> Status:
        """Let motion begin recordings, or not."""
        self._marks.change(change)
        self._supervisor.hub.wake()
        return self.status()

    def watch(self) -> None:
        """Begin to watch for motion and at the light barrier, if the rig file says so; `close` ends it."""
        self._marks.watch()

    def stop_recording(self, recording_id: str, order: StopOrder) -> Recording:
        """Stop, and return when the log is closed."""
        supervisor = self._supervisor
        with suppress(UnknownRecordingError):  # not in progress: it is over, or the catalogue does not know it either
            supervisor.ask(partial(Stop, recording=recording_id, order=order), _LOG_CLOSES_S)
            supervisor.truths.wait(_ANSWER_S)
        return as_recording(self._catalogue.entry(recording_id))

    def change_session(self, recording_id: str, change: SessionChange) -> Recording:
        """Change session fields, also of the recording in progress."""
        entry = self._catalogue.change_session(recording_id, change.texts())
        self._measurings.renamed(recording_id, self._catalogue.file(recording_id))
        note = partial(ChangeSession, recording=recording_id, change=change.fields())
        return self._supervisor.ask(note) or self._with_next_part(entry)

    def delete_recording(self, recording_id: str) -> Recording:
        """Put a recording into the trash."""
        current = self._supervisor.now.recordings.current
        if current is not None and recording_id in current.ids[current.first :]:
            raise StateForbidsError(
                phrase(
                    "recording_in_progress",
                    "recording {recording} is in progress: stop it before deleting it",
                    recording=recording_id,
                )
            )
        later = self._catalogue.entry(recording_id).parts[:0:-1]  # the last one first: what is left is the beginning
        for part in later:
            self._catalogue.delete(part)
        return self._with_next_part(self._catalogue.delete(recording_id))

    def restore_recording(self, recording_id: str) -> Recording:
        """Take a recording out of the trash."""
        parts = self._catalogue.entry(recording_id, prefer_deleted=True).parts
        entry = self._catalogue.restore(recording_id)
        for part in parts[1:]:
            self._catalogue.restore(part)
        self._measurings.restored(recording_id, self._catalogue.file(recording_id))
        return self._with_next_part(entry)

    def preview(self, newer_than: RigPulse, timeout_s: float) -> Preview | None:
        """Wait for a triplet of another pulse than `newer_than`; None if none came in time."""
        image = self._awaited(newer_than, timeout_s)
        if image is None:
            return None
        rig = self._supervisor.rig
        return Preview(image.pulse, shown(image.pixels, shown_as(rig), coloured=True), rig.columns(), image.statuses)

    def camera_aids(self, camera: str, newer_than: RigPulse, timeout_s: float) -> CameraAids | None:
        """Wait as `preview` does; how sharp and how bright the picture of a camera is."""
        index = self._index(camera)
        image = self._awaited(newer_than, timeout_s)
        return None if image is None else aids_of(image, self._supervisor.rig, index)

    def close_up(self, camera: str, newer_than: RigPulse, timeout_s: float, *, peaking: bool) -> CloseUp | None:
        """Wait as `preview` does; the whole picture of a camera."""
        index = self._index(camera)
        image = self._awaited(newer_than, timeout_s)
        return None if image is None else close_up_of(image, self._supervisor.rig, index, peaking=peaking)

    def camera_balls(self, camera: str) -> CameraBalls:
        """Where a camera should show the balls of the survey."""
        return self._balls.of(camera)

    def camera_light(self, camera: str) -> CameraLight:
        """Exposure, gain and region of a camera."""
        return self._lights.view(camera)

    def change_light(self, camera: str, change: LightChange) -> CameraLight:
        """Change exposure, gain or region of a camera; it is away for a moment if the rig is armed."""
        if self._rehearser.progress is not None:
            raise RehearsingError(
                phrase(
                    "rehearsing_settings",
                    "a rehearsal has the cameras: wait until it is done, then change their settings",
                )
            )
        return self._lights.change(camera, change)

    @property
    def calibrating(self) -> CalibrationHelper:
        """Helps to calibrate the cameras."""
        return self._calibrating

    def trigger(self) -> TriggerView:
        """Who makes the pulses, and at what rate."""
        return self._trains.view()

    def change_trigger(self, change: TriggerChange) -> TriggerView:
        """Change the rate of the pulses; if the rig is armed, it is armed anew. Stop or start them."""
        if self._rehearser.progress is not None:
            raise RehearsingError(
                phrase("rehearsing_rate", "a rehearsal has the cameras: wait until it is done, then change the rate")
            )
        return self._trains.change(change)

    def burst(self, order: BurstOrder) -> TriggerView:
        """Have so many pulses made."""
        return self._trains.burst(order.pulses)

    def parts(self) -> PartsView:
        """How recordings are split from the next one on."""
        return self._parts.view()

    def change_parts(self, change: PartsChange) -> PartsView:
        """Change when a recording goes on in its next part, from the next recording on."""
        return self._parts.change(change)

    def _index(self, camera: str) -> int:
        names = [each.name for each in self._supervisor.rig.cameras]
        if camera not in names:
            raise UnknownCameraError(f"no camera {camera}: the rig has {', '.join(names)}")
        return names.index(camera)

    def _awaited(self, newer_than: RigPulse, timeout_s: float) -> PreviewImage | None:
        """Wait for the image of another pulse than `newer_than`; None if none came in time."""
        deadline = time.monotonic() + timeout_s
        while True:
            self._slot.want(_PREVIEW_LEASE_S)
            if self.status().state is not State.IDLE and self._slot.newest() not in {0, newer_than}:
                image = self._slot.read()
                # One of before another region has columns that mean something else.
                sized = image is not None and image.pixels.shape == self._supervisor.rig.triplet_shape
                if image is not None and sized and image.pulse != newer_than:
                    return image
            if time.monotonic() > deadline or self._closing.wait(_PREVIEW_LOOK_S):
                return None

    def events(self, after: int) -> list[Event]:
        """The events with numbers above `after` that are still kept, oldest first."""
        return self._supervisor.hub.after(after)

    def tell(self, level: Literal["info", "warning"], name: str, said: Phrase) -> None:
        """Add an event to the live log and to the service's log."""
        self._supervisor.hub.tell(events.Event.now(events.Level(level), name, said))

    def listen(self, wake: Callable[[], None]) -> Callable[[], None]:
        """Have `wake` called whenever status or events have changed."""
        return self._supervisor.hub.listen(wake)

    def rig(self) -> RigView:
        """The rig file in use."""
        in_use = self._supervisor.now.in_use
        rig = in_use.rig
        return RigView(name=rig.name, toml=in_use.toml, settings=rig.model_dump(mode="json"))

    def doctor(self) -> DoctorReport:
        """Run the doctor, except for probes that would disturb the present state."""
        with self._examining:
            return self._examine(self.status(), self._marks.beam_interrupted())

    def metrics(self) -> Iterable[Metric]:
        """The metric families of what has been measured so far."""
        return measurements(self.status(), self._supervisor.now.seen.health)

    def healthy(self) -> bool:
        """Whether the loop turns and the recorder answers."""
        return self._supervisor.answering

    def close(self) -> None:
        """End the waiting of all threads that wait for a preview, and the watching."""
        self._closing.set()
        self._marks.close()
