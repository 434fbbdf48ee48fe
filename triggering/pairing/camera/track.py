"""Follows one camera: places its frames on the common time line, and collects what its ids prove about missing ones."""

from collections.abc import Sequence

from rig.clocks import ClockLatch, DeviceNs, HostNs
from rig.frame import DamagedRecord, FrameRecord, FrameStatus
from rig.health import CameraCounters
from triggering.pairing.camera.activity import HELD_BACK_NS, Activity
from triggering.pairing.camera.frame_times import FrameTimes, Unusable
from triggering.pairing.camera.gaps import Gap, Gaps
from triggering.pairing.camera.plausibility import Others, Verdict
from triggering.pairing.camera.presence import Presence
from triggering.pairing.outcomes import NO_FRAME, Outcome
from triggering.timeline.pulse_train import PulseTrain


class CameraTrack:
    """State of one camera.

    Args:
        train: the rhythm of the pulses.
        exposure_ns: exposure of the camera; 0: the times of its frames are those of the beginning of the exposure.

    Attributes:
        counters: totals since the start.
        presence: its connection, and when it was there.
        activity: its signs of life.
        times: the trigger times of its frames, and whether they are plausible.
        gaps: the spans in which it delivered no whole frame.
    """

    def __init__(self, train: PulseTrain, exposure_ns: int = 0) -> None:
        self._train = train
        self.counters = CameraCounters()
        self.presence, self.activity = Presence(train), Activity()
        self.times = FrameTimes(train, exposure_ns)
        self.gaps = Gaps(train, self.counters)
        self._last: tuple[FrameRecord, HostNs] | None = None  # the epoch's last whole frame and its trigger time

    @property
    def latency_ns(self) -> float:
        """Typical time from the trigger of a frame to its arrival."""
        return self.gaps.matcher.latency_ns

    @property
    def connected(self) -> bool:
        """Whether the camera is connected."""
        return self.presence.connected

    @property
    def silent(self) -> bool:
        """Whether the camera is connected, but delivers nothing while others do, or while the source fires."""
        return self.activity.silent

    @property
    def delivers(self) -> bool:
        """Whether it has delivered a frame since it was connected."""
        return self.presence.connected and self._last is not None

    @property
    def will_tell(self) -> bool:
        """Whether the id of its next whole frame will tell what became of the frames before it."""
        return self.presence.connected and not self.activity.silent and not self.gaps.broken

    # -- records of the camera -----------------------------------------------------------------------------------

    def connect(self, epoch: int, host: HostNs) -> None:
        """Begin an epoch: clock, ids and times are unrelated to those of the last one."""
        self.disconnect(host)
        again = self.presence.epoch > 0
        self.presence.begin(epoch, host)
        self.activity.begin(host)
        self.times.begin(clock_unknown=again)
        self.gaps.begin(broken=again)
        self._last = None

    def disconnect(self, host: HostNs) -> None:
        """End the epoch, if there is one: frames that have not come by now never will."""
        if not self.presence.connected:
            return
        start = self._last_whole
        self.gaps.end_epoch(start, host)
        self.presence.end(host, start if self.activity.silent else self.presence.seen)
        self.activity.silent = False

    def latch(self, latch: ClockLatch) -> bool:
        """Enter a reading of the camera's clock.

        Returns:
            Whether it shows that the clock was set: the times of frames that wait are of a clock that is no more.
        """
        steps = self.times.clock.steps
        comparable = self.times.latch(latch)
        self.presence.answered(HostNs(round(latch.host - self.latency_ns - HELD_BACK_NS)))
        if not comparable:  # the next frame counts as a first one
            self._last, self.gaps.broken = None, True
        stepped = self.times.clock.steps != steps
        self.counters.clock_steps += stepped
        return stepped

    def damaged(self, host: HostNs, device: DeviceNs | None = None) -> None:
        """Enter a damaged arrival.

        Args:
            host: when it came.
            device: the camera's clock at its trigger, if known.
        """
        matcher = self.gaps.matcher
        if device is not None and self.times.clock.known:
            host = matcher.arrival_of(self.times.trigger_time(device))
        self.gaps.add_damaged(host)
        # Not `presence.seen`: the rest of a damaged frame may come long after its camera went.
        self.activity.alive = max(self.activity.alive, HostNs(round(matcher.trigger_of(host))))
        self._stir()

    def note_damage(self, record: DamagedRecord) -> None:
        """Enter the record of a damaged arrival, of which only the times are used."""
        self.damaged(record.host_time, record.device_time)

    def trigger_time(self, record: FrameRecord) -> HostNs | None:
        """Trigger time of a whole frame on the common time line; None if the frame cannot be used."""
        time = self.times.locate(record, first=self._last is None)
        if not isinstance(time, Unusable):
            return time
        if time is Unusable.CLOCK_UNKNOWN:
            self.counters.unanchored += 1
            self.gaps.broken = self.gaps.broken or self._last is None  # later ids do not count from the beginning
            return None
        if time is Unusable.REJECTED:
            self.doubt()
        self.refuse(record)
        return None

    def judge(self, waiting: Sequence[FrameRecord], others: Others, *, final: bool = False) -> Verdict:
        """Judge the first waiting whole frame, by all evidence.

        Args:
            waiting: the frames, in the order of their arrival.
            others: the frames of the other cameras.
            final: no more evidence can be waited for.
        """
        return self.times.judge(self._last, waiting, others, final=final)

    def judge_new(self, record: FrameRecord, time: HostNs, others: Others) -> Verdict:
        """As `judge`, for a frame that has just come, triggered at `time`, while none waits."""
        return self.times.judge_new(self._last, record, time, others)

    def doubt(self) -> None:
        """Doubt the camera from now on: the time of a frame is contradicted."""
        self.times.plausibility.doubted += 1

    def refuse(self, record: FrameRecord) -> None:
        """Treat a whole frame as damaged: its trigger time is not known."""
        self.counters.implausible += 1
        self.damaged(record.host_time)

    def waits(self, record: FrameRecord) -> None:
        """Note a whole frame that is not accepted yet: the camera is neither silent nor overdue."""
        self.activity.heard = record.host_time
        self._stir()

    def follow(self, record: FrameRecord, time: HostNs) -> bool:
        """Enter an accepted frame, triggered at `time`: its id tells what happened since the last one.

        Returns:
            False if the frame is not newer than the last one; it belongs to no pulse then.
        """
        if self.activity.silent:
            self._stir()
        if self._last is None:
            self.gaps.first_frame(self.presence.since, record, time)
        else:
            last, last_time = self._last
            if time <= last_time:
                if record.frame_id == last.frame_id:
                    self.counters.duplicate += 1
                else:
                    self.refuse(record)
                return False
            self.gaps.next_frame(last, last_time, record, time)
        self._last = record, time
        self.presence.delivered(time)
        decided, latency_ns, matcher = self._train.is_decided(time), record.host_time - time, self.gaps.matcher
        self.activity.frame(time, record.host_time, latency_ns - matcher.latency_ns, late=decided)
        self.times.plausibility.doubted = 0
        if not decided:  # late frames do not become the usual
            matcher.whole(latency_ns)
            self.times.arrivals.add(latency_ns)
        return True

    def fall_silent(self) -> None:
        """Note that the camera is silent."""
        self.activity.silent = True
        self.counters.silences += 1

    # -- decisions about pulses ----------------------------------------------------------------------------------

    def is_slow(self, now: HostNs) -> bool:
        """Whether its frames come, but much later than usual: it is neither silent nor in need of a new connection."""
        return self.delivers and self.activity.is_slow(now)

    def comes_late(self, now: HostNs) -> bool:
        """Whether its frames come so late that their pulses are decided already."""
        return self.activity.is_late and self.is_slow(now)

    def may_deliver(self, time: HostNs) -> bool:
        """Whether a whole frame of a pulse at `time` may still come."""
        return self.presence.may_deliver(time) and not self.activity.silent

    def is_awaited(self, time: HostNs) -> bool:
        """Whether the camera was there before `time`, has answered until now, and not since: it may have gone."""
        return self.presence.is_awaited(time) and not self.activity.silent

    def watches(self) -> bool:
        """Whether the camera is there and has been seeing pulses since the last decided one."""
        return self.delivers and not self.activity.silent and self.presence.was_there_before(self._train.last)

    def was_away(self, time: HostNs) -> bool:
        """Whether the camera was not there at `time`: it was disconnected, silent, or not set up yet."""
        if self.activity.silent and self.presence.connected and time > self.presence.left:
            return time > self._last_whole  # readings of the clock prove nothing: it answers only while pulses come
        return self.presence.was_away(time)

    def settle(self, time: HostNs, rivals: Sequence[HostNs]) -> Outcome:
        """Decide what became of a pulse without a whole frame of the camera.

        Args:
            time: time of the pulse; pulses are decided in the order of time.
            rivals: times of the later pulses before the camera's next frame, in order.
        """
        gap = self.gaps.at(time)
        if gap is not None:
            return gap.settle(time, rivals, self.gaps.matcher)
        if not self.presence.connected or time < self.presence.since:
            return NO_FRAME[FrameStatus.ABSENT]
        if self.gaps.take_damaged(time, rivals):
            return NO_FRAME[FrameStatus.DAMAGED]
        self.activity.unanswered += time > self.activity.alive
        if self.activity.silent:
            return NO_FRAME[FrameStatus.ABSENT]
        self.gaps.presume_lost(time)
        if self._last is None:
            return NO_FRAME[FrameStatus.ABSENT]
        self.counters.presumed += 1
        return NO_FRAME[FrameStatus.LOST]

    def settle_unwatched(self, time: HostNs, rivals: Sequence[HostNs]) -> Outcome:
        """As `settle`, for a pulse at which the camera was away: absent, unless a damaged arrival is left of it."""
        gap = self.gaps.at(time)
        outcome = NO_FRAME[FrameStatus.ABSENT] if gap is None else gap.settle(time, rivals, self.gaps.matcher)
        return NO_FRAME[FrameStatus.ABSENT] if outcome.status is FrameStatus.MISSED else outcome

    def settle_fired(self, time: HostNs, rivals: Sequence[HostNs]) -> Outcome:
        """As `settle`, for a pulse that the source fired and no camera delivered a frame of.

        A camera whose clock was read after the pulse was there. If its ids cannot tell, the pulse did not reach it:
        a fault of the cable keeps a pulse from all cameras, a fault of the transfer mostly concerns one camera.
        """
        ids_tell = self.gaps.at(time) is not None or self.gaps.has_running_damaged
        if not ids_tell and self.presence.was_there(time) and time <= self.presence.seen:
            return NO_FRAME[FrameStatus.MISSED]
        return self.settle(time, rivals)

    def gap_across(self, time: HostNs) -> Gap | None:
        """The gap that reaches from before `time` to after it, if ids and times can prove pulses in it."""
        gap = self.gaps.at(time)
        return gap if gap is not None and gap.anchored and gap.start <= time + self._train.tolerance_ns else None

    # -- details -------------------------------------------------------------------------------------------------

    @property
    def _last_whole(self) -> HostNs:
        """Trigger time of the last whole frame, or the time of the connection before the first one."""
        return self.presence.since if self._last is None else self._last[1]

    def _stir(self) -> None:
        """Note that the camera sends something."""
        if self.activity.stir():
            self.gaps.broken = True
