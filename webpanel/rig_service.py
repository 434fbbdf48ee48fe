"""The seam between the panel and the service: what the panel may ask for, and how the service says no."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from recorder.catalogue import UnknownRecordingError
from rig.errors import SvevError
from rig.frame import FrameStatus
from webpanel.models import DoctorReport, Event, Recording, RecordingOrder, RigView, SessionChange, Status

__all__ = [
    "Metric", "Preview", "Quantity", "RigService", "StateForbidsError", "UnknownRecordingError",
]  # fmt: skip


class StateForbidsError(SvevError):
    """The call makes no sense in the present state (HTTP 409); the message says what to do instead."""


class Quantity(StrEnum):
    """What a metric is."""

    COUNTER = "counter"
    GAUGE = "gauge"
    HISTOGRAM = "histogram"


@dataclass(frozen=True, slots=True)
class Metric:
    """One family of measured values, for Prometheus.

    Attributes:
        name: e.g. `svev_frames_total`.
        help: one line.
        quantity: kind.
        label: name of the one label, empty if there is none.
        values: by value of the label; a histogram's keys are upper bounds in the base unit, cumulative, with `+Inf`.
        total: a histogram's sum, in the base unit.
    """

    name: str
    help: str
    quantity: Quantity
    label: str
    values: dict[str, float]
    total: float = 0.0


@dataclass(frozen=True, slots=True)
class Preview:
    """The newest triplet that is to be shown.

    Attributes:
        pixels: (rows, columns), uint8; a copy of its own.
        columns: first and one past the last column by camera.
        statuses: by camera.
    """

    pulse: int
    pixels: NDArray[np.uint8]
    columns: tuple[tuple[int, int], ...]
    statuses: tuple[FrameStatus, ...]


class RigService(Protocol):
    """The running service. All methods may be called from any thread, return soon and never hang.

    Raises (each where it applies):
        StateForbidsError: not in this state.
        UnknownRecordingError: no such recording.
        SvevError: it failed; the message says what to do.
    """

    def status(self) -> Status:
        """The present picture; cheap."""
        ...

    def arm(self) -> Status:
        """Begin to arm. Armed or arming already: nothing changes. While disarming: StateForbidsError."""
        ...

    def disarm(self) -> Status:
        """Begin to disarm. Idle or disarming already: nothing changes. While recording: StateForbidsError."""
        ...

    def start_recording(self, order: RecordingOrder) -> Recording:
        """Start; returns when the log is open. Only while armed."""
        ...

    def stop_recording(self, recording_id: str) -> Recording:
        """Stop, and return when the log is closed. A finished recording is returned as it is."""
        ...

    def change_session(self, recording_id: str, change: SessionChange) -> Recording:
        """Change session fields, also of the recording in progress."""
        ...

    def delete_recording(self, recording_id: str) -> Recording:
        """Put into the trash; not the one in progress. Already there: nothing changes."""
        ...

    def restore_recording(self, recording_id: str) -> Recording:
        """Take out of the trash. Not there: nothing changes."""
        ...

    def preview(self, newer_than: int, timeout_s: float) -> Preview | None:
        """Wait for a triplet with a pulse number other than `newer_than`; None if none came in time."""
        ...

    def events(self, after: int) -> list[Event]:
        """The events with numbers above `after` that are still kept, oldest first."""
        ...

    def listen(self, wake: Callable[[], None]) -> Callable[[], None]:
        """Have `wake` called, from any thread, whenever status or events have changed.

        Returns:
            A function that ends this.
        """
        ...

    def rig(self) -> RigView:
        """The rig file in use."""
        ...

    def doctor(self) -> DoctorReport:
        """Look at everything that a recording stands on; takes some seconds. One look at a time."""
        ...

    def metrics(self) -> list[Metric]:
        """What has been measured so far."""
        ...

    def healthy(self) -> bool:
        """Whether the service itself works: its loop turns and the recorder answers."""
        ...
