"""The running service as the panel asks for it: `webpanel.rig_service.RigService`, on top of the supervisor."""

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import suppress
from typing import Final

from recorder.catalogue import Catalogue, UnknownRecordingError
from rig.preview import PreviewSlot
from rig.settings import RigSettings
from svev.service.event_hub import EventHub
from svev.service.examination import Examination
from svev.service.measurements import measurements
from svev.service.supervisor import Supervisor
from webpanel.models import (
    DoctorReport,
    Event,
    Recording,
    RecordingOrder,
    RigView,
    SessionChange,
    State,
    Status,
)
from webpanel.recording_view import to_recording
from webpanel.rig_service import Metric, Preview, StateForbidsError

_SOON_S: Final = 10.0
_OPEN_S: Final = 15.0
#: A log of some GB may wait for a slow disk.
_CLOSE_S: Final = 60.0
#: After each look the recorder goes on to copy images for so long.
_LEASE_S: Final = 3.0
_POLL_S: Final = 0.02


class Service:
    """Any thread may call any method.

    Args:
        rig: the rig.
        rig_toml: the rig file's text.
        catalogue: of the folder where recordings go.
        supervisor: owns the rig.
        hub: the live log.
        slot: where the recorder puts images to look at.
    """

    def __init__(
        self,
        rig: RigSettings,
        rig_toml: str,
        catalogue: Catalogue,
        supervisor: Supervisor,
        hub: EventHub,
        slot: PreviewSlot,
    ) -> None:
        self._rig, self._rig_toml, self._catalogue = rig, rig_toml, catalogue
        self._supervisor, self._hub, self._slot = supervisor, hub, slot
        self._examination = Examination(rig, catalogue.directory, self.status)
        self._closing = threading.Event()

    def status(self) -> Status:
        """The present picture."""
        return self._supervisor.status

    def arm(self) -> Status:
        """Begin to arm."""
        return self._supervisor.commands.ask(self._supervisor.arm, _SOON_S)

    def disarm(self) -> Status:
        """Begin to disarm."""
        return self._supervisor.commands.ask(self._supervisor.disarm, _SOON_S)

    def start_recording(self, order: RecordingOrder) -> Recording:
        """Start; returns when the log is open."""
        supervisor = self._supervisor

        def start(opened: "Future[Recording]") -> None:
            supervisor.recordings.start(order, opened)

        return supervisor.commands.ask(start, _OPEN_S)

    def stop_recording(self, recording_id: str) -> Recording:
        """Stop, and return when the log is closed."""
        supervisor = self._supervisor

        def stop(ended: "Future[str]") -> None:
            supervisor.recordings.stop(recording_id, ended)

        with suppress(UnknownRecordingError):  # not in progress: it is over, or the catalogue does not know it either
            supervisor.commands.ask(stop, _CLOSE_S)
        return to_recording(self._catalogue.entry(recording_id))

    def change_session(self, recording_id: str, change: SessionChange) -> Recording:
        """Change session fields, also of the recording in progress."""
        supervisor = self._supervisor
        entry = self._catalogue.change_session(recording_id, change.model_dump(exclude_none=True))

        def note(noted: "Future[Recording | None]") -> None:
            noted.set_result(supervisor.recordings.change_session(recording_id, change))

        return supervisor.commands.ask(note, _SOON_S) or to_recording(entry)

    def delete_recording(self, recording_id: str) -> Recording:
        """Put into the trash."""
        supervisor = self._supervisor

        def check(checked: "Future[None]") -> None:
            current = supervisor.recordings.current
            if current is not None and current.id == recording_id:
                raise StateForbidsError(f"recording {recording_id} is in progress: stop it before deleting it")
            checked.set_result(None)

        supervisor.commands.ask(check, _SOON_S)
        return to_recording(self._catalogue.delete(recording_id))

    def restore_recording(self, recording_id: str) -> Recording:
        """Take out of the trash."""
        return to_recording(self._catalogue.restore(recording_id))

    def preview(self, newer_than: int, timeout_s: float) -> Preview | None:
        """Wait for a triplet with a pulse number other than `newer_than`; None if none came in time."""
        deadline = time.monotonic() + timeout_s
        while True:
            self._slot.want(_LEASE_S)
            if self.status().state is not State.IDLE and self._slot.newest() not in {0, newer_than}:
                image = self._slot.read()
                if image is not None and image.pulse != newer_than:
                    return Preview(image.pulse, image.pixels, self._rig.columns(), image.statuses)
            if time.monotonic() > deadline or self._closing.wait(_POLL_S):
                return None

    def events(self, after: int) -> list[Event]:
        """The events with numbers above `after` that are still kept, oldest first."""
        return self._hub.after(after)

    def listen(self, wake: Callable[[], None]) -> Callable[[], None]:
        """Have `wake` called whenever status or events have changed."""
        return self._hub.listen(wake)

    def rig(self) -> RigView:
        """The rig file in use."""
        return RigView(name=self._rig.name, toml=self._rig_toml, settings=self._rig.model_dump(mode="json"))

    def doctor(self) -> DoctorReport:
        """Look at everything that a recording stands on, as far as that disturbs nothing."""
        return self._examination.report()

    def metrics(self) -> list[Metric]:
        """What has been measured so far."""
        return measurements(self.status(), self._supervisor.health)

    def healthy(self) -> bool:
        """Whether the loop turns and the recorder answers."""
        return self._supervisor.answering

    def close(self) -> None:
        """Let whoever waits for a preview go."""
        self._closing.set()
