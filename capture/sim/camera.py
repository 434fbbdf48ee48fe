"""Simulated cameras inside the grabber process: need no network, no bus and no privileges.

They show the same scenario as the simulated GigE Vision and FireWire cameras. The caller passes the simulated hill in
(`Scene`), because this room does not import the simulation.
"""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from capture.seam import Arrival
from rig.clocks import NS_PER_S, NS_PER_US, ClockLatch, DeviceNs, HostNs, host_now, sleep_until
from rig.errors import CameraError
from rig.frame import DamagedRecord, FrameRecord, FrameStatus
from rig.settings.camera import CameraSettings
from rig.transport.ring import CameraRing

#: From the end of the exposure to the frame in memory: about what a camera's link needs.
_TRANSPORT_NS = 3_000_000


class Scene(Protocol):
    """The simulated hill as one camera sees it."""

    def start(self, after: HostNs) -> None:
        """Let the pulses later than `after` reach the camera."""
        ...

    def next_pulse(self, until: HostNs) -> tuple[int, HostNs] | None:
        """Number and time of the next pulse that reaches the camera; None: there is none up to a time.

        A scene that does not know its pulses in advance waits for one until then.
        """
        ...

    def stop(self) -> None:
        """Let no pulse reach the camera any more."""
        ...

    def device_time(self, host: HostNs, pulse: int | None = None) -> DeviceNs:
        """The camera's own clock; for a pulse, with the jitter of its exposure."""
        ...

    def exposure(self, pulse: int) -> FrameStatus:
        """What the camera makes of the pulse. To be called once per pulse."""
        ...

    def render_into(self, out: NDArray[np.uint8], pulse: int) -> None:
        """Write the bytes of a frame, as the camera's pixel format has them, shape (bytes,)."""
        ...


class SimCamera:
    """One simulated camera; see `capture.seam.Camera`."""

    def __init__(self, settings: CameraSettings, ring: CameraRing, scene: Scene) -> None:
        self._settings, self._ring, self._scene = settings, ring, scene
        self._shape = (settings.region.height, settings.region.width)
        self._delay = round(settings.exposure_us * NS_PER_US) + _TRANSPORT_NS
        self._frame_id = 0
        self._underruns = 0

    @property
    def description(self) -> str:
        """Name and size."""
        return f"simulated camera {self._settings.name}, {self._shape[1]} x {self._shape[0]}"

    @property
    def limits(self) -> None:
        """See `capture.seam.Camera.limits`."""
        return

    def start(self) -> None:
        """See `capture.seam.Camera.start`."""
        self._scene.start(host_now())

    def receive(self, timeout_s: float) -> Arrival | None:
        """See `capture.seam.Camera.receive`."""
        deadline = HostNs(host_now() + round(timeout_s * NS_PER_S))
        # Where the scenario is known in advance, the frame is drawn before its time and handed over on time.
        while (fired := self._scene.next_pulse(HostNs(deadline - self._delay))) is not None:
            arrival = self._expose(*fired)
            if arrival is not None:
                return arrival
        sleep_until(deadline)
        return None

    def latch(self) -> ClockLatch:
        """See `capture.seam.Camera.latch`."""
        return ClockLatch.computed(self._scene.device_time)

    def counters(self) -> Mapping[str, int]:
        """Frames for which the ring had no free slot."""
        return {"underruns": self._underruns}

    def notices(self) -> Sequence[str]:
        """None: a simulated camera has nothing to report."""
        return ()

    @property
    def bytes_received(self) -> int:
        """See `capture.seam.Camera.bytes_received`."""
        return 0

    def close(self) -> None:
        """Give all slots back."""
        self._scene.stop()
        self._ring.reclaim()

    def _expose(self, pulse: int, time: HostNs) -> Arrival | None:
        exposure, ready = self._scene.exposure(pulse), HostNs(time + self._delay)
        if exposure is FrameStatus.ABSENT:
            sleep_until(ready)  # or the grabber would connect again before the pulse has gone by
            raise CameraError(f"camera {self._settings.name} is gone, as the scenario wants")
        if exposure is FrameStatus.MISSED:
            return None
        self._frame_id += 1
        if exposure is FrameStatus.LOST:
            return None
        slot = self._ring.take_slot() if exposure is FrameStatus.OK else None
        if slot is not None:
            self._scene.render_into(self._ring.frame(slot), pulse)
        elif exposure is FrameStatus.OK:
            self._underruns += 1
            return None
        sleep_until(ready)
        if slot is None:
            return DamagedRecord(host_now())
        device = self._scene.device_time(time, pulse)
        return FrameRecord(host_now(), slot, self._frame_id, 0, device, self._frame_id)
