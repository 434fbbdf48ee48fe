"""Makes triplets of the cameras' frames: reads the rings, has the frames paired by pulse and copied together."""

from collections import deque
from collections.abc import Sequence
from typing import Final

from recorder.live.camera_news import CamerasWatch
from recorder.live.composer import Composer, Triplet
from recorder.log.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.frame import FrameRecord
from rig.settings.model import RigSettings
from rig.transport.ring import CameraRing
from triggering.pairing.pairer import ClosedPulse, Pairer
from triggering.sources.choice import trigger_source

#: A pulse waits for its frames: exposure, transport, Aravis's retention of damaged frames, and some periods.
_HOLD_PERIODS: Final = 4
_HOLD_NS: Final = 130_000_000
#: A grabber needs less than this from handing a slot over to queueing the record that names it.
_STRANDED_NS: Final = NS_PER_S


def hold_ns(period_ns: int) -> int:
    """The longest time from a pulse to the decision what became of it, ns."""
    return _HOLD_NS + _HOLD_PERIODS * period_ns


def least_buffers(period_ns: int) -> int:
    """Least number of triplet buffers: with fewer, pulses that wait for a dead camera could hold all of them."""
    return 2 * (hold_ns(period_ns) // period_ns + 1)


def in_flight_triplets(rig: RigSettings) -> int:
    """Number of triplet buffers for pulses on their way from the cameras to the disk."""
    return max(least_buffers(rig.trigger.period_ns), round(rig.recorder.triplets_s * rig.trigger.rate_hz))


class _StrandedSlots:
    """Slots that no record names, left by a recorder that died: nobody else would ever free them.

    A grabber may just be about to queue the record of such a slot, so the slot is freed only if none has come until
    then.
    """

    def __init__(self, rings: Sequence[CameraRing]) -> None:
        self._rings = rings
        self._slots = [ring.queued_slots() - ring.unread_slots() for ring in rings]
        self._until = host_now() + _STRANDED_NS

    def named(self, camera: int, slot: int) -> None:
        """Note that a record names a slot."""
        self._slots[camera].discard(slot)

    def free(self, now: HostNs) -> None:
        """Free the slots as soon as it is certain which ones these are."""
        if now < self._until:
            return
        for ring, slots in zip(self._rings, self._slots, strict=True):
            while slots:
                ring.release(slots.pop())


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
        cameras: whether the cameras are there.
        hold_ns: the longest time from a pulse to its decision, ns.
        settled: `pump` has returned every pulse that fired `hold_ns` before this time or earlier.
    """

    def __init__(
        self, rig: RigSettings, rings: Sequence[CameraRing], buffers: TripletBuffers, epoch: HostNs = HostNs(0)
    ) -> None:
        self.rig, self.buffers, self._rings = rig, buffers, rings
        self._stranded = _StrandedSlots(rings)
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
        self.cameras = CamerasWatch([camera.name for camera in rig.cameras], rings, self.pairer)
        self._composer = Composer(rig, rings, buffers)
        self._decided: deque[ClosedPulse] = deque()
        self.settled = HostNs(0)
        self._keeping_up_since: HostNs | None = HostNs(0)

    @property
    def backlog(self) -> bool:
        """Whether a frame waits for a free triplet buffer; no doorbell rings when the disk frees one."""
        return self._composer.backlog

    def pump(self, now: HostNs) -> list[Triplet]:
        """Read the records that the grabbers have queued, and copy their frames.

        Args:
            now: present time of the host's clock.

        Returns:
            The pulses that are now decided, in order.
        """
        self._composer.serve_waiting(self.pairer.open, self._decided)
        for camera in range(len(self._rings)):
            self._read(camera)
        # A camera whose frame waits for a buffer has unread records. The pairer must not see a later time than that
        # frame's, or it would take the unread frames for missing ones.
        waiting = self._composer.waiting_since()
        # Frames that wait to be accepted hold buffers for which others wait: their wait ends in real time.
        self._place_released(now)
        self._decided.extend(self.pairer.advance(now if waiting is None else waiting))
        self.cameras.look(now)
        self._stranded.free(now)
        ready = []
        while self._decided and (triplet := self._composer.finished(self._decided[0])) is not None:
            self._decided.popleft()
            ready.append(triplet)
        self._settle(now)
        return ready

    def _settle(self, now: HostNs) -> None:
        """Find up to which time every pulse has been returned.

        While frames waited for buffers the rings may have overflowed. The ids of the next frames tell which pulses were
        lost, so those frames are waited for.
        """
        if self.backlog or self._decided:
            self._keeping_up_since = None
        elif self._keeping_up_since is None:
            self._keeping_up_since = now
        if self._keeping_up_since is not None and now >= self._keeping_up_since + self.hold_ns:
            oldest = self.pairer.oldest
            self.settled = now if oldest is None else min(now, HostNs(oldest + self.hold_ns))

    def _read(self, camera: int) -> None:
        """Read the records of one camera, up to a frame that has to wait for a buffer."""
        ring = self._rings[camera]
        while not self._composer.keeps_waiting(camera) and (record := ring.get()) is not None:
            self.cameras.hear(camera, record)
            if not isinstance(record, FrameRecord):
                continue
            self._stranded.named(camera, record.slot)
            if (pulse := self.pairer.frame(camera, record)) is not None:
                self._composer.place(camera, record, pulse)
            elif not self.pairer.holds(camera, record):
                ring.release(record.slot)

    def _place_released(self, now: HostNs) -> None:
        """Copy or drop the frames that have waited in their rings until their trigger times were judged."""
        for camera, record, pulse in self.pairer.released(now):
            if pulse is None:
                self._rings[camera].release(record.slot)
            else:
                self._composer.place(camera, record, pulse)
