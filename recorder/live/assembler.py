"""Makes triplets of the cameras' frames: copies each frame once, into its column block of its pulse's triplet.

The assembler copies a frame as soon as it arrives, while the frame is still in the processor's cache, and frees the
camera's slot at once. If the disk is behind and no triplet buffer is free, frames wait in the cameras' rings.

Triplets are handed on in the order of their pulses. So the oldest pulses have the buffers: later ones could hold all of
them, and be handed on only behind a pulse that waits for one.
"""

from bisect import insort
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import attrgetter
from typing import Final

from msgspec import UNSET

from recorder.live.unpacking import unpacker
from recorder.log.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, NS_PER_US, HostNs, UtcAnchor, host_now
from rig.doctor_call import with_rig_in_use
from rig.frame import (
    ConnectedRecord,
    DamagedRecord,
    DisconnectedRecord,
    FrameRecord,
    FrameStatus,
    LatchRecord,
    LimitsRecord,
    NoticeRecord,
    Record,
)
from rig.images.pixels import Stored
from rig.phrase import Phrase, phrase, plain
from rig.settings.model import RigSettings
from rig.settings.region import RegionLimits
from rig.tag import CameraTag
from rig.transport.recorder_reports import CameraChanged, CameraLimits, CameraNews
from rig.transport.ring import CameraRing
from triggering.pairing.pairer import ClosedPulse, OpenPulse, Pairer
from triggering.sources.choice import trigger_source

#: A pulse waits for its frames: exposure, transport, Aravis's retention of damaged frames, and some periods.
_HOLD_PERIODS: Final = 4
_HOLD_NS: Final = 130_000_000
#: A grabber needs less than this from handing a slot over to queueing the record that names it.
_STRANDED_NS: Final = NS_PER_S
#: A camera whose frames come too late is told of so often at most, and when they have for so long: if the computer is
#: too slow, they come too late from the other cameras too by then.
_TELL_SLOW_NS: Final = 10 * NS_PER_S
_SURELY_SLOW_NS: Final = NS_PER_S


def hold_ns(period_ns: int) -> int:
    """The longest time from a pulse to the decision what became of it, ns."""
    return _HOLD_NS + _HOLD_PERIODS * period_ns


def least_buffers(period_ns: int) -> int:
    """Least number of triplet buffers: with fewer, pulses that wait for a dead camera could hold all of them."""
    return 2 * (hold_ns(period_ns) // period_ns + 1)


def in_flight_triplets(rig: RigSettings) -> int:
    """Number of triplet buffers for pulses on their way from the cameras to the disk."""
    return max(least_buffers(rig.trigger.period_ns), round(rig.recorder.triplets_s * rig.trigger.rate_hz))


#: Kinds of records that only a connected camera makes.
_STREAMING: Final = (FrameRecord, DamagedRecord, LatchRecord)


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


class Assembler:
    """Reads the rings, pairs frames by pulse, composes the triplets.

    Args:
        rig: the rig.
        rings: one per camera, in the rig's order.
        buffers: memory in which the triplets are composed.
        epoch: host time from which the trigger source counts its pulses, as the grabbers know it.

    Attributes:
        rig: as given.
        buffers: as given.
        pairer: decides which frame belongs to which pulse.
        hold_ns: the longest time from a pulse to its decision, ns.
        connected: for each camera, whether it is connected.
        settled: `pump` has returned every pulse that fired `hold_ns` before this time or earlier.
    """

    def __init__(
        self, rig: RigSettings, rings: Sequence[CameraRing], buffers: TripletBuffers, epoch: HostNs = HostNs(0)
    ) -> None:
        self.rig, self.buffers, self._rings = rig, buffers, rings
        self._names = [camera.name for camera in rig.cameras]
        self._columns = rig.columns()
        self._rows = [camera.region.height for camera in rig.cameras]
        self._low = [UNSET if rows == rig.triplet_shape[0] else rows for rows in self._rows]
        self._unpack = [unpacker(camera) for camera in rig.cameras]
        self._blocks: dict[int, list[Stored]] = {}
        self._waiting: list[_Composition] = []
        self._decided: deque[ClosedPulse] = deque()
        self._changes: list[CameraChanged] = []
        self._limits: list[CameraLimits] = []
        self._asked = [False] * len(rings)
        self._slow_told = [HostNs(-_TELL_SLOW_NS)] * len(rings)
        self._slow_since: dict[int, HostNs] = {}
        self._heard = [False] * len(rings)
        # A recorder that died may have left slots that no record names, which nobody would ever free. A grabber may
        # just be about to queue the record of such a slot, so the slot is freed only if none has come until then.
        self._stranded = [ring.queued_slots() - ring.unread_slots() for ring in rings]
        self._stranded_at = HostNs(host_now() + _STRANDED_NS)
        period = rig.trigger.period_ns
        self.hold_ns = hold_ns(period)
        source = trigger_source(rig.trigger)
        commands = source.commands(epoch) or source.sent(epoch)
        self.pairer = Pairer(
            len(rings),
            period,
            hold_ns=self.hold_ns,
            spread_ns=source.spread_ns,
            exposes=None if commands is None else commands.exposes,
            # The others say themselves when an exposure began.
            exposures_ns=[round(each.exposure_us * 1000) * (each.backend == "aravis") for each in rig.cameras],
        )
        self.connected = [False] * len(rings)
        self._were_there = [False] * len(rings)
        self.settled = HostNs(0)
        self._keeping_up_since: HostNs | None = HostNs(0)

    def pump(self, now: HostNs) -> list[Triplet]:
        """Read the records that the grabbers have queued, and copy their frames.

        Args:
            now: present time of the host's clock.

        Returns:
            The pulses that are now decided, in order.
        """
        self._serve_waiting()
        for camera in range(len(self._rings)):
            self._read(camera)
        # A camera whose frame waits for a buffer has unread records. The pairer must not see a later time than that
        # frame's, or it would take the unread frames for missing ones.
        waiting = [record.host_time for part in self._waiting for _, record in part.pending]
        until = min(waiting, default=now)
        # Frames that wait to be believed hold buffers for which others wait: their wait ends in real time.
        self._place_released(now)
        self._decided.extend(self.pairer.advance(until))
        self._ask_silent_cameras(now)
        self._tell_slow_cameras(now)
        self._free_stranded_slots(now)
        ready = list(self._ready())
        self._settle(now)
        return ready

    def _settle(self, now: HostNs) -> None:
        """Find up to which time every pulse has been returned.

        While frames waited for buffers the rings may have overflowed. The ids of the frames that come after that tell
        which pulses were lost, so those are waited for.
        """
        if self._waiting or self._decided:
            self._keeping_up_since = None
        elif self._keeping_up_since is None:
            self._keeping_up_since = now
        if self._keeping_up_since is not None and now >= self._keeping_up_since + self.hold_ns:
            oldest = self.pairer.oldest
            self.settled = now if oldest is None else min(now, HostNs(oldest + self.hold_ns))

    def _ready(self) -> Iterator[Triplet]:
        """The decided pulses up to the first one of which a frame is not copied yet."""
        while self._decided:
            part, slot = self._decided[0].cargo, None
            if isinstance(part, _Composition):
                slot = part.slot
                if slot is None:
                    return
                self._blacken(self._decided[0], slot)
            yield Triplet(self._decided.popleft(), slot)

    @property
    def backlog(self) -> bool:
        """Whether a frame waits for a free triplet buffer; no doorbell rings when the disk frees one."""
        return bool(self._waiting)

    def changes(self) -> list[CameraChanged]:
        """What cameras have become since the last call: connected, silent, absent, gone."""
        changes, self._changes = self._changes, []
        return changes

    def limits(self) -> list[CameraLimits]:
        """Which regions cameras take that were connected since the last call."""
        limits, self._limits = self._limits, []
        return limits

    def disconnected(self, camera: int, reason: Phrase, time: HostNs) -> None:
        """Note that a camera is not there: its grabber says so, or the grabber died without a record of it."""
        self.pairer.disconnected(camera, time)
        self.connected[camera] = False
        news = CameraNews.GONE if self._were_there[camera] else CameraNews.ABSENT
        self._changes.append(CameraChanged(camera=camera, news=news, said=reason))

    def camera_tags(self, pulse: ClosedPulse, anchor: UtcAnchor) -> tuple[CameraTag, ...]:
        """The cameras' parts of a pulse's tag.

        Args:
            pulse: a decided pulse.
            anchor: the recording's relation of host time to UTC.
        """
        return tuple(self._camera_tags(pulse, anchor))

    def _camera_tags(self, pulse: ClosedPulse, anchor: UtcAnchor) -> Iterator[CameraTag]:
        cameras = zip(self._names, self._columns, self._low, pulse.outcomes, strict=True)
        for name, columns, rows, outcome in cameras:
            record = outcome.record
            if outcome.status is not FrameStatus.OK or record is None:
                yield CameraTag(name, columns, outcome.status, rows=rows)
                continue
            triggers = None if record.trigger_count < 0 else record.trigger_count
            offset = None if outcome.offset_ns is None else outcome.offset_ns / NS_PER_US
            host = anchor.utc(record.host_time)
            pixels = record.stamped
            stamped = UNSET if pixels is None else (pixels.row, columns[0] + pixels.column, pixels.count)
            yield CameraTag(
                name, columns, outcome.status, record.frame_id, triggers, record.device_time, host, offset, stamped,
                rows,
            )  # fmt: skip

    def _read(self, camera: int) -> None:
        """Read the records of one camera, up to a frame that has to wait for a buffer."""
        ring = self._rings[camera]
        while not self._is_waiting(camera) and (record := ring.get()) is not None:
            if not self._heard[camera]:
                self._hear_first(camera, record)
            if not isinstance(record, FrameRecord):
                self._note(camera, record)
                continue
            self._stranded[camera].discard(record.slot)
            if (pulse := self.pairer.frame(camera, record)) is not None:
                self._place(camera, record, pulse)
            elif not self.pairer.holds(camera, record):
                ring.release(record.slot)

    def _place_released(self, now: HostNs) -> None:
        """Copy or drop the frames that have waited in their rings until their trigger times could be believed."""
        for camera, record, pulse in self.pairer.released(now):
            if pulse is None:
                self._rings[camera].release(record.slot)
            else:
                self._place(camera, record, pulse)

    def _hear_first(self, camera: int, record: Record) -> None:
        """If the first record is of a streaming camera, this recorder has replaced one that crashed."""
        self._heard[camera] = isinstance(record, (*_STREAMING, ConnectedRecord, DisconnectedRecord))
        if isinstance(record, _STREAMING):
            text = "streaming since before the recorder was started"
            self._join(camera, record, phrase("camera_streaming_before", text))

    def _join(self, camera: int, record: Record, said: Phrase) -> None:
        self.pairer.connected(camera, record.epoch, record.host_time)
        self.connected[camera] = self._were_there[camera] = True
        self._changes.append(CameraChanged(camera=camera, news=CameraNews.CONNECTED, said=said))

    def _is_waiting(self, camera: int) -> bool:
        return any(camera == waiting for part in self._waiting for waiting, _ in part.pending)

    def _note(self, camera: int, record: Record) -> None:
        """Handle a record that is not of a whole frame."""
        match record:
            case DamagedRecord():
                self.pairer.damaged(camera, record)
            case LatchRecord():
                self.pairer.latch(camera, record.latch)
            case ConnectedRecord():
                self._join(camera, record, plain(record.text))
            case DisconnectedRecord():
                self.disconnected(camera, plain(with_rig_in_use(record.text)), record.host_time)
            case LimitsRecord():
                limits = RegionLimits.model_validate_json(record.text)
                self._limits.append(CameraLimits(camera=camera, limits=limits))
            case NoticeRecord():
                self._changes.append(
                    CameraChanged(camera=camera, news=CameraNews.NOTICE, said=plain(with_rig_in_use(record.text)))
                )

    def _place(self, camera: int, record: FrameRecord, pulse: OpenPulse) -> None:
        """Copy a frame into its triplet, or let it wait in its ring until a buffer is free."""
        part = pulse.cargo
        if not isinstance(part, _Composition):
            part = pulse.cargo = _Composition(pulse.time)
            # One that has just become free is of the pulse that waits for it: later ones could take them all, and be
            # written only behind it.
            part.slot = None if self._waiting else self.buffers.acquire()
        if part.slot is not None:
            self._copy(camera, record, part.slot)
            return
        part.pending.append((camera, record))
        self._wait(part)

    def _wait(self, part: _Composition) -> None:
        if part not in self._waiting:
            insort(self._waiting, part, key=_TIME)

    def _serve_waiting(self) -> None:
        """Give buffers to the pulses that wait for one, the oldest first."""
        while self._waiting:
            part = self._waiting[0]
            slot = self.buffers.acquire()
            if slot is None:
                slot = self._taken_from_later(part)
            if slot is None:
                return
            self._waiting.remove(part)
            part.slot = slot
            if part.aside is not None:
                self.buffers.write(slot, part.aside)
                part.aside = None
            for camera, record in part.pending:
                self._copy(camera, record, slot)
            part.pending.clear()

    def _taken_from_later(self, part: _Composition) -> int | None:
        """The buffer of the latest pulse behind that of `part`, whose pixels are put aside; None: none behind has one.

        It happens only where a camera's frames come much later than those of the others, which lost some: no memory is
        kept ready for it.
        """
        behind: Iterator[OpenPulse | ClosedPulse] = chain(reversed(self.pairer.open), reversed(self._decided))
        for later in behind:
            if later.cargo is part:
                break
            if isinstance(later.cargo, _Composition) and (slot := later.cargo.slot) is not None:
                later.cargo.aside, later.cargo.slot = self.buffers.pixels(slot).copy(), None
                self._wait(later.cargo)
                return slot
        return None

    def _copy(self, camera: int, record: FrameRecord, slot: int) -> None:
        self._unpack[camera](self._rings[camera].frame(record.slot), self._blocks_of(slot)[camera])
        self._rings[camera].release(record.slot)

    def _blocks_of(self, slot: int) -> list[Stored]:
        """Views of the cameras' frames in one buffer, made once; nobody ever writes what is below a low one."""
        if slot not in self._blocks:
            blocks = (self.buffers.block(slot, columns) for columns in self._columns)
            self._blocks[slot] = [block[:rows] for block, rows in zip(blocks, self._rows, strict=True)]
        return self._blocks[slot]

    def _blacken(self, pulse: ClosedPulse, slot: int) -> None:
        for block, outcome in zip(self._blocks_of(slot), pulse.outcomes, strict=True):
            if outcome.status is not FrameStatus.OK:
                block.fill(0)

    def _free_stranded_slots(self, now: HostNs) -> None:
        """Free the slots that a recorder which died had in hand, as soon as it is certain which ones these are."""
        if now < self._stranded_at:
            return
        for ring, slots in zip(self._rings, self._stranded, strict=True):
            while slots:
                ring.release(slots.pop())

    def _ask_silent_cameras(self, now: HostNs) -> None:
        """Once per silence, ask the grabber to connect its camera again."""
        silent = {*self.pairer.silent(), *self.pairer.overdue(now)}
        for camera, ring in enumerate(self._rings):
            if camera in silent and not self._asked[camera]:
                ring.request_reconnect()
                said = phrase("camera_behind", "three pulses behind the other cameras; looking after it")
                if self.connected.count(True) <= len(silent):
                    said = phrase("camera_mute", "the source fires, and it does not answer; looking after it")
                self._changes.append(CameraChanged(camera=camera, news=CameraNews.SILENT, said=said))
            self._asked[camera] = camera in silent

    def _tell_slow_cameras(self, now: HostNs) -> None:
        """Say that a camera's frames come after their pulses are decided; people would look at its trigger cable."""
        slow = self.pairer.slow(now)
        self._slow_since = {camera: self._slow_since.get(camera, now) for camera in slow}
        for camera, since in self._slow_since.items():
            if now >= max(since + _SURELY_SLOW_NS, self._slow_told[camera] + _TELL_SLOW_NS):
                self._slow_told[camera] = now
                late_ms = self.pairer.lag_ms(camera)
                others = ", ".join(self._names[other] for other in slow if other != camera)
                text = "its frames come too late, {late_ms:.0f} ms after the usual time: the link is too slow for them"
                said = phrase("camera_late", text, late_ms=late_ms)
                if others:
                    together = (
                        "its frames come too late, {late_ms:.0f} ms after the usual time, like those of {others}: this "
                        "computer or the link they share is too slow"
                    )
                    said = phrase("camera_late_together", together, late_ms=late_ms, others=others)
                self._changes.append(CameraChanged(camera=camera, news=CameraNews.NOTICE, said=said))
