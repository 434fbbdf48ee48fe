"""Pairs the frames of all cameras by pulse, and decides what became of every pulse in every camera.

Frames are paired by their trigger times alone, on the common time line to which each camera's clock is converted: never
by the order of arrival, by equal ids, or by counting from a first frame. The ids then tell why a frame did not come.
A trigger time is used only if nothing contradicts it (`camera.plausibility`); other frames wait until their camera's
clock has been read again (`admission`). The class is pure: records and times go in, decisions come out.
"""

from collections.abc import Callable, Sequence

from rig.clocks import NS_PER_S, ClockLatch, HostNs
from rig.errors import BadInputError
from rig.frame import DamagedRecord, FrameRecord, FrameStatus
from rig.health import CameraCounters, PairingHealth
from rig.pulse import RigPulse
from triggering.pairing.admission import Admission
from triggering.pairing.camera.track import CameraTrack
from triggering.pairing.camera_health import camera_health, is_recent, source_health
from triggering.pairing.deadlines import Deadlines
from triggering.pairing.held import HeldFrames, Released
from triggering.pairing.known_pulses import KnownPulses
from triggering.pairing.outcomes import ClosedPulse, OpenPulse, Outcome
from triggering.pairing.silence import Silence
from triggering.pairing.unseen import UnseenPulses
from triggering.timeline.fired import FiredPulses
from triggering.timeline.pulse_train import CLOCKS_NS, PulseTrain

__all__ = ["ClosedPulse", "OpenPulse", "Outcome", "Pairer"]


class Pairer:
    """Pairs the frames of all cameras by pulse.

    Pass it every record that has come, in each camera's own order, then use the frames that `released` returns, and
    only then call `advance`.

    Args:
        cameras: how many cameras there are.
        period_ns: nominal period of the pulses; the true one is measured.
        hold_ns: how long after a pulse its frames may come: exposure, transport, retention of damaged frames, and some
            periods, so that the camera's next frame can tell what became of a missing one.
        tolerance_ns: frames whose trigger times are further apart are never of one pulse; 0.3 periods if left out.
        spread_ns: how far apart the trigger itself may expose the cameras at one pulse.
        exposes: whether the trigger can have exposed a camera at a time that is known so well, ns; None: at any time.
            Other frames are of commands that came too late, and are refused: they could be taken for those of the next
            pulse.
        exposures_ns: exposure of each camera that may note the end of it as the time of a frame; 0 for the others.

    Raises:
        BadInputError: an argument makes no sense.
    """

    def __init__(
        self,
        cameras: int,
        period_ns: int,
        *,
        hold_ns: int,
        tolerance_ns: int | None = None,
        spread_ns: int = 0,
        exposes: Callable[[HostNs, float], bool] | None = None,
        exposures_ns: Sequence[int] = (),
    ) -> None:
        tolerance = 1 if tolerance_ns is None else tolerance_ns
        if (
            cameras < 1
            or period_ns <= 0
            or not 0 < tolerance < period_ns / 2
            or hold_ns < max(tolerance, period_ns / 2)
        ):
            raise BadInputError(
                f"pairing of {cameras} cameras, period {period_ns} ns, tolerance {tolerance_ns} ns, hold {hold_ns} ns "
                "cannot work: give at least one camera, a tolerance under half the period and a longer hold"
            )
        self._exposes = exposes
        self._train = train = PulseTrain(period_ns, tolerance_ns, spread_ns)
        self._tracks = tuple(CameraTrack(train, exposure_ns) for exposure_ns in exposures_ns or [0] * cameras)
        self._held, self._pulses = HeldFrames(cameras), KnownPulses(cameras)
        self._fired = FiredPulses(train)
        self._admission = Admission(self._tracks, self._pulses, self._held, train)
        self._silence = Silence(self._tracks, self._held, train)
        self._deadlines = Deadlines(hold_ns, period_ns, self._tracks, self._pulses, self._held, train)
        self._unseen = UnseenPulses(self._tracks, self._held, train, self._fired, self._deadlines)

    # -- records in ----------------------------------------------------------------------------------------------

    def frame(self, camera: int, record: FrameRecord) -> OpenPulse | None:
        """Assign a whole frame to its pulse, or hold it until its trigger time can be judged.

        Returns:
            The pulse, or None: the frame is held (`holds`), or it belongs to no open pulse: the camera's clock is not
            known yet, the pulse is decided already, or the frame came twice. `counters` tells which.
        """
        track = self._tracks[camera]
        if not self._is_current(track, record):
            return None
        time = track.trigger_time(record)
        if time is None:
            return None
        if self._admission.admits(camera, record, time):
            return self._place(camera, record, time)
        if track.connected:
            track.waits(record)
            self._held.hold(camera, record)
        else:
            track.counters.stale += 1
        return None

    def holds(self, camera: int, record: FrameRecord) -> bool:
        """Whether a frame for which `frame` has returned no pulse waits; `released` will return it."""
        return self._held.has(camera, record)

    def released(self, now: HostNs) -> list[Released]:
        """Place or refuse the frames that wait, as far as the evidence goes at host time `now`.

        To be called before every `advance`, which may decide the pulses of these frames.

        Returns:
            The frames that no longer wait, since the last call.
        """
        if self._held.count:
            for camera, record in self._admission.settle(now):
                self._release(camera, record)
        return self._held.released()

    def damaged(self, camera: int, record: DamagedRecord) -> None:
        """Enter a damaged arrival; only the times of the record are used."""
        track = self._tracks[camera]
        if not self._is_current(track, record):
            return
        if not track.connected:
            track.counters.stale += 1
        elif self._held.any_of(camera):
            self._held.hold(camera, record)
        else:
            track.note_damage(record)

    def latch(self, camera: int, latch: ClockLatch) -> None:
        """Enter a reading of the camera's clock; readings of an epoch come after its `connected`."""
        if self._tracks[camera].latch(latch):
            self._admission.refuse_all(camera)

    def fired(self, number: int, time: HostNs, uncertainty_ns: int) -> None:
        """Enter a pulse that the source reports: it gets a tag even if no camera saw it.

        Args:
            number: as the source counts; where it does not follow on the last one, some were not reported.
            time: when it fired, by the source's clock.
            uncertainty_ns: largest error of `time`.
        """
        self._fired.add(number, time, uncertainty_ns)

    def fired_until(self, time: HostNs) -> None:
        """Note that the source has reported all pulses up to a time."""
        self._fired.until(time)

    def connected(self, camera: int, epoch: int, host: HostNs) -> None:
        """Begin an epoch of a camera: pulses from now on wait for its frames."""
        self._end_waiting(camera)
        self._tracks[camera].connect(epoch, host)

    def disconnected(self, camera: int, host: HostNs) -> None:
        """End the epoch of a camera: no pulse waits for it any more."""
        self._end_waiting(camera)
        self._tracks[camera].disconnect(host)

    # -- decisions out -------------------------------------------------------------------------------------------

    def advance(self, now: HostNs) -> list[ClosedPulse]:
        """Decide what can be decided at host time `now`.

        Returns:
            The pulses decided now, in the order of time.
        """
        closed: list[ClosedPulse] = []
        while self._can_decide(now):
            closed.append(self._close(self._pulses.take_first()))
        return closed

    def next_deadline(self) -> HostNs | None:
        """When `advance` must be called at the latest although nothing arrives; None if there is no open pulse."""
        first = self._pulses.first
        deadline = None if first is None else self._deadlines.of_first(first)
        if self._held.count and (end := self._held.next_end()) is not None:
            return end if deadline is None else min(deadline, end)
        return deadline

    @property
    def open(self) -> Sequence[OpenPulse]:
        """The pulses that some camera saw and that are not decided yet, in the order of time; not to be changed."""
        return self._pulses.open

    @property
    def oldest(self) -> HostNs | None:
        """Time of the oldest pulse that is not decided yet; None if there is none."""
        fired, first = self._fired.oldest, self._pulses.first
        if first is None:
            return fired
        return first.time if fired is None else min(fired, first.time)

    def hurry(self, until: HostNs) -> None:
        """Let no pulse up to a time wait longer than the hold for evidence from later ones: a recording ends."""
        self._deadlines.hurry(until)

    def silent(self) -> tuple[int, ...]:
        """The connected cameras that have delivered nothing for three periods while others did."""
        return tuple(camera for camera, track in enumerate(self._tracks) if track.silent)

    def overdue(self, now: HostNs) -> tuple[int, ...]:
        """The connected cameras that are three pulses behind the others at host time `now`, and should be examined.

        This comes sooner than `silent` and is only a suspicion: pulses wait for their frames all the same, up to the
        deadline. Frames that are on their way, or held back behind a damaged one, cause no suspicion.
        """
        return tuple(self._silence.overdue(self._pulses.open, now, self._deadlines.hold_ns))

    def slow(self, now: HostNs) -> tuple[int, ...]:
        """The cameras whose frames come so late, at host time `now`, that their pulses are decided already."""
        return tuple(camera for camera, track in enumerate(self._tracks) if track.comes_late(now))

    def lag_ms(self, camera: int) -> float:
        """How much later than usual the last frame of a camera came, ms."""
        return self._tracks[camera].activity.lag_ns / 1e6

    @property
    def counters(self) -> tuple[CameraCounters, ...]:
        """Totals of each camera."""
        return tuple(track.counters for track in self._tracks)

    def health(self) -> PairingHealth:
        """Rhythm, spread and each camera's clock and totals."""
        train, split, pulses = self._train, self._train.split, self._pulses
        return PairingHealth(
            pulses=pulses.closed, proven_by_ids=pulses.proven_by_ids, unwatched=pulses.unwatched,
            open=len(pulses.open),
            period_us=round(train.period_ns / 1000, 3),
            spread_median_us=train.spread_median_ns / 1000,
            spread_max_us=train.spread_max_ns / 1000,
            spread_usual_us=train.spread_usual_ns / 1000,
            alarm=train.alarm,
            cameras=tuple(camera_health(track, train.last) for track in self._tracks),
            rate_hz=NS_PER_S / train.period_ns if train.rhythm.steady else None,
            split_us=None if split is None or not is_recent(split[0], train.last) else split[1] / 1000,
            source=source_health(self._fired, train.last),
        )  # fmt: skip

    # -- details -------------------------------------------------------------------------------------------------

    def _is_current(self, track: CameraTrack, record: FrameRecord | DamagedRecord) -> bool:
        """Whether a record is of the camera's present epoch; the first epoch may begin without `connected`."""
        epoch = track.presence.epoch
        if record.epoch == epoch:
            return True
        if epoch == 0:
            track.connect(record.epoch, HostNs(record.host_time - self._deadlines.least_hold_ns))
            return True
        track.counters.stale += 1
        return False

    def _end_waiting(self, camera: int) -> None:
        """Place or refuse all frames of a camera that wait."""
        for record in self._admission.end_epoch(camera):
            self._release(camera, record)

    def _release(self, camera: int, record: FrameRecord) -> None:
        """Place an accepted frame that waited until now."""
        time = self._tracks[camera].times.trigger_time(record.device_time)
        self._held.release(camera, record, self._place(camera, record, time))

    def _place(self, camera: int, record: FrameRecord, time: HostNs) -> OpenPulse | None:
        """Assign a frame, triggered at `time`, to its pulse; None if there is no open one."""
        track, train = self._tracks[camera], self._train
        clock = track.times.clock
        if self._exposes is not None and not self._exposes(time, max(CLOCKS_NS, 2 * clock.uncertainty_since(time))):
            track.refuse(record)
            return None
        # A frame that was still queued when its camera was disconnected is used, but its id proves nothing.
        if track.connected and not track.follow(record, time):
            return None
        if train.is_decided(time):
            track.counters.late += 1
            return None
        pulse = self._pulses.nearest(time, train.tolerance_ns)
        if pulse is None and (tolerance := 2 * clock.uncertainty_since(time)) > train.tolerance_ns:
            pulse = self._pulses.nearest(time, min(tolerance, train.widest_ns))  # its clock has not been read for long
        if pulse is None:
            pulse = self._pulses.add(time)
        elif pulse.frames[camera] is not None:
            track.counters.duplicate += 1
            return None
        else:
            # At once, not when the pulse is decided: in a backlog the same error would be corrected many times.
            clock.correct(record.device_time, pulse.time - time)
        pulse.add(camera, record, time)
        return pulse

    def _can_decide(self, now: HostNs) -> bool:
        """Whether the first open pulse can be decided, after pulses before it that no camera saw were opened."""
        first, fired = self._pulses.first, self._fired
        due, ask_source = first is not None and self._is_due(first, now), fired.active
        if (
            first is not None
            and due
            and ask_source
            and now < self._deadlines.of_first(first)
            and fired.waits(first.time, now)
        ):
            due = ask_source = False
        unseen = self._unseen.before(self._pulses.open, now, due=due, ask_source=ask_source)
        if unseen:
            self._pulses.put_first(unseen)
        return due or bool(unseen)

    def _is_due(self, pulse: OpenPulse, now: HostNs) -> bool:
        """Whether the first open pulse can be decided, as far as the cameras are concerned."""
        if pulse.missing == 0 or pulse.proven_by_ids or pulse.unwatched:
            return True
        if now >= self._deadlines.of_first(pulse):
            self._silence.decide(pulse, self._pulses.open, now)
            return True
        lacking = (track for track, frame in zip(self._tracks, pulse.frames, strict=True) if frame is None)
        return not any(track.may_deliver(pulse.time) for track in lacking)

    def _close(self, pulse: OpenPulse) -> ClosedPulse:
        outcomes = []
        for camera, track in enumerate(self._tracks):
            record, time = pulse.frames[camera], pulse.times[camera]
            if record is None or time is None:
                outcome = self._outcome_without_frame(camera, pulse)
            else:
                track.gaps.forget_until(time)
                outcome = Outcome(FrameStatus.OK, record, time - pulse.time)
            track.counters.count(outcome.status)
            outcomes.append(outcome)
        if pulse.unwatched:
            self._train.go_on(pulse.time)
        else:
            self._train.advance(pulse.time, pulse.spread_ns, pulse.delivered)
        missed = pulse.fired and any(outcome.status is FrameStatus.MISSED for outcome in outcomes)
        self._fired.decided(pulse.time, inserted=pulse.fired, seen=pulse.delivered > 0, missed=missed)
        return ClosedPulse(RigPulse(self._pulses.closed), pulse.time, tuple(outcomes), pulse.cargo, pulse.unwatched)

    def _outcome_without_frame(self, camera: int, pulse: OpenPulse) -> Outcome:
        track = self._tracks[camera]
        rivals = self._pulses.lacking(camera) if track.gaps.has_damaged() else []
        if pulse.fired:
            return track.settle_fired(pulse.time, rivals)
        return (track.settle_unwatched if pulse.unwatched else track.settle)(pulse.time, rivals)
