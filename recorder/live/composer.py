"""Copies the frames of a pulse together in a triplet buffer: each frame once, into the column block of its camera.

A frame is copied as soon as it arrives, while it is still in the processor's cache, and its camera's slot is free at
once. If the disk is behind and no triplet buffer is free, frames wait in the cameras' rings.

Triplets are handed on in the order of their pulses. So the oldest pulses have the buffers: later ones could hold all of
them, and be handed on only behind a pulse that waits for one.
"""

from bisect import insort
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter
from typing import Final

from recorder.live.unpacking import unpacker
from recorder.log.triplet_buffers import TripletBuffers
from rig.clocks import HostNs
from rig.frame import FrameRecord, FrameStatus
from rig.images.pixels import Stored
from rig.settings.model import RigSettings
from rig.transport.ring import CameraRing
from triggering.pairing.pairer import ClosedPulse, OpenPulse


class _Composition:
    """The triplet of a pulse while its frames are copied together: the cargo of its `OpenPulse`.

    Attributes:
        time: of the pulse, when its first frame came.
        slot: triplet buffer; None as long as no buffer is free.
        pending: camera and record of the frames that wait for the buffer in their rings.
        aside: what was copied together in a buffer that an older pulse had to get.
    """

    __slots__ = ("aside", "pending", "slot", "time")

    def __init__(self, time: HostNs) -> None:
        self.time = time
        self.slot: int | None = None
        self.pending: list[tuple[int, FrameRecord]] = []
        self.aside: Stored | None = None


_TIME: Final = attrgetter("time")


@dataclass(frozen=True, slots=True)
class Triplet:
    """A decided pulse with its pixels.

    Attributes:
        pulse: what became of the pulse in every camera.
        slot: triplet buffer, which the caller releases; blocks of missing frames are black. None if no frame came.
    """

    pulse: ClosedPulse
    slot: int | None


class Composer:
    """Composes triplets.

    Args:
        rig: the rig.
        rings: one per camera, in the rig's order.
        buffers: memory in which the triplets are composed.
    """

    def __init__(self, rig: RigSettings, rings: Sequence[CameraRing], buffers: TripletBuffers) -> None:
        self._rings, self._buffers = rings, buffers
        self._columns = rig.columns()
        self._rows = [camera.region.height for camera in rig.cameras]
        self._unpack = [unpacker(camera) for camera in rig.cameras]
        self._blocks: dict[int, list[Stored]] = {}
        self._waiting: list[_Composition] = []

    @property
    def backlog(self) -> bool:
        """Whether a frame waits for a free triplet buffer."""
        return bool(self._waiting)

    def keeps_waiting(self, camera: int) -> bool:
        """Whether a frame of a camera waits for a free triplet buffer."""
        return any(camera == waiting for part in self._waiting for waiting, _ in part.pending)

    def waiting_since(self) -> HostNs | None:
        """When the first of the frames came that wait for a free triplet buffer; None: none waits."""
        return min((record.host_time for part in self._waiting for _, record in part.pending), default=None)

    def place(self, camera: int, record: FrameRecord, pulse: OpenPulse) -> None:
        """Copy a frame into its triplet, or let it wait in its ring until a buffer is free."""
        part = pulse.cargo
        if not isinstance(part, _Composition):
            part = pulse.cargo = _Composition(pulse.time)
            # One that has just become free is of the pulse that waits for it: later ones could take them all, and be
            # written only behind it.
            part.slot = None if self._waiting else self._buffers.acquire()
        if part.slot is not None:
            self._copy(camera, record, part.slot)
            return
        part.pending.append((camera, record))
        self._wait(part)

    def serve_waiting(self, undecided: Sequence[OpenPulse], decided: Sequence[ClosedPulse]) -> None:
        """Give buffers to the pulses that wait for one, the oldest first.

        Args:
            undecided: pulses in the order of time, the last ones.
            decided: those before them that are not handed on yet.
        """
        while self._waiting:
            part = self._waiting[0]
            slot = self._buffers.acquire()
            if slot is None:
                slot = self._taken_from_later(part, chain(reversed(undecided), reversed(decided)))
            if slot is None:
                return
            self._waiting.remove(part)
            part.slot = slot
            if part.aside is not None:
                self._buffers.write(slot, part.aside)
                part.aside = None
            for camera, record in part.pending:
                self._copy(camera, record, slot)
            part.pending.clear()

    def finished(self, pulse: ClosedPulse) -> Triplet | None:
        """The triplet of a decided pulse; None as long as a frame of it waits for a buffer."""
        part = pulse.cargo
        if not isinstance(part, _Composition):
            return Triplet(pulse, None)
        if part.slot is None:
            return None
        for block, outcome in zip(self._blocks_of(part.slot), pulse.outcomes, strict=True):
            if outcome.status is not FrameStatus.OK:
                block.fill(0)
        return Triplet(pulse, part.slot)

    def _wait(self, part: _Composition) -> None:
        if part not in self._waiting:
            insort(self._waiting, part, key=_TIME)

    def _taken_from_later(self, part: _Composition, latest: Iterator[OpenPulse | ClosedPulse]) -> int | None:
        """The buffer of the latest pulse behind that of `part`, whose pixels are put aside; None: none behind has one.

        It happens only where a camera's frames come much later than those of the others, which lost some: no memory is
        kept ready for it.
        """
        for later in latest:
            if later.cargo is part:
                break
            if isinstance(later.cargo, _Composition) and (slot := later.cargo.slot) is not None:
                later.cargo.aside, later.cargo.slot = self._buffers.pixels(slot).copy(), None
                self._wait(later.cargo)
                return slot
        return None

    def _copy(self, camera: int, record: FrameRecord, slot: int) -> None:
        self._unpack[camera](self._rings[camera].frame(record.slot), self._blocks_of(slot)[camera])
        self._rings[camera].release(record.slot)

    def _blocks_of(self, slot: int) -> list[Stored]:
        """Views of the cameras' frames in one buffer, made once; nobody ever writes what is below a low one."""
        if slot not in self._blocks:
            blocks = (self._buffers.block(slot, columns) for columns in self._columns)
            self._blocks[slot] = [block[:rows] for block, rows in zip(blocks, self._rows, strict=True)]
        return self._blocks[slot]
