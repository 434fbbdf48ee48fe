"""Pairs the frames of all cameras by pulse, and decides what became of every pulse in every camera.

Frames are paired by their trigger times alone, on the common time line to which each camera's clock is converted: never
by the order of arrival, by equal ids, or by counting from a first frame. The ids then tell why a frame did not come.
A trigger time is believed only if nothing contradicts it (`belief`); other frames wait until their camera's clock has
been read again. The class is pure: records and times go in, decisions come out.
"""

from bisect import bisect_left, insort
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from operator import attrgetter
from typing import Final

from rig.clocks import NS_PER_S, ClockLatch, HostNs
from rig.errors import BadInputError
from rig.frame import FrameStatus, Record, RecordKind
from rig.health import CameraCounters, PairingHealth
from rig.pulse import RigPulse
from triggering.pairing.belief import Verdict
from triggering.pairing.camera_health import camera_health, is_recent, source_health
from triggering.pairing.camera_track import CameraTrack
from triggering.pairing.held import HeldFrames, Released
from triggering.pairing.other_cameras import OtherCameras
from triggering.pairing.outcomes import ClosedPulse, OpenPulse, Outcome
from triggering.pairing.silence import SILENT_PERIODS, Silence
from triggering.pairing.unseen import UnseenPulses
from triggering.timeline.fired import FiredPulses
from triggering.timeline.pulse_train import CLOCKS_NS, PulseTrain

__all__ = ["ClosedPulse", "OpenPulse", "Outcome", "Pairer"]

#: Where the pulses have no rhythm, one that lacks a frame waits this long for later pulses, which tell why.
_PATIENCE_NS: Final = 30 * NS_PER_S
#: Pulses this much slower than the rig file says get more time, so that later ones can still tell of their frames.
_SLOWER: Final = 1.25
#: Times of decided pulses that are remembered.
_REMEMBERED: Final = 256
_TIME: Final = attrgetter("time")


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
        self._least_hold_ns, self._nominal_ns, self._exposes = hold_ns, period_ns, exposes
        self._train = PulseTrain(period_ns, tolerance_ns, spread_ns)
        self._tracks = [CameraTrack(self._train, exposure_ns) for exposure_ns in exposures_ns or [0] * cameras]
        self._held = HeldFrames(cameras)
        self._silence = Silence(self._tracks, self._held, self._train)
        self._fired = FiredPulses(self._train)
        self._open: list[OpenPulse] = []
        self._unseen = UnseenPulses(
            self._open, self._tracks, self._held, self._train, self._fired, self._deadline, self._hold_ns
        )
        self._decided: deque[HostNs] = deque(maxlen=_REMEMBERED)
        self._others = [
            OtherCameras(camera, self._tracks, self._open, self._decided, self._held, self._train)
            for camera in range(len(self._tracks))
        ]
        self._hurry_until = HostNs(0)
        self._open_most = max(SILENT_PERIODS, hold_ns // period_ns)
        self._closed = 0
        self._proven_by_ids = self._unwatched = 0

    # -- records in ----------------------------------------------------------------------------------------------

    def frame(self, camera: int, record: Record) -> OpenPulse | None:
        """Assign a whole frame to its pulse, or hold it until its trigger time can be believed.

        Returns:
            The pulse, or None: the frame is held (`holds`), or it belongs to no open pulse: the camera's clock is not
            known yet, the pulse is decided already, or the frame came twice. `counters` tells which.
        """
        track = self._tracks[camera]
        if not self._is_current(track, record):
            return None
        time = track.anchor(record)
        if time is None:
            return None
        if len(self._tracks) == 1 or not track.belief.warm:
            return self._place(camera, record, time)
        if self._held.first(camera) is None and track.judge((record,), self._others[camera]) is Verdict.BELIEVED:
            return self._place(camera, record, time)
        if not track.connected:
            track.counters.stale += 1
            return None
        track.waits(record)
        self._held.hold(camera, record)
        return None

    def holds(self, camera: int, record: Record) -> bool:
        """Whether a frame for which `frame` has returned no pulse waits; `released` will tell what became of it."""
        return self._held.has(camera, record)

    def released(self, now: HostNs) -> list[Released]:
        """Place or refuse the frames that wait, as far as can be told at host time `now`.

        To be called before every `advance`, which may decide the pulses of these frames.

        Returns:
            The frames that no longer wait, since the last call.
        """
        if self._held.count:
            for camera in range(len(self._tracks)):
                self._settle_held(camera)
            while ended := self._held.ended(now):
                for camera in ended:
                    self._settle_first(camera)
        return self._held.released()

    def damaged(self, camera: int, record: Record) -> None:
        """Enter a damaged arrival; only the times of the record are used."""
        track = self._tracks[camera]
        if not self._is_current(track, record):
            return
        if not track.connected:
            track.counters.stale += 1
        elif self._held.first(camera) is not None:
            self._held.hold(camera, record)
        else:
            track.note_damage(record)

    def latch(self, camera: int, latch: ClockLatch) -> None:
        """Enter a reading of the camera's clock; those of an epoch come after its `connected`."""
        track = self._tracks[camera]
        steps = track.clock.steps
        track.latch(latch)
        if track.clock.steps != steps:
            self._end_waiting(camera, self._refuse_first)  # their times are of a clock that is no more

    def fired(self, number: int, time: HostNs, uncertainty_ns: int) -> None:
        """Enter a pulse that the source says it has fired: it gets a tag even if no camera saw it.

        Args:
            number: as the source counts; where it does not follow on the last one, some were not told.
            time: when it fired, by the source's clock; with a largest error of `uncertainty_ns`.
            uncertainty_ns: ns.
        """
        self._fired.add(number, time, uncertainty_ns)

    def fired_until(self, time: HostNs) -> None:
        """Note that the source has told of all pulses up to a time."""
        self._fired.until(time)

    def connected(self, camera: int, epoch: int, host: HostNs) -> None:
        """Begin an epoch of a camera: pulses from now on wait for its frames."""
        self._end_waiting(camera, self._settle_first)
        self._tracks[camera].connect(epoch, host)

    def disconnected(self, camera: int, host: HostNs) -> None:
        """End the epoch of a camera: no pulse waits for it any more."""
        self._end_waiting(camera, self._settle_first)
        self._tracks[camera].disconnect(host)

    # -- decisions out -------------------------------------------------------------------------------------------

    def advance(self, now: HostNs) -> list[ClosedPulse]:
        """Decide what can be decided at host time `now`.

        Returns:
            The pulses decided now, in the order of time.
        """
        closed: list[ClosedPulse] = []
        while True:
            due = bool(self._open) and self._is_due(self._open[0], now)
            if not self._unseen.insert(now, due=due):
                return closed
            closed.append(self._close(self._open.pop(0)))

    def next_deadline(self) -> HostNs | None:
        """When `advance` must be called at the latest although nothing arrives; None if there is no open pulse."""
        deadline = self._deadline() if self._open else None
        if self._held.count and (end := self._held.next_end()) is not None:
            return end if deadline is None else min(deadline, end)
        return deadline

    @property
    def open(self) -> Sequence[OpenPulse]:
        """The pulses that some camera saw and that are not decided yet, in the order of time; not to be changed."""
        return self._open

    @property
    def oldest(self) -> HostNs | None:
        """Time of the oldest pulse that is not decided yet; None if there is none."""
        fired = self._fired.oldest
        if not self._open:
            return fired
        return self._open[0].time if fired is None else min(fired, self._open[0].time)

    def hurry(self, until: HostNs) -> None:
        """Let no pulse up to a time wait longer than the hold for what later ones may tell: a recording ends."""
        self._hurry_until = max(self._hurry_until, until)

    def silent(self) -> tuple[int, ...]:
        """The connected cameras that have delivered nothing for three periods while others did."""
        return tuple(camera for camera, track in enumerate(self._tracks) if track.silent)

    def overdue(self, now: HostNs) -> tuple[int, ...]:
        """The connected cameras that are three pulses behind the others at host time `now`, and should be examined.

        This comes sooner than `silent` and is only a suspicion: pulses wait for their frames all the same, up to the
        deadline. Frames that are on their way, or held back behind a damaged one, cause no suspicion.
        """
        return tuple(self._silence.overdue(self._open, now, self._hold_ns()))

    def slow(self, now: HostNs) -> tuple[int, ...]:
        """The cameras whose frames come so late, at host time `now`, that their pulses are decided already."""
        return tuple(camera for camera, track in enumerate(self._tracks) if track.comes_late(now))

    def lag_ms(self, camera: int) -> float:
        """How much later than usual the last frame of a camera came, ms."""
        return self._tracks[camera].lag_ns / 1e6

    @property
    def counters(self) -> tuple[CameraCounters, ...]:
        """Totals of each camera."""
        return tuple(track.counters for track in self._tracks)

    def health(self) -> PairingHealth:
        """Rhythm, spread and each camera's clock and totals."""
        train, split = self._train, self._train.split
        return PairingHealth(
            pulses=self._closed, proven_by_ids=self._proven_by_ids, unwatched=self._unwatched, open=len(self._open),
            period_us=round(train.period_ns / 1000, 3),
            spread_median_us=train.spread_median_ns / 1000,
            spread_max_us=train.spread_max_ns / 1000,
            spread_usual_us=train.spread_usual_ns / 1000,
            alarm=train.alarm,
            cameras=tuple(camera_health(track, train.last) for track in self._tracks),
            rate_hz=NS_PER_S / train.period_ns if train.steady else None,
            split_us=None if split is None or not is_recent(split[0], train.last) else split[1] / 1000,
            source=source_health(self._fired, train.last),
        )  # fmt: skip

    # -- details -------------------------------------------------------------------------------------------------

    def _is_current(self, track: CameraTrack, record: Record) -> bool:
        """Whether a record is of the camera's present epoch; the first epoch may begin without `connected`."""
        if record.epoch == track.epoch:
            return True
        if track.epoch == 0:
            track.connect(record.epoch, HostNs(record.host_time - self._least_hold_ns))
            return True
        track.counters.stale += 1
        return False

    def _hold_ns(self) -> int:
        """How long after a pulse its frames may come; longer where the pulses are far slower than the rig file says."""
        times = self._train.period_ns / self._nominal_ns
        return round(self._least_hold_ns * times) if times > _SLOWER else self._least_hold_ns

    def _settle_held(self, camera: int) -> None:
        """Place or refuse the frames of a camera that wait, as far as the evidence goes."""
        track, others = self._tracks[camera], self._others[camera]
        while waiting := self._held.frames(camera):
            verdict = track.judge(waiting, others)
            if verdict is Verdict.CONTRADICTED and track.clock_anew():
                verdict = track.judge(waiting, others)
            if verdict is Verdict.WAITS:
                return
            if verdict is Verdict.BELIEVED:
                self._release(camera)
            else:
                self._refuse_first(camera, contradicted=True)

    def _settle_first(self, camera: int) -> None:
        """Place or refuse the first frame of a camera that waits, which has waited for as long as it may."""
        waiting = self._held.frames(camera)
        if waiting:
            track = self._tracks[camera]
            if track.judge(waiting, self._others[camera], now_or_never=True) is Verdict.BELIEVED:
                self._release(camera)
            else:
                self._refuse_first(camera)
        self._settle_held(camera)

    def _end_waiting(self, camera: int, end_first: Callable[[int], None]) -> None:
        """Let no frame of a camera wait any longer: no more evidence will come. `end_first` takes out the first one."""
        self._note_damage_behind(camera)
        while self._held.first(camera) is not None:
            end_first(camera)

    def _refuse_first(self, camera: int, *, contradicted: bool = False) -> None:
        """Refuse the first frame of a camera that waits."""
        track, record = self._tracks[camera], self._held.take(camera)
        (track.contradict if contradicted else track.refuse)(record)
        self._held.release(camera, record, None)
        self._note_damage_behind(camera)

    def _release(self, camera: int) -> None:
        """Place the first frame of a camera that waits."""
        track, record = self._tracks[camera], self._held.take(camera)
        time = track.trigger_time(record.device_time)
        self._held.release(camera, record, self._place(camera, record, time))
        self._note_damage_behind(camera)

    def _note_damage_behind(self, camera: int) -> None:
        """Enter the damaged arrivals behind a frame that no longer waits."""
        track = self._tracks[camera]
        while (behind := self._held.first(camera)) is not None and behind.kind is RecordKind.DAMAGED:
            track.note_damage(self._held.take(camera))

    def _place(self, camera: int, record: Record, time: HostNs) -> OpenPulse | None:
        """Assign a frame, triggered at `time`, to its pulse; None if there is no open one."""
        track = self._tracks[camera]
        if self._exposes is not None and not self._exposes(
            time, max(CLOCKS_NS, 2 * track.clock.uncertainty_since(time))
        ):
            track.refuse(record)
            return None
        # A frame that was still queued when its camera was disconnected is used, but its id proves nothing.
        if track.connected and not track.follow(record, time):
            return None
        train = self._train
        if train.last is not None and time <= train.last + train.tolerance_ns:
            track.counters.late += 1
            return None
        pulse = self._nearest(time, train.tolerance_ns)
        if pulse is None and (tolerance := 2 * track.clock.uncertainty_since(time)) > train.tolerance_ns:
            pulse = self._nearest(time, min(tolerance, train.widest_ns))  # its clock has not been read for long
        if pulse is None:
            pulse = OpenPulse(len(self._tracks), time)
            insort(self._open, pulse, key=_TIME)
        elif pulse.frames[camera] is not None:
            track.counters.duplicate += 1
            return None
        else:
            # At once, not when the pulse is decided: in a backlog the same error would be corrected many times.
            track.clock.correct(record.device_time, pulse.time - time)
        pulse.add(camera, record, time)
        return pulse

    def _nearest(self, time: HostNs, tolerance: float) -> OpenPulse | None:
        """The open pulse nearest to a trigger time, None if there is none within the tolerance."""
        position = bisect_left(self._open, time, key=_TIME)
        nearest, least = None, tolerance
        for pulse in self._open[max(0, position - 1) : position + 1]:
            if abs(pulse.time - time) <= least:
                nearest, least = pulse, abs(pulse.time - time)
        return nearest

    def _is_due(self, pulse: OpenPulse, now: HostNs) -> bool:
        """Whether the oldest open pulse can be decided."""
        if pulse.missing == 0 or pulse.proven_by_ids or pulse.unwatched:
            return True
        if now >= self._deadline():
            self._silence.decide(pulse, self._open, now)
            return True
        return not any(track.may_deliver(pulse.time) for track in self._lacking(pulse))

    def _deadline(self) -> HostNs:
        """When the oldest open pulse is decided at the latest.

        Pulses in a rhythm are decided at the end of the hold: by then the frames of the next ones have come, whose ids
        tell why one is missing. A pulse from a hand waits for as many others as fire during the hold in a rhythm, if
        they do not keep it waiting too long; so there are never more open pulses than in a rhythm.
        """
        pulse = self._open[0]
        hold = HostNs(pulse.time + self._hold_ns())
        if self._held.count:
            hold = max(hold, self._held.last_end(pulse, hold))
        if pulse.time <= self._hurry_until or self._train.rhythm_ns is not None:
            return hold
        if not any(track.will_tell and track.may_deliver(pulse.time) for track in self._lacking(pulse)):
            return hold
        patience = HostNs(pulse.time + _PATIENCE_NS)
        if len(self._open) <= self._open_most:
            return max(hold, patience)
        return max(hold, min(patience, self._open[self._open_most].time))

    def _lacking(self, pulse: OpenPulse) -> Iterable[CameraTrack]:
        return (track for track, frame in zip(self._tracks, pulse.frames, strict=True) if frame is None)

    def _close(self, pulse: OpenPulse) -> ClosedPulse:
        outcomes = []
        for camera, track in enumerate(self._tracks):
            record, time = pulse.frames[camera], pulse.times[camera]
            if record is None or time is None:
                settle = track.settle_unwatched if pulse.unwatched else track.settle
                outcome = (track.settle_fired if pulse.fired else settle)(pulse.time, self._rivals(camera, track))
            else:
                track.forget_until(time)
                offset = time - pulse.time
                outcome = Outcome(FrameStatus.OK, record, offset)
            track.counters.count(outcome.status)
            outcomes.append(outcome)
        if pulse.unwatched:
            self._train.go_on(pulse.time)
        else:
            self._train.advance(pulse.time, pulse.spread_ns, pulse.delivered)
        missed = pulse.fired and any(outcome.status is FrameStatus.MISSED for outcome in outcomes)
        self._fired.decided(pulse.time, inserted=pulse.fired, seen=pulse.delivered > 0, missed=missed)
        self._closed += 1
        self._decided.append(pulse.time)
        self._proven_by_ids += pulse.proven_by_ids
        self._unwatched += pulse.unwatched
        return ClosedPulse(RigPulse(self._closed), pulse.time, tuple(outcomes), pulse.cargo, pulse.unwatched)

    def _rivals(self, camera: int, track: CameraTrack) -> list[HostNs]:
        """Times of the later pulses that lack the camera too, up to its next frame."""
        times: list[HostNs] = []
        if track.has_damaged():
            for pulse in self._open:
                if pulse.frames[camera] is not None:
                    break
                times.append(pulse.time)
        return times
