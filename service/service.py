"""The service as the panel sees it (`service.seam.RigService`): turns calls into commands to the supervisor."""

import threading
import time
from collections.abc import Callable, Iterable
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from typing import Final, Literal

from prometheus_client.metrics_core import Metric

from recorder.catalogue.folder import Catalogue
from rig import events
from rig.errors import StateForbidsError, UnknownRecordingError
from rig.phrase import Phrase
from rig.pulse import RigPulse
from rig.status import DoctorReport, Event, Recording, RecordingOrder, RigView, SessionChange, State, Status, StopOrder
from rig.transport.preview import PreviewSlot
from service.exports.jobs import Exports
from service.jumpers.book import JumperBook
from service.recordings.archive import Archive, as_recording
from service.recordings.in_progress import Outcome
from service.recordings.trash_keeper import TrashKeeper
from service.seam import Preview
from service.status.measurements import measurements
from service.supervision.commands import at_once
from service.supervision.supervisor import Supervisor

_SOON_S: Final = 10.0
_OPEN_S: Final = 15.0
#: Closing a log of some GB may wait for a slow disk.
_CLOSE_S: Final = 60.0
#: After each request for a preview the recorder goes on copying images for this time.
_LEASE_S: Final = 3.0
_POLL_S: Final = 0.02


class Service(Archive):
    """Any thread may call any method.

    Args:
        supervisor: owns the rig.
        jumpers: the start list and the next jumper.
        catalogue: of the folder of the recordings.
        exports: of these recordings.
        keeper: looks after the trash of this folder.
        slot: shared memory with the newest triplet.
        examine: the doctor; examines what disturbs nothing in the given state.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        jumpers: JumperBook,
        catalogue: Catalogue,
        exports: Exports,
        keeper: TrashKeeper,
        slot: PreviewSlot,
        examine: Callable[[Status], DoctorReport],
    ) -> None:
        super().__init__(catalogue, exports)
        self._supervisor, self._jumpers, self._keeper = supervisor, jumpers, keeper
        self._slot, self._examine = slot, examine
        self._closing = threading.Event()

    def status(self) -> Status:
        """The present status; the room on the disk counts what the trash holds."""
        status, shown = self._supervisor.status, self._jumpers.shown
        if shown.version > status.next_jumper.version:  # somebody has just edited him
            status = status.model_copy(update={"next_jumper": shown})
        return self._keeper.counted_in(status)

    @property
    def jumpers(self) -> JumperBook:
        """The start list and the next jumper."""
        return self._jumpers

    def arm(self) -> Status:
        """Begin to arm."""
        return self._supervisor.commands.ask(at_once(self._supervisor.arm), _SOON_S)

    def disarm(self) -> Status:
        """Begin to disarm."""
        return self._supervisor.commands.ask(at_once(self._supervisor.disarm), _SOON_S)

    def start_recording(self, order: RecordingOrder) -> Recording:
        """Start; returns when the log is open. What lies in the trash makes room for it if it must."""
        supervisor = self._supervisor
        if self.status().state is State.ARMED:
            self.exports.tidy()
            self._keeper.make_room(supervisor.rig.recorder.jump_s if order.duration_s is None else order.duration_s)

        def start(opened: "Future[Recording]") -> None:
            supervisor.recordings.start(order, opened)

        return supervisor.commands.ask(start, _OPEN_S)

    def stop_recording(self, recording_id: str, order: StopOrder) -> Recording:
        """Stop, and return when the log is closed."""
        supervisor = self._supervisor

        def stop(ended: "Future[Outcome]") -> None:
            supervisor.recordings.stop(recording_id, ended, order=order)

        with suppress(UnknownRecordingError):  # not in progress: it is over, or the catalogue does not know it either
            supervisor.commands.ask(stop, _CLOSE_S)
            supervisor.truths.wait(_SOON_S)
        return as_recording(self._catalogue.entry(recording_id))

    def change_session(self, recording_id: str, change: SessionChange) -> Recording:
        """Change session fields, also of the recording in progress."""
        entry = self._catalogue.change_session(recording_id, change.texts())
        note = partial(self._supervisor.recordings.change_session, recording_id, change.fields())
        return self._supervisor.commands.ask(at_once(note), _SOON_S) or self._with_next_part(entry)

    def delete_recording(self, recording_id: str) -> Recording:
        """Put a recording into the trash."""
        recordings = self._supervisor.recordings

        def in_progress() -> bool:
            return recordings.current is not None and recordings.current.id == recording_id

        if self._supervisor.commands.ask(at_once(in_progress), _SOON_S):
            raise StateForbidsError(f"recording {recording_id} is in progress: stop it before deleting it")
        return self._with_next_part(self._catalogue.delete(recording_id))

    def restore_recording(self, recording_id: str) -> Recording:
        """Take a recording out of the trash."""
        return self._with_next_part(self._catalogue.restore(recording_id))

    def preview(self, newer_than: RigPulse, timeout_s: float) -> Preview | None:
        """Wait for a triplet of another pulse than `newer_than`; None if none came in time."""
        deadline = time.monotonic() + timeout_s
        while True:
            self._slot.want(_LEASE_S)
            if self.status().state is not State.IDLE and self._slot.newest() not in {0, newer_than}:
                image = self._slot.read()
                if image is not None and image.pulse != newer_than:
                    return Preview(image.pulse, image.pixels, self._supervisor.rig.columns(), image.statuses)
            if time.monotonic() > deadline or self._closing.wait(_POLL_S):
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
        rig = self._supervisor.rig
        return RigView(name=rig.name, toml=self._supervisor.rig_toml, settings=rig.model_dump(mode="json"))

    def doctor(self) -> DoctorReport:
        """Run the doctor, except for probes that would disturb the present state."""
        return self._examine(self.status())

    def metrics(self) -> Iterable[Metric]:
        """The metric families of what has been measured so far."""
        return measurements(self.status(), self._supervisor.health)

    def healthy(self) -> bool:
        """Whether the loop turns and the recorder answers."""
        return self._supervisor.answering

    def close(self) -> None:
        """End the waiting of all threads that wait for a preview."""
        self._closing.set()
