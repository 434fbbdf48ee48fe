"""From the cameras' rings to triplets: each frame is copied once, into its column block of its pulse's triplet.

The copy is made the moment the frame arrives, while it is still in the processor's cache, and the camera's slot is
free again at once. If the disk is behind and no triplet buffer is free, frames wait in the cameras' rings.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_US, ClockLatch, HostNs, UtcAnchor
from rig.frame import FrameStatus, Record, RecordKind
from rig.ring import CameraRing
from rig.settings import RigSettings
from rig.tag import CameraTag
from triggering.pairing import ClosedPulse, OpenPulse, Pairer

#: A pulse waits for its frames: exposure, transport, Aravis's retention of damaged frames, and some periods.
_HOLD_PERIODS = 4
_HOLD_NS = 130_000_000


@dataclass(frozen=True, slots=True)
class CameraChange:
    """A camera came, went, or fell silent."""

    camera: int
    present: bool
    text: str
    time: HostNs


class Assembler:
    """Reads the rings, pairs by pulse, composes the triplets.

    Args:
        rig: the rig.
        rings: one per camera, in the rig's order.
        buffers: where triplets are composed.

    Attributes:
        pairer: decides which frame belongs to which pulse.
        hold_ns: a pulse is decided at the latest so long after it fired.
        connected: for each camera, whether it is there.
    """

    def __init__(self, rig: RigSettings, rings: Sequence[CameraRing], buffers: TripletBuffers) -> None:
        self._rings, self._buffers = rings, buffers
        self._names = [camera.name for camera in rig.cameras]
        self._columns = rig.columns()
        self._shapes = [(camera.region.height, camera.region.width) for camera in rig.cameras]
        self._blocks: dict[int, list[NDArray[np.uint8]]] = {}
        self._waiting: tuple[int, Record, OpenPulse] | None = None
        self._changes: list[CameraChange] = []
        self._asked = [False] * len(rings)
        period = rig.trigger.period_ns
        self.hold_ns = _HOLD_NS + _HOLD_PERIODS * period
        self.pairer = Pairer(len(rings), period, hold_ns=self.hold_ns)
        self.connected = [False] * len(rings)

    def pump(self, now: HostNs) -> list[ClosedPulse]:
        """Take in what the grabbers have queued.

        Returns:
            The pulses that are now decided, in order. The cargo of each is its triplet buffer (None if no frame
            came for it), with the blocks of missing frames black; it is the caller's to release.
        """
        if not self._place_waiting():
            return []
        for camera, ring in enumerate(self._rings):
            while (record := ring.get()) is not None:
                if not self._take(camera, record):
                    return []
        closed = self.pairer.advance(now)
        self._ask_silent_cameras()
        for pulse in closed:
            self._blacken(pulse)
        return closed

    @property
    def backlog(self) -> bool:
        """A frame waits for a free triplet buffer; nobody rings when the disk frees one."""
        return self._waiting is not None

    def changes(self) -> list[CameraChange]:
        """Cameras that came or went since the last call."""
        changes, self._changes = self._changes, []
        return changes

    def disconnected(self, camera: int, reason: str, now: HostNs) -> None:
        """The grabber of a camera is gone without having said so."""
        self._leave(camera, reason, now)

    def camera_tags(self, pulse: ClosedPulse, anchor: UtcAnchor) -> tuple[CameraTag, ...]:
        """The cameras' parts of the pulse's tag."""
        return tuple(self._camera_tags(pulse, anchor))

    def _camera_tags(self, pulse: ClosedPulse, anchor: UtcAnchor) -> Iterator[CameraTag]:
        for name, columns, outcome in zip(self._names, self._columns, pulse.outcomes, strict=True):
            record = outcome.record
            if outcome.status is not FrameStatus.OK or record is None:
                yield CameraTag(name, columns, outcome.status)
                continue
            triggers = None if record.trigger_count < 0 else record.trigger_count
            offset = None if outcome.offset_ns is None else outcome.offset_ns / NS_PER_US
            host = anchor.utc(record.host_time)
            yield CameraTag(
                name, columns, outcome.status, record.frame_id, triggers, record.device_time, host, offset
            )  # fmt: skip

    def _take(self, camera: int, record: Record) -> bool:
        """Handle one record; False if a frame has to wait for a buffer."""
        match record.kind:
            case RecordKind.FRAME:
                return self._frame(camera, record)
            case RecordKind.DAMAGED:
                self.pairer.damaged(camera, record)
            case RecordKind.LATCH:
                self.pairer.latch(camera, ClockLatch(record.device_time, record.host_time, record.value))
            case RecordKind.CONNECTED:
                self.pairer.connected(camera, record.epoch, record.host_time)
                self.connected[camera], self._asked[camera] = True, False
                self._changes.append(CameraChange(camera, True, record.text, record.host_time))
            case RecordKind.DISCONNECTED:
                self._leave(camera, record.text, record.host_time)
        return True

    def _leave(self, camera: int, reason: str, time: HostNs) -> None:
        self.pairer.disconnected(camera, time)
        self.connected[camera] = False
        self._changes.append(CameraChange(camera, False, reason, time))

    def _frame(self, camera: int, record: Record) -> bool:
        pulse = self.pairer.frame(camera, record)
        if pulse is None:
            self._rings[camera].release(record.slot)
            return True
        self._waiting = (camera, record, pulse)
        return self._place_waiting()

    def _place_waiting(self) -> bool:
        """Copy the frame at hand into its triplet; False if there is no buffer for it yet."""
        if self._waiting is None:
            return True
        camera, record, pulse = self._waiting
        if pulse.cargo is None:
            pulse.cargo = self._buffers.acquire()
            if pulse.cargo is None:
                return False
        self._waiting = None
        frame = self._rings[camera].frame(record.slot).reshape(self._shapes[camera])
        np.copyto(self._blocks_of(pulse.cargo)[camera], frame)
        self._rings[camera].release(record.slot)
        return True

    def _blocks_of(self, slot: int) -> list[NDArray[np.uint8]]:
        """Views of the cameras' column blocks of one buffer, made once."""
        if slot not in self._blocks:
            pixels = self._buffers.pixels(slot)
            self._blocks[slot] = [pixels[:, first:end] for first, end in self._columns]
        return self._blocks[slot]

    def _blacken(self, pulse: ClosedPulse) -> None:
        if pulse.cargo is None or all(outcome.status is FrameStatus.OK for outcome in pulse.outcomes):
            return
        for block, outcome in zip(self._blocks_of(pulse.cargo), pulse.outcomes, strict=True):
            if outcome.status is not FrameStatus.OK:
                block.fill(0)

    def _ask_silent_cameras(self) -> None:
        for camera in self.pairer.silent():
            if not self._asked[camera]:
                self._asked[camera] = True
                self._rings[camera].request_reconnect()
