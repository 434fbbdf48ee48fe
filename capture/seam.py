"""What every camera back end offers to the grabber: the `Camera` protocol, and the `Arrival` that it hands over.

A back end takes free slots of the camera's ring itself (`CameraRing.take_slot`), writes frames into them, and returns
one `Arrival` per frame. One conformance suite (`tests/capture/test_conformance.py`) runs over every back end.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import NO_SLOT, StampedPixels
from rig.settings.region import RegionLimits


@dataclass(frozen=True, slots=True)
class Arrival:
    """A frame, whole or damaged, that came from a camera.

    Attributes:
        whole: the frame is whole. A damaged one has no pixels, and its ids mean nothing.
        host_time: when the back end handed it over.
        slot: slot of the ring that holds the pixels; the caller queues or returns it.
        frame_id: block id (GigE Vision) or frame counter (IIDC).
        id_modulus: how many different ids there are, 0 if they never wrap.
        device_time: device clock at the trigger; for a damaged frame an estimate, or 0 if it is not known.
        trigger_count: the camera's own count of triggers, -1 if it has none.
        stamped: pixels that carry the camera's signature instead of the picture.
    """

    whole: bool
    host_time: HostNs
    slot: int = NO_SLOT
    frame_id: int = 0
    id_modulus: int = 0
    device_time: DeviceNs = DeviceNs(0)
    trigger_count: int = -1
    stamped: StampedPixels | None = None


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
