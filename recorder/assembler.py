"""From the cameras' rings to triplets: each frame is copied once, into its column block of its pulse's triplet.

The copy is made the moment the frame arrives, while it is still in the processor's cache, and the camera's slot is
free again at once. If the disk is behind and no triplet buffer is free, frames wait in the cameras' rings.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from recorder.stranded_slots import StrandedSlots
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_US, ClockLatch, HostNs, UtcAnchor, host_now
from rig.frame import FrameStatus, Record, RecordKind, StampedPixels
from rig.ring import CameraRing
from rig.settings import RigSettings
from rig.tag import CameraTag
from triggering.pairing import ClosedPulse, OpenPulse, Pairer

#: A pulse waits for its frames: exposure, transport, Aravis's retention of damaged frames, and some periods.
_HOLD_PERIODS = 4
_HOLD_NS = 130_000_000


def hold_ns(period_ns: int) -> int:
    """How long after a pulse it is decided at the latest, ns."""
    return _HOLD_NS + _HOLD_PERIODS * period_ns


def least_buffers(period_ns: int) -> int:
    """With fewer triplet buffers, pulses that wait for a dead camera could hold all of them."""
    return 2 * (hold_ns(period_ns) // period_ns + 1)


#: Records of a camera that is connected.
_STREAMING = (RecordKind.FRAME, RecordKind.DAMAGED, RecordKind.LATCH)


class CameraState(StrEnum):
    """What a camera has just become."""

    CONNECTED = "connected"
    SILENT = "silent"  #: connected, but three pulses behind the others; its grabber looks after it
    GONE = "gone"
    NOTICE = "notice"  #: nothing has become of it, but people should know


@dataclass(frozen=True, slots=True)
class CameraChange:
    """A camera came, fell silent, or went."""

    camera: int
    state: CameraState
    text: str


class _Composition:
    """Where the frames of a pulse come together: the cargo of its `OpenPulse`.

    Attributes:
        slot: triplet buffer; None while there is none free.
        pending: frames that wait for it in their rings.
    """

    __slots__ = ("pending", "slot")

    def __init__(self) -> None:
        self.slot: int | None = None
        self.pending: list[tuple[int, Record]] = []


@dataclass(frozen=True, slots=True)
class Triplet:
    """A decided pulse with its pixels.

    Attributes:
        pulse: what became of it in every camera.
        slot: triplet buffer, the caller's to release; blocks of missing frames are black. None if no frame came.
    """

    pulse: ClosedPulse
    slot: int | None


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
        self._waiting: list[_Composition] = []
        self._decided: deque[ClosedPulse] = deque()
        self._changes: list[CameraChange] = []
        self._asked = [False] * len(rings)
        self._heard = [False] * len(rings)
        self._stranded = StrandedSlots(rings, host_now())
        period = rig.trigger.period_ns
        self.hold_ns = hold_ns(period)
        self.pairer = Pairer(len(rings), period, hold_ns=self.hold_ns)
        self.connected = [False] * len(rings)

    def pump(self, now: HostNs) -> list[Triplet]:
        """Take in what the grabbers have queued.

        Returns:
            The pulses that are now decided, in order.
        """
        self._serve_waiting()
        for camera in range(len(self._rings)):
            self._read(camera)
        # A camera whose frame waits for a buffer has more to say than we have read: time stands still for the pairing
        # until it is read, or its unread frames would be taken for missing ones.
        waiting = [record.host_time for part in self._waiting for _, record in part.pending]
        self._decided.extend(self.pairer.advance(min(waiting, default=now)))
        self._ask_silent_cameras(now)
        self._stranded.free(now)
        return list(self._ready())

    def _ready(self) -> Iterator[Triplet]:
        """Decided pulses whose frames are all copied, up to the first whose are not."""
        while self._decided:
            part = self._decided[0].cargo
            if isinstance(part, _Composition) and part.pending:
                return
            pulse = self._decided.popleft()
            slot = part.slot if isinstance(part, _Composition) else None
            if slot is not None:
                self._blacken(pulse, slot)
            yield Triplet(pulse, slot)

    @property
    def backlog(self) -> bool:
        """A frame waits for a free triplet buffer; nobody rings when the disk frees one."""
        return bool(self._waiting)

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
            pixels = StampedPixels.from_value(record.value)
            stamped = None if pixels is None else (pixels.row, columns[0] + pixels.column, pixels.count)
            yield CameraTag(
                name, columns, outcome.status, record.frame_id, triggers, record.device_time, host, offset, stamped
            )  # fmt: skip

    def _read(self, camera: int) -> None:
        """Take in what one camera has queued, up to a frame that has to wait for a buffer."""
        ring = self._rings[camera]
        while not self._is_waiting(camera) and (record := ring.get()) is not None:
            if not self._heard[camera]:
                self._hear_first(camera, record)
            if record.kind is not RecordKind.FRAME:
                self._note(camera, record)
                continue
            self._stranded.named(camera, record.slot)
            if (pulse := self.pairer.frame(camera, record)) is None:
                ring.release(record.slot)
            else:
                self._place(camera, record, pulse)

    def _hear_first(self, camera: int, record: Record) -> None:
        """A camera not heard of from its connection on was there before this recorder, which took another's place."""
        self._heard[camera] = record.kind in (*_STREAMING, RecordKind.CONNECTED, RecordKind.DISCONNECTED)
        if record.kind in _STREAMING:
            self._join(camera, record, "streaming since before the recorder was started")

    def _join(self, camera: int, record: Record, text: str) -> None:
        self.pairer.connected(camera, record.epoch, record.host_time)
        self.connected[camera] = True
        self._changes.append(CameraChange(camera, CameraState.CONNECTED, text))

    def _is_waiting(self, camera: int) -> bool:
        return any(camera == waiting for part in self._waiting for waiting, _ in part.pending)

    def _note(self, camera: int, record: Record) -> None:
        """Handle a record that is no frame."""
        match record.kind:
            case RecordKind.DAMAGED:
                self.pairer.damaged(camera, record)
            case RecordKind.LATCH:
                self.pairer.latch(camera, ClockLatch(record.device_time, record.host_time, record.value))
            case RecordKind.CONNECTED:
                self._join(camera, record, record.text)
            case RecordKind.DISCONNECTED:
                self._leave(camera, record.text, record.host_time)
            case RecordKind.NOTICE:
                self._changes.append(CameraChange(camera, CameraState.NOTICE, record.text))

    def _leave(self, camera: int, reason: str, time: HostNs) -> None:
        self.pairer.disconnected(camera, time)
        self.connected[camera] = False
        self._changes.append(CameraChange(camera, CameraState.GONE, reason))

    def _place(self, camera: int, record: Record, pulse: OpenPulse) -> None:
        """Copy a frame into its triplet, or let it wait until there is a buffer for it."""
        part = pulse.cargo
        if not isinstance(part, _Composition):
            part = pulse.cargo = _Composition()
            part.slot = self._buffers.acquire()
        if part.slot is not None:
            self._copy(camera, record, part.slot)
            return
        part.pending.append((camera, record))
        if part not in self._waiting:
            self._waiting.append(part)

    def _serve_waiting(self) -> None:
        """Give buffers that have become free to the pulses that wait for one, in the order in which they came."""
        while self._waiting and (slot := self._buffers.acquire()) is not None:
            part = self._waiting.pop(0)
            part.slot = slot
            for camera, record in part.pending:
                self._copy(camera, record, slot)
            part.pending.clear()

    def _copy(self, camera: int, record: Record, slot: int) -> None:
        frame = self._rings[camera].frame(record.slot).reshape(self._shapes[camera])
        np.copyto(self._blocks_of(slot)[camera], frame)
        self._rings[camera].release(record.slot)

    def _blocks_of(self, slot: int) -> list[NDArray[np.uint8]]:
        """Views of the cameras' column blocks of one buffer, made once."""
        if slot not in self._blocks:
            pixels = self._buffers.pixels(slot)
            self._blocks[slot] = [pixels[:, first:end] for first, end in self._columns]
        return self._blocks[slot]

    def _blacken(self, pulse: ClosedPulse, slot: int) -> None:
        for block, outcome in zip(self._blocks_of(slot), pulse.outcomes, strict=True):
            if outcome.status is not FrameStatus.OK:
                block.fill(0)

    def _ask_silent_cameras(self, now: HostNs) -> None:
        """Once per silence, ask the grabber to look after its camera."""
        silent = {*self.pairer.silent(), *self.pairer.overdue(now)}
        for camera, ring in enumerate(self._rings):
            if camera in silent and not self._asked[camera]:
                ring.request_reconnect()
                text = "three pulses behind the other cameras; looking after it"
                self._changes.append(CameraChange(camera, CameraState.SILENT, text))
            self._asked[camera] = camera in silent
