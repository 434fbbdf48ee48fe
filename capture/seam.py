"""The seam between the grabber and whatever delivers frames.

A back end writes frames into slots of the camera's ring that it takes itself (`CameraRing.take_slot`), and hands
out one `Arrival` per frame. One conformance suite runs over every back end.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import NO_SLOT, StampedPixels


@dataclass(frozen=True, slots=True)
class Arrival:
    """Something arrived from a camera.

    Attributes:
        whole: a whole frame. If not, ids are meaningless and there are no pixels.
        host_time: when it was handed over.
        slot: slot of the ring that holds the pixels; the caller queues or returns it.
        frame_id: block id or frame counter.
        id_modulus: how many different ids there are, 0 if they never wrap.
        device_time: device clock at the trigger; of a damaged frame only about so, 0 if it cannot be told.
        trigger_count: the camera's own count of triggers, -1 if it has none.
        stamped: pixels that are no picture but the camera's signature.
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
        """Vendor, model, serial number, and what was set, in one line for people."""
        ...

    def start(self) -> None:
        """Begin to take frames.

        Raises:
            CameraError: the camera refuses.
        """
        ...

    def receive(self, timeout_s: float) -> Arrival | None:
        """Wait for the next arrival, at most `timeout_s` seconds.

        Returns:
            None if nothing came, which is healthy while there are no pulses.

        Raises:
            CameraError: the camera is gone or refuses; close it and open a new one.
        """
        ...

    def latch(self) -> ClockLatch:
        """Read the camera's clock against the host's.

        Raises:
            CameraError: the camera does not answer.
        """
        ...

    def counters(self) -> Mapping[str, int]:
        """What the back end has counted, by the names of `rig.ring.COUNTERS`."""
        ...

    def notices(self) -> Sequence[str]:
        """What happened since the last call that people should find in the event log, one line each."""
        ...

    def close(self) -> None:
        """Stop and let go of the camera. Takes a bounded time and never raises."""
        ...


#: Connects and configures a camera from scratch.
#: Raises CameraNotFoundError if it does not answer, CameraError if it refuses.
OpenCamera = Callable[[], Camera]
