"""Cameras inside the process: the same scenario as the simulated GigE Vision cameras, without network or privileges.

The scene is handed in (`Scene`), because rooms do not import each other: the front door composes the two.
"""

import time
from collections.abc import Mapping, Sequence
from enum import StrEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from capture.seam import Arrival
from rig.clocks import NS_PER_S, NS_PER_US, ClockLatch, DeviceNs, HostNs, host_now
from rig.errors import CameraError
from rig.ring import CameraRing
from rig.settings import CameraSettings

#: Exposure's end to the frame in memory: what three links would need.
_TRANSPORT_NS = 3_000_000


class Exposure(StrEnum):
    """What the scenario makes of one pulse in one camera."""

    OK = "ok"
    MISSED = "missed"
    LOST = "lost"
    DAMAGED = "damaged"
    DEAD = "dead"


class Scene(Protocol):
    """The simulated hill as one camera sees it."""

    def next_pulse(self, after: HostNs) -> int:
        """Index of the first pulse strictly later than `after`."""
        ...

    def pulse_time(self, pulse: int) -> HostNs:
        """When the pulse fires."""
        ...

    def device_time(self, host: HostNs, pulse: int | None = None) -> DeviceNs:
        """The camera's own clock; for a pulse, with the jitter of its exposure."""
        ...

    def exposure(self, pulse: int) -> Exposure:
        """What becomes of the pulse. Asked once per pulse."""
        ...

    def render_into(self, out: NDArray[np.uint8], pulse: int) -> None:
        """Draw the frame, shape (rows, columns)."""
        ...


class SimCamera:
    """One simulated camera; see `capture.seam.Camera`."""

    def __init__(self, settings: CameraSettings, ring: CameraRing, scene: Scene) -> None:
        self._settings, self._ring, self._scene = settings, ring, scene
        self._shape = (settings.region.height, settings.region.width)
        self._delay = round(settings.exposure_us * NS_PER_US) + _TRANSPORT_NS
        self._frame_id = 0
        self._underruns = 0
        self._pulse = 0

    @property
    def description(self) -> str:
        """What it is."""
        return f"simulated camera {self._settings.name}, {self._shape[1]} x {self._shape[0]}"

    def start(self) -> None:
        """From the next pulse on."""
        self._pulse = self._scene.next_pulse(host_now())

    def receive(self, timeout_s: float) -> Arrival | None:
        """See `capture.seam.Camera.receive`."""
        deadline = host_now() + round(timeout_s * NS_PER_S)
        while True:
            ready = self._scene.pulse_time(self._pulse) + self._delay
            if ready > deadline:
                _wait_until(deadline)
                return None
            # Everything is known in advance, so the frame is drawn before its time and handed over on time.
            arrival = self._expose(self._pulse, HostNs(ready))
            self._pulse = self._scene.next_pulse(self._scene.pulse_time(self._pulse))
            if arrival is not None:
                return arrival

    def latch(self) -> ClockLatch:
        """Read both clocks."""
        before = host_now()
        device = self._scene.device_time(before)
        after = host_now()
        return ClockLatch(device, before, after - before)

    def counters(self) -> Mapping[str, int]:
        """Frames that found no free slot."""
        return {"underruns": self._underruns}

    def notices(self) -> Sequence[str]:
        """None."""
        return ()

    def close(self) -> None:
        """Give the slots back."""
        self._ring.reclaim()

    def _expose(self, pulse: int, ready: HostNs) -> Arrival | None:
        exposure = self._scene.exposure(pulse)
        if exposure is Exposure.DEAD:
            raise CameraError(f"camera {self._settings.name} is gone, as the scenario wants")
        if exposure is Exposure.MISSED:
            return None
        self._frame_id += 1
        if exposure is Exposure.LOST:
            return None
        slot = self._ring.take_slot() if exposure is Exposure.OK else None
        if slot is not None:
            self._scene.render_into(self._ring.frame(slot).reshape(self._shape), pulse)
        elif exposure is Exposure.OK:
            self._underruns += 1
            return None
        _wait_until(ready)
        if slot is None:
            return Arrival(whole=False, host_time=host_now())
        device = self._scene.device_time(self._scene.pulse_time(pulse), pulse)
        return Arrival(True, host_now(), slot, self._frame_id, 0, device, self._frame_id)


def _wait_until(host: int) -> None:
    """Let the simulated time pass: there is nothing but time to wait for."""
    if (remaining := host - host_now()) > 0:
        time.sleep(remaining / NS_PER_S)
