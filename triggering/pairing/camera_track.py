"""Follows one camera: places its frames on the common time line, and collects what its ids prove about missing ones.

Ids and clocks are compared within one epoch only: a new connection has another clock and other ids. From a reconnection
to the first frame after it the camera counts as absent. In its very first connection, if the ids plausibly began at 1,
the pulses before the first frame are judged by its id, so that a camera that fails at the first pulses is not taken for
an absent one.
"""

from collections import deque
from collections.abc import Sequence
from typing import Final

from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs
from rig.frame import FrameStatus, Record
from rig.health import CameraCounters
from triggering.pairing.belief import Belief, Others, Timed, Verdict
from triggering.pairing.frame_ids import id_step, overruns_between
from triggering.pairing.gaps import DamageMatcher, Gap
from triggering.pairing.outcomes import NO_FRAME, Outcome
from triggering.timeline.device_clock import DeviceClock
from triggering.timeline.pulse_train import PulseTrain
from triggering.timeline.stamping import Stamping

#: Damaged arrivals kept until their pulse is decided; only a camera that sends nothing else has more.
_MOST_DAMAGED: Final = 64
#: A newly connected camera may take this long to its first frame.
FIRST_NS: Final = NS_PER_S // 2
#: Whole frames may be held back this long behind a damaged one.
HELD_BACK_NS: Final = NS_PER_S // 20
#: A camera whose frames come late is not silent before it has sent nothing for this long.
_SLOW_NS: Final = NS_PER_S
#: So many late frames in a row are no accident.
_LATE_RUN: Final = 2
#: Pulses that are remembered because they were decided before the camera's frame came.
_MOST_UNSEEN: Final = 10_000


class CameraTrack:
    """State of one camera.

    Args:
        train: the rhythm of the pulses.
        exposure_ns: exposure of the camera; 0: the times of its frames are those of the beginning of the exposure.

    Attributes:
        clock: the camera's clock in this epoch.
        stamping: which end of the exposure the camera notes.
        counters: totals since the start.
        epoch: number of the present connection, 0 before the first.
        connected: whether the camera is there.
        silent: the camera is connected, but delivers nothing while others do, or while the source fires.
        unanswered: pulses decided without this camera since its last sign of life.
        alive: host time of the last sign of life: a trigger time or the connection.
        heard: host time at which the last whole frame came.
        lag_ns: how much later than usual it came.
        set_at: when its clock was last found to have been set; None: never.
    """

    def __init__(self, train: PulseTrain, exposure_ns: int = 0) -> None:
        self.clock, self.stamping = DeviceClock(), Stamping(train, exposure_ns)
        self.counters = CameraCounters()
        self.epoch, self.connected, self.silent = 0, False, False
        self.unanswered = 0
        self.alive = self.heard = HostNs(0)
        self.lag_ns = 0.0
        self.set_at: HostNs | None = None
        self._late_run = 0  # whole frames in a row whose pulses were decided already
        self._train, self.belief = train, Belief(train)
        self._confirmed: ClockLatch | None = None  # the last reading of the clock that agrees with those before
        self._unsettled_until = HostNs(0)  # frames that come before may have the time of a clock that is no more
        self._matcher = DamageMatcher(train.period_ns, self.counters)
        self._gaps: deque[Gap] = deque()
        self._since = HostNs(0)
        self._first: HostNs | None = None  # trigger time of the epoch's first whole frame
        self._seen = HostNs(0)  # until then the camera was there in this epoch: frames triggered before would be here
        self._left = HostNs(0)  # the same of the last epoch
        self._readings = 0  # of its clock in this epoch
        self._known_until = HostNs(0)
        self._last: tuple[Record, HostNs] | None = None  # the epoch's last whole frame and its trigger time
        # The running gap: it began with the last frame, and its end is not known yet.
        self._broken = False
        self._damaged: list[HostNs] = []
        self._settled_damaged = 0
        self._unseen: deque[HostNs] = deque(maxlen=_MOST_UNSEEN)  # pulses decided at their deadline, without proof

    @property
    def latency_ns(self) -> float:
        """Typical time from the trigger of a frame to its arrival."""
        return self._matcher.latency_ns

    @property
    def delivers(self) -> bool:
        """Whether it has delivered a frame since it was connected."""
        return self.connected and self._last is not None

    @property
    def will_tell(self) -> bool:
        """Whether the id of its next whole frame will tell what became of those before it."""
        return self.connected and not self.silent and not self._broken

    # -- records of the camera -----------------------------------------------------------------------------------

    def connect(self, epoch: int, host: HostNs) -> None:
        """Begin an epoch: clock, ids and times are unrelated to those of the last one."""
        if self.connected:
            self.disconnect(host)
        self._broken = self.epoch > 0
        if self._broken:
            self.clock = DeviceClock()
        self.epoch, self.connected, self.silent = epoch, True, False
        self._since = self._seen = self.alive = host
        self._last = self._first = None
        self._readings = self.belief.doubted = 0
        self._confirmed = None
        self._begin_running_gap()

    def disconnect(self, host: HostNs) -> None:
        """End the epoch: frames that have not come by now never will."""
        if not self.connected:
            return
        start = self._last_whole
        self._gaps.append(Gap(start, host, damaged=self._damaged, broken=True, anchored=False))
        self._known_until = max(self._known_until, host)
        self._left = max(self._left, start if self.silent else self._seen)
        self.connected = self.silent = False
        self._damaged = []

    def latch(self, latch: ClockLatch) -> None:
        """Enter a reading of the camera's clock."""
        steps = self.clock.steps
        agrees = self.clock.latch(latch)
        self._readings += 1
        self._seen = max(self._seen, HostNs(round(latch.host - self.latency_ns - HELD_BACK_NS)))
        if agrees and latch.round_trip_ns < self._train.shortest_ns:
            self._confirmed = latch
        if stepped := self.clock.steps != steps:
            self._confirmed, self.belief.doubted = None, 0
            self.counters.clock_steps += 1
            self.set_at, self._unsettled_until = latch.host, HostNs(latch.host + round(self.belief.longest_ns))
        if self.stamping.confirmed(agrees=agrees) or stepped:
            # Times before and after it cannot be compared: the next frame counts as a first one.
            self._last, self._broken = None, True

    def damaged(self, host: HostNs, device: DeviceNs | None = None) -> None:
        """Enter a damaged arrival.

        Args:
            host: when it came.
            device: the camera's clock at its trigger, if known.
        """
        if device is not None and self.clock.known:
            host = self._matcher.arrival_of(self.trigger_time(device))
        if len(self._damaged) >= _MOST_DAMAGED:
            del self._damaged[0]
            self.counters.unassigned += 1
        self._damaged.append(host)
        # It says nothing of `_seen`: what is left of a frame may be given up long after its camera went.
        self.alive = max(self.alive, HostNs(round(self._matcher.trigger_of(host))))
        self._stirs()

    def note_damage(self, record: Record) -> None:
        """Enter the record of a damaged arrival, of which only the times are used."""
        self.damaged(record.host_time, record.device_time if record.value == 1 else None)

    def trigger_time(self, device: DeviceNs) -> HostNs:
        """When the exposure of a frame began on the common time line, by its device time."""
        return HostNs(self.clock.to_host(device) - self.stamping.late_ns)

    def anchor(self, record: Record) -> HostNs | None:
        """Trigger time of a whole frame on the common time line, None if the clock cannot tell."""
        clock, first = self.clock, self._last is None
        if not clock.known or (first and clock.uncertainty_at(record.device_time) > self._train.widest_ns / 2):
            self.counters.unanchored += 1
            self._broken = self._broken or first  # the ids of later frames no longer count from the beginning
            return None
        time, arrival = self.trigger_time(record.device_time), record.host_time
        if arrival > self._unsettled_until and time > arrival + self._train.widest_ns:
            self.contradict(record)
            return None
        if arrival <= self._unsettled_until or self.stamping.contradicts(
            time, arrival, 2 * clock.uncertainty_at(record.device_time)
        ):
            self.refuse(record)
            return None
        return time

    def judge(self, waiting: Sequence[Record], others: Others, *, now_or_never: bool = False) -> Verdict:
        """Judge the first of the whole frames that wait, by all that is known.

        Args:
            waiting: they, in the order of their coming.
            others: the frames of the other cameras.
            now_or_never: no more evidence can be waited for.
        """
        first = waiting[0]
        last, last_time = self._last or (None, None)
        if last is not None and first.frame_id == last.frame_id and first.device_time == last.device_time:
            return Verdict.BELIEVED  # it came twice, which `follow` notes
        timed, before = [], last
        for record in waiting:
            step = None if before is None else id_step(before.frame_id, record.frame_id, record.id_modulus)
            timed.append(Timed(step, self.trigger_time(record.device_time), record.host_time))
            before = record
        confirmed = self._confirmed
        read = confirmed is not None and (first.host_time <= confirmed.host and first.device_time <= confirmed.device)
        return self.belief.judge(last_time, timed, read=read, others=others, now_or_never=now_or_never)

    def clock_anew(self) -> bool:
        """Whether the clock can be known by its last reading alone, which makes other times of the frames."""
        return self.belief.doubted == 0 and self.clock.start_anew(self._train.tolerance_ns)

    def contradict(self, record: Record) -> None:
        """Refuse a frame whose time is contradicted, and doubt the camera from now on."""
        self.belief.doubted += 1
        self.refuse(record)

    def waits(self, record: Record) -> None:
        """Note that a whole frame has come that is not to be believed yet: the camera is neither silent nor overdue."""
        self.heard = record.host_time
        self._stirs()

    def refuse(self, record: Record) -> None:
        """Treat a whole frame as damaged: its trigger time is not known."""
        self.counters.implausible += 1
        self.damaged(record.host_time)

    def follow(self, record: Record, time: HostNs) -> bool:
        """Enter a whole frame, triggered at `time`: its id tells what happened since the last one.

        Returns:
            False if the frame is not newer than the last one; it belongs to no pulse then.
        """
        if self.silent:
            self._stirs()
        if self._last is None:
            taken = self._taken_at_first(record, time)
            self._gaps.append(self._end_running_gap(self._since, time, taken, anchored=False))
        else:
            last, last_time = self._last
            if time <= last_time:
                if record.frame_id == last.frame_id:
                    self.counters.duplicate += 1
                else:
                    self.refuse(record)
                return False
            taken = self._taken_since(last, last_time, record, time)
            gap = self._end_running_gap(last_time, time, taken, anchored=not self._broken)
            gap.overruns = overruns_between(last, record, taken + 1) if gap.anchored else 0
            self.counters.overruns += gap.overruns
            self._gaps.append(gap)
        self.belief.doubted = 0
        self._last = record, time
        self._first = self._first or time
        self._known_until = self.alive = time
        self._seen = max(self._seen, time)
        self._note_arrival(record.host_time, time)
        return True

    # -- decisions about pulses ----------------------------------------------------------------------------------

    def is_slow(self, now: HostNs) -> bool:
        """Whether its frames come, but much later than usual: it is neither silent nor in need of a new connection."""
        return self.delivers and self.lag_ns > HELD_BACK_NS and now < self.heard + _SLOW_NS

    def comes_late(self, now: HostNs) -> bool:
        """Whether its frames come so late that their pulses are decided already."""
        return self.is_slow(now) and self._late_run >= _LATE_RUN

    def may_deliver(self, time: HostNs) -> bool:
        """Whether a whole frame of a pulse at `time` may still come."""
        expected = time >= self._since - self._train.tolerance_ns and time >= self._known_until
        return expected and self.connected and not self.silent

    def settle(self, time: HostNs, rivals: Sequence[HostNs]) -> Outcome:
        """Decide what became of a pulse for which the camera has delivered no whole frame.

        Args:
            time: time of the pulse; pulses are decided in the order of time.
            rivals: times of the later pulses before the camera's next frame, in order.
        """
        gap = self.gap_after(time)
        if gap is not None:
            return gap.settle(time, rivals, self._matcher)
        if not self.connected or time < self._since:
            return NO_FRAME[FrameStatus.ABSENT]
        if self._damaged and self._matcher.match(self._damaged, time, rivals):
            self._settled_damaged += 1
            return NO_FRAME[FrameStatus.DAMAGED]
        self.unanswered += time > self.alive
        if self.silent:
            return NO_FRAME[FrameStatus.ABSENT]
        self._unseen.append(time)
        if self._last is None:
            return NO_FRAME[FrameStatus.ABSENT]
        self.counters.presumed += 1
        return NO_FRAME[FrameStatus.LOST]

    @property
    def watches(self) -> bool:
        """Whether the camera is there and has been seeing pulses since the last decided one."""
        last = self._train.last
        return (
            self.delivers and not self.silent and self._first is not None and last is not None and self._first <= last
        )

    def was_there(self, time: HostNs) -> bool:
        """Whether the camera was connected and set up at `time`, and has been since."""
        ready = self._since + FIRST_NS if self._first is None else self._since
        return self.connected and time >= ready

    def is_awaited(self, time: HostNs) -> bool:
        """Whether the camera was there before `time`, has answered until now, and not since: it may have gone."""
        return self.was_there(time) and not self.silent and self._readings > 1 and time > self._seen

    def was_away(self, time: HostNs) -> bool:
        """Whether the camera was not there at `time`: it was disconnected, or not set up yet."""
        if time <= self._left or not self.connected:
            return time > self._left
        if self.silent:  # that it answers proves nothing: it does so while pulses come
            return time > self._last_whole
        return time < (self._since + FIRST_NS if self._first is None else self._first - self._train.tolerance_ns)

    def settle_unwatched(self, time: HostNs, rivals: Sequence[HostNs]) -> Outcome:
        """As `settle`, for a pulse at which the camera was away: absent, unless a damaged arrival is left of it."""
        gap = self.gap_after(time)
        outcome = NO_FRAME[FrameStatus.ABSENT] if gap is None else gap.settle(time, rivals, self._matcher)
        return NO_FRAME[FrameStatus.ABSENT] if outcome.status is FrameStatus.MISSED else outcome

    def settle_fired(self, time: HostNs, rivals: Sequence[HostNs]) -> Outcome:
        """As `settle`, for a pulse that the source fired, and of which no camera delivered a frame.

        A camera whose clock was read after the pulse was there. If its ids cannot tell, the pulse did not reach it:
        what keeps a pulse from all cameras is the cable, and what keeps a frame back is mostly one camera's own.
        """
        ids_tell = self.gap_after(time) is not None or self._damaged
        if not ids_tell and self.was_there(time) and time <= self._seen:
            return NO_FRAME[FrameStatus.MISSED]
        return self.settle(time, rivals)

    def gap_after(self, time: HostNs) -> Gap | None:
        """The gap in which `time` lies, None if its end is not known yet. Earlier gaps are dropped."""
        self.forget_until(time)
        return self._gaps[0] if self._gaps else None

    def forget_until(self, time: HostNs) -> None:
        """Drop the gaps that ended by `time`: all pulses in them are decided."""
        while self._gaps and self._gaps[0].end <= time:
            done = self._gaps.popleft()
            if done.anchored and done.taken > 0:
                self.counters.unexplained += done.taken
            self.counters.unassigned += len(done.damaged)

    def has_damaged(self) -> bool:
        """Whether there are damaged arrivals that are not assigned to a pulse yet."""
        return bool(self._damaged) or any(gap.damaged for gap in self._gaps)

    @property
    def _last_whole(self) -> HostNs:
        """Trigger time of the last whole frame, or the time of the connection before the first one."""
        return self._since if self._last is None else self._last[1]

    # -- details -------------------------------------------------------------------------------------------------

    def _note_arrival(self, host: HostNs, time: HostNs) -> None:
        """Note how late a whole frame came, by its arrival and its trigger time; late ones do not become the usual."""
        self.heard, self.lag_ns = host, host - time - self.latency_ns
        decided = self._train.last is not None and time <= self._train.last + self._train.tolerance_ns
        self._late_run = self._late_run + 1 if decided else 0
        if not decided:
            self._matcher.whole(host - time)
            self.belief.saw(host - time)

    def _stirs(self) -> None:
        """Note that the camera sends something."""
        self.unanswered = 0
        if self.silent:
            self.silent, self._broken = False, True

    def _begin_running_gap(self) -> None:
        self._damaged = []
        self._unseen.clear()
        self._settled_damaged = self.unanswered = 0

    def _end_running_gap(self, start: HostNs, end: HostNs, taken: int, *, anchored: bool) -> Gap:
        """The running gap, ended by the frame at `end`, with `taken` frames in it; a new gap begins there."""
        # Frames may come so late that later pulses are decided already; those lie in the gap that begins now.
        unseen, later = 0, []
        if self._unseen:
            unseen = sum(pulse < end - self._train.tolerance_ns for pulse in self._unseen)
            later = [pulse for pulse in self._unseen if pulse > end + self._train.tolerance_ns]
        left = taken - self._settled_damaged - unseen
        # Damaged arrivals are certain; pulses decided as lost without proof are not.
        least = max(0, min(len(self._damaged), taken - self._settled_damaged))
        if left < least and anchored:
            self.counters.contradicted += min(least - left, unseen)
        gap = Gap(start, end, max(left, least), taken, self._damaged, self._broken, anchored)
        self._begin_running_gap()
        self._unseen.extend(later)
        self._broken = False
        return gap

    def _taken_at_first(self, record: Record, time: HostNs) -> int:
        """Frames taken before the first one that came: by its id, if the ids may have begun at 1, else 0."""
        before = record.frame_id - 1
        if self._broken or not 0 <= before <= self._most_steps(time - self._since):
            self._broken = True
            return 0
        return before

    def _taken_since(self, last: Record, last_time: HostNs, record: Record, time: HostNs) -> int:
        """Frames taken between the last one that came and this one."""
        step = id_step(last.frame_id, record.frame_id, record.id_modulus)
        if not 0 < step <= self._most_steps(time - last_time):
            self.counters.restarts += 1
            self._broken = True
            return 0
        return step - 1

    def _most_steps(self, span_ns: int) -> float:
        """Upper limit of the frames that a camera can take in a time, even if the rate is off."""
        return 1.5 * span_ns / self._train.period_ns + 1.5
