"""Measures the state of the recorder: makes the health record of every second."""

import threading
from collections import deque
from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from statistics import median
from typing import Final

from rig.action import ActionCounts
from rig.clocks import NS_PER_S, NS_PER_US, DecimalNs, HostNs
from rig.health import (
    CameraHealth,
    DiskHealth,
    Health,
    Latency,
    PairingHealth,
    PrerollHealth,
    PulsesMade,
    ToldPulses,
    WritingHealth,
)
from rig.host.disk import free_bytes
from rig.settings.model import RigSettings
from rig.transport.ring import CameraRing
from triggering.pairing.pairer import ClosedPulse

_LATE_PULSES: Final = 30
_ROOM_S: Final = 1.0
#: Words of the source of the pulses that wait for the next health record; it has about ten a second.
_WORDS_KEPT: Final = 100
#: Upper bounds, s. Fixed, so that figures of different days and machines can be added up.
_BUCKETS_S: Final = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)


class LatencyHistogram:
    """Counts, in fixed buckets, how long triplets take from their last frame in memory to disk and subscribers."""

    def __init__(self) -> None:
        self._counts = [0] * (len(_BUCKETS_S) + 1)
        self._sum_s = 0.0

    def add(self, latency_ns: int) -> None:
        """Count one triplet."""
        seconds = latency_ns / NS_PER_S
        place = sum(seconds > bound for bound in _BUCKETS_S)
        self._counts[place] += 1
        self._sum_s += seconds

    def figures(self) -> Latency:
        """Counts up to each bound, cumulative, as Prometheus wants them."""
        names = [*(f"{bound:g}" for bound in _BUCKETS_S), "+Inf"]
        buckets = dict(zip(names, accumulate(self._counts), strict=True))
        return Latency(buckets, round(self._sum_s, 6), sum(self._counts))


class FreeRoom:
    """Asks once a second, in a thread of its own, how much room a disk has: the answer may take long.

    Attributes:
        free_bytes: as `rig.host.disk.free_bytes`, about a second ago; None until the first answer.
    """

    def __init__(self, directory: Path) -> None:
        self.free_bytes: int | None = None
        self._directory, self._over = directory, threading.Event()
        threading.Thread(target=self._run, name="free room", daemon=True).start()

    def close(self) -> None:
        """End the thread."""
        self._over.set()

    def _run(self) -> None:
        while True:
            self.free_bytes = free_bytes(self._directory)
            if self._over.wait(_ROOM_S):
                return


class HealthMonitor:
    """Collects measurements while pulses come, and makes a record of them once a second.

    Args:
        rig: the rig.
        rings: one per camera.
        directory: folder of the recordings.

    Attributes:
        latency: times from a triplet's last frame in memory until the triplet is handed on.
        actions: what each camera has answered to action commands; None: they get none.
        made: the pulses that a line of the computer has made; None: it makes none.
    """

    def __init__(self, rig: RigSettings, rings: Sequence[CameraRing], directory: Path) -> None:
        self._names, self._rings, self._room = [camera.name for camera in rig.cameras], rings, FreeRoom(directory)
        self._frames_before = [ring.counters()["frames"] for ring in rings]
        self._offsets: list[deque[int]] = [deque(maxlen=_LATE_PULSES) for _ in rings]
        self.latency = LatencyHistogram()
        self.actions: tuple[ActionCounts, ...] | None = None
        self.made: PulsesMade | None = None
        self._fired: deque[ToldPulses] | None = None

    def fired(self, told: ToldPulses) -> None:
        """Keep what the source tells of its pulses for the next record."""
        self._fired = deque(maxlen=_WORDS_KEPT) if self._fired is None else self._fired
        self._fired.append(told)

    def pulse(self, pulse: ClosedPulse) -> None:
        """Note the cameras' trigger offsets of a decided pulse."""
        for kept, outcome in zip(self._offsets, pulse.outcomes, strict=True):
            if outcome.offset_ns is not None:
                kept.append(outcome.offset_ns)

    def underruns(self) -> int:
        """Frames that have found no free slot in their camera's ring so far, in all cameras."""
        return sum(ring.counters()["underruns"] for ring in self._rings)

    def record(
        self,
        now: HostNs,
        connected: Sequence[bool],
        *,
        pairing: PairingHealth,
        free_triplets: int,
        unpublished: int,
        preroll: PrerollHealth,
        recording: WritingHealth | None,
    ) -> Health:
        """The record for the second that ends now.

        Args:
            now: present time.
            connected: for each camera, whether it is connected.
            pairing: this and the others as in `rig.health.Health`.
            free_triplets: likewise.
            unpublished: likewise.
            preroll: likewise.
            recording: likewise.
        """
        actions = [None] * len(connected) if self.actions is None else self.actions
        cameras = tuple(map(self._camera, range(len(connected)), connected, actions))
        fired = None if self._fired is None else tuple(self._fired)
        if self._fired is not None:
            self._fired.clear()
        return Health(
            cameras, pairing, free_triplets, unpublished, preroll, recording,
            disk=DiskHealth(self._room.free_bytes),
            latency=self.latency.figures(),
            made=self.made,
            host_time_ns=DecimalNs(now),
            fired=fired,
        )  # fmt: skip

    def close(self) -> None:
        """End the thread that asks the disk."""
        self._room.close()

    def _camera(self, index: int, connected: bool, actions: ActionCounts | None) -> CameraHealth:
        counters = self._rings[index].counters()
        # A grabber that was started again counts from zero.
        rate = max(0, counters["frames"] - self._frames_before[index])
        self._frames_before[index] = counters["frames"]
        offsets, millidegrees = self._offsets[index], counters["temperature_mdeg"]
        return CameraHealth(
            name=self._names[index],
            connected=connected,
            frames_per_s=rate,
            clock_offset_us=round(median(offsets) / NS_PER_US, 3) if offsets and connected else None,
            temperature_c=millidegrees / 1000 if millidegrees else None,
            actions=actions,
            **counters,
        )
