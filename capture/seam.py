"""What every camera back end offers to the grabber: the `Camera` protocol, and the `Arrival` that it hands over.

A back end takes free slots of the camera's ring itself (`CameraRing.take_slot`), writes frames into them, and returns
one `Arrival` per frame. One conformance suite (`tests/capture/test_conformance.py`) runs over every back end.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, runtime_checkable

from rig.clocks import ClockLatch, HostNs
from rig.frame import DamagedRecord, FrameRecord
from rig.settings.region import RegionLimits

#: A frame that came from a camera, as the grabber queues it; the caller queues or returns the slot of a whole one.
Arrival = FrameRecord | DamagedRecord


class Camera(Protocol):
    """A connected, configured camera; after `start` it waits for trigger pulses."""

    @property
    def description(self) -> str:
        """Vendor, model, serial number and settings, in one line for people."""
        ...

    @property
    def limits(self) -> RegionLimits | None:
        """Which regions the camera takes; None: it does not say, or its frames are no part of a sensor."""
        ...

    def start(self) -> None:
        """Begin to take frames, from the next pulse on.

        Raises:
            CameraError: the camera refuses.
        """
        ...

    def receive(self, timeout_s: float) -> Arrival | None:
        """Wait for the next arrival, at most `timeout_s` seconds.

        Returns:
            None if nothing came, which is no error while there are no pulses.

        Raises:
            CameraError: the camera is gone or fails; close it and open a new one.
        """
        ...

    def latch(self) -> ClockLatch:
        """Read the camera's clock against the host's.

        Raises:
            CameraError: the camera does not answer.
        """
        ...

    def counters(self) -> Mapping[str, int]:
        """Totals of the back end, by the names of `rig.transport.ring.COUNTERS`."""
        ...

    def notices(self) -> Sequence[str]:
        """Messages since the last call that belong in the event log, one line each."""
        ...

    @property
    def bytes_received(self) -> int:
        """Bytes that have come so far, of frames whole or not; 0 where no part of a frame comes before the rest."""
        ...

    def close(self) -> None:
        """Stop and release the camera. Takes a bounded time and never raises."""
        ...


@runtime_checkable
class Commanded(Protocol):
    """A camera that can be told to expose."""

    def fire(self) -> None:
        """Tell the camera to expose now, if it can take a command at present.

        Raises:
            CameraError: the camera does not answer.
        """
        ...


class Commands(Protocol):
    """When a camera is to be told to expose, where no electric pulse does that."""

    def until_next_ns(self, now: HostNs) -> int:
        """Time from `now` to the next pulse, ns."""
        ...

    def is_due(self, now: HostNs) -> bool:
        """Whether the camera is to be told now; once for each pulse."""
        ...

    def begin(self) -> None:
        """Note that the camera has just become ready: no pulse before is due any more."""
        ...

    def withheld(self) -> int:
        """How many pulses since the last call had no command, because it would have come too late."""
        ...


#: Connects and configures a camera from scratch.
#: Raises CameraNotFoundError if it does not answer, CameraError if it refuses.
OpenCamera = Callable[[], Camera]
