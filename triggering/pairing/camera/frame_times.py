"""Trigger times of the frames of one camera on the common time line, and whether they are plausible.

The time of a frame follows from the camera's clock. The clock may have been set since the frame was taken, and some
cameras note the end of the exposure instead of the beginning (`triggering.timeline.stamping`).
"""

from collections.abc import Sequence
from enum import Enum

from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import FrameRecord
from triggering.pairing.camera.arrivals import Arrivals
from triggering.pairing.camera.frame_ids import id_step
from triggering.pairing.camera.plausibility import Others, Plausibility, Timed, Verdict
from triggering.timeline.device_clock import DeviceClock
from triggering.timeline.pulse_train import PulseTrain
from triggering.timeline.stamping import Stamping


class Unusable(Enum):
    """Why a whole frame cannot be used."""

    CLOCK_UNKNOWN = "clock unknown"  #: the clock has not been read, or not exactly enough for a first frame
    REJECTED = "rejected"  #: its trigger time is after its arrival
    UNSETTLED = "unsettled"  #: the clock was set around its arrival, or its time may be that of the exposure's end


class FrameTimes:
    """The clock of one camera, and the judgement of the times that follow from it.

    Args:
        train: the rhythm of the pulses.
        exposure_ns: exposure of the camera; 0: the times of its frames are those of the beginning of the exposure.

    Attributes:
        clock: the camera's clock in this epoch.
        arrivals: how long after their triggers the accepted frames came.
        stamping: which end of the exposure the camera notes.
        plausibility: judges whether the times of frames are plausible.
        set_at: host time at which the clock was last found to have been set; None: never.
    """

    def __init__(self, train: PulseTrain, exposure_ns: int) -> None:
        self._train = train
        self.clock, self.stamping = DeviceClock(), Stamping(train, exposure_ns)
        self.arrivals = Arrivals(train)
        self.plausibility = Plausibility(train, self.arrivals)
        self.set_at: HostNs | None = None
        self._confirmed: ClockLatch | None = None  # the last reading of the clock that agrees with those before
        self._unsettled_until = HostNs(0)  # frames that come before may have the time of a clock that is no more

    def begin(self, *, clock_unknown: bool) -> None:
        """Begin an epoch; the first one keeps the readings of the clock so far."""
        if clock_unknown:  # exposure or region may be others now, and so the latencies
            self.clock = DeviceClock()
            self.arrivals.forget()
        self.plausibility.doubted = 0
        self._confirmed = None

    def latch(self, latch: ClockLatch) -> bool:
        """Enter a reading of the camera's clock.

        Returns:
            Whether the times of frames before and after it can be compared.
        """
        steps = self.clock.steps
        agrees = self.clock.latch(latch)
        if agrees and latch.round_trip_ns < self._train.rhythm.shortest_ns:
            self._confirmed = latch
        if stepped := self.clock.steps != steps:
            self._confirmed, self.plausibility.doubted = None, 0
            self.set_at = latch.host
            self._unsettled_until = HostNs(latch.host + round(self.arrivals.longest_ns))
        return not (self.stamping.confirmed(agrees=agrees) or stepped)

    def trigger_time(self, device: DeviceNs) -> HostNs:
        """When the exposure of a frame began on the common time line, by its device time."""
        return HostNs(self.clock.to_host(device) - self.stamping.late_ns)

    def locate(self, record: FrameRecord, *, first: bool) -> HostNs | Unusable:
        """Trigger time of a whole frame on the common time line, or why the frame cannot be used.

        Args:
            record: the frame.
            first: no frame before it can be compared with it.
        """
        clock, device, arrival = self.clock, record.device_time, record.host_time
        if not clock.known:
            return Unusable.CLOCK_UNKNOWN
        uncertainty_ns = clock.uncertainty_at(device)
        if first and uncertainty_ns > self._train.widest_ns / 2:
            return Unusable.CLOCK_UNKNOWN
        time = self.trigger_time(device)
        if arrival <= self._unsettled_until:
            return Unusable.UNSETTLED
        early_ns = min(max(self._train.tolerance_ns, 2 * uncertainty_ns), self._train.widest_ns)
        if time > arrival + early_ns:  # no frame comes before its trigger
            return Unusable.REJECTED
        return Unusable.UNSETTLED if self.stamping.contradicts(time, arrival, 2 * uncertainty_ns) else time

    def judge(
        self, last: tuple[FrameRecord, HostNs] | None, waiting: Sequence[FrameRecord], others: Others, *, final: bool
    ) -> Verdict:
        """Judge the first of the whole frames that wait.

        Args:
            last: the last accepted frame of this epoch and its trigger time; None: there is none.
            waiting: the frames, in the order of their arrival.
            others: the frames of the other cameras.
            final: no more evidence can be waited for.
        """
        before, last_time = last or (None, None)
        if before is not None and _is_same(before, waiting[0]):
            return Verdict.ACCEPTED
        timed = []
        for record in waiting:
            timed.append(_timed(before, record, self.trigger_time(record.device_time)))
            before = record
        return self.plausibility.judge(last_time, timed, read=self._is_read(waiting[0]), others=others, final=final)

    def judge_new(
        self, last: tuple[FrameRecord, HostNs] | None, record: FrameRecord, time: HostNs, others: Others
    ) -> Verdict:
        """As `judge`, for a frame that has just come, while none waits.

        Args:
            last: the last accepted frame of this epoch and its trigger time; None: there is none.
            record: the frame.
            time: its trigger time.
            others: the frames of the other cameras.
        """
        before, last_time = last or (None, None)
        if before is not None and _is_same(before, record):
            return Verdict.ACCEPTED
        timed = (_timed(before, record, time),)
        return self.plausibility.judge(last_time, timed, read=self._is_read(record), others=others)

    @property
    def latency_change_ns(self) -> float | None:
        """By how much the last frames all came later than usual; None: nobody knows, or the clock may have been set."""
        return None if self._confirmed is None else self.arrivals.change_ns(self._confirmed.host)

    def learn_latencies_anew(self) -> None:
        """Doubt the camera no longer: its frames come later or sooner than before, all else agrees."""
        self.arrivals.forget()
        self.plausibility.doubted = 0

    def _is_read(self, record: FrameRecord) -> bool:
        """Whether the clock has been read after a frame, and goes on as it did."""
        read = self._confirmed
        return read is not None and record.host_time <= read.host and record.device_time <= read.device

    def forget_old_readings(self) -> bool:
        """Rely on the last reading of the clock alone, which gives the frames other times.

        Returns:
            Whether that changed anything.
        """
        return self.plausibility.doubted == 0 and self.clock.start_anew(self._train.tolerance_ns)


def _is_same(before: FrameRecord, record: FrameRecord) -> bool:
    """Whether a frame came twice; `CameraTrack.follow` counts it."""
    return record.frame_id == before.frame_id and record.device_time == before.device_time


def _timed(before: FrameRecord | None, record: FrameRecord, time: HostNs) -> Timed:
    """A frame, triggered at `time`, with its step from the frame before."""
    step = None if before is None else id_step(before.frame_id, record.frame_id, record.id_modulus)
    return Timed(step, time, record.host_time)
