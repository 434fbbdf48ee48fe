"""The health record: what the last second looked like."""

import os
from collections import deque
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any, Final

from recorder.latency import LatencyHistogram
from rig.clocks import NS_PER_US
from rig.ring import CameraRing
from rig.settings import RigSettings
from triggering.pairing import ClosedPulse

_LATE_PULSES: Final = 30


class Health:
    """Gathers what is measured on the way.

    Args:
        rig: the rig.
        rings: one per camera.
        directory: where recordings go.

    Attributes:
        latency: from a triplet's last frame in memory until it is handed on.
    """

    def __init__(self, rig: RigSettings, rings: Sequence[CameraRing], directory: Path) -> None:
        self._names, self._rings, self._directory = [camera.name for camera in rig.cameras], rings, directory
        self._frames_before = [ring.counters()["frames"] for ring in rings]
        self._offsets: list[deque[int]] = [deque(maxlen=_LATE_PULSES) for _ in rings]
        self.latency = LatencyHistogram()

    def pulse(self, pulse: ClosedPulse) -> None:
        """Note the offsets of a decided pulse."""
        for kept, outcome in zip(self._offsets, pulse.outcomes, strict=True):
            if outcome.offset_ns is not None:
                kept.append(outcome.offset_ns)

    def record(self, connected: Sequence[bool], more: Mapping[str, Any]) -> dict[str, Any]:
        """The record for the second that ends now."""
        cameras = [self._camera(index, is_there) for index, is_there in enumerate(connected)]
        disk = {"free_bytes": _free_bytes(self._directory)}
        return {"cameras": cameras, **more, "disk": disk, "latency": self.latency.to_json()}

    def _camera(self, index: int, connected: bool) -> dict[str, Any]:
        counters = self._rings[index].counters()
        # A grabber that was started again counts from zero.
        rate = max(0, counters["frames"] - self._frames_before[index])
        self._frames_before[index] = counters["frames"]
        offsets, millidegrees = self._offsets[index], counters["temperature_mdeg"]
        return {
            "name": self._names[index],
            "connected": connected,
            "frames_per_s": rate,
            "clock_offset_us": round(median(offsets) / NS_PER_US, 3) if offsets and connected else None,
            "temperature_c": millidegrees / 1000 if millidegrees else None,
            **counters,
        }


def _free_bytes(directory: Path) -> int | None:
    """Room on the disk for us; None while the directory is not there (an unplugged disk, say)."""
    try:
        disk = os.statvfs(directory)
    except OSError:
        return None
    return disk.f_bavail * disk.f_frsize
