"""Judges whether the trigger time of a frame is plausible: frame numbers, times and arrivals must agree.

A camera's clock may be set at any time, by PTP when it locks or by an unreported restart, and the times of its frames
may slip while its clock goes on. A time that is off by a whole period looks like a good time of another pulse. Three
kinds of evidence tell: the frame number, which goes on by one for each frame that the camera took; the readings of the
clock; and the arrival (`arrivals`). A frame is accepted at once if all of them agree. Any other
frame waits for more evidence: for its camera's next frames, the next reading of the clock, and the frames of the other
cameras. A camera of which a frame was rejected is doubted: its frames are refused until several in a row agree in
everything.
"""

from collections.abc import Iterator, Sequence
from enum import Enum
from itertools import islice
from typing import Final, NamedTuple, Protocol

from rig.clocks import HostNs
from triggering.pairing.camera.arrivals import Arrivals, ArrivalTest
from triggering.timeline.pulse_train import PulseTrain

#: A camera's first frames are accepted: the rig warms up, and no rhythm is known by which they could be judged.
_FIRST: Final = 16
#: Frames in a row that end a doubt, and that end the wait where nothing contradicts them.
_FRAMES_TO_END_DOUBT: Final = 8
#: So many frames of a group are enough to judge it by.
_FRAMES_JUDGED: Final = 32
#: So many frames beside the rhythm that go on in it are accepted, if no other camera has a frame near.
_FRAMES_OFF_RHYTHM: Final = 3
#: A camera goes on in its rhythm within so many frames after a rejected one, or is doubted: one odd time is no slip.
_SINGLE: Final = 4


class Timed(NamedTuple):
    """A frame: its number, its trigger time by the camera's clock, and when it came.

    Attributes:
        step: frames that the camera took since the frame before, by the numbers; for the first one since the last
            accepted frame; None if there is none.
        time: trigger time on the common time line.
        arrival: host time at which it came.
    """

    step: int | None
    time: HostNs
    arrival: HostNs

    @property
    def latency_ns(self) -> int:
        """Time from the trigger to the arrival."""
        return self.arrival - self.time


class Others(Protocol):
    """What is known of the frames of the other cameras."""

    def coincide(self, time: HostNs) -> bool | None:
        """Whether one of them has a frame of a time, and this camera has none yet; None: none has any near it."""

    def pulses(self, since: HostNs, until: HostNs) -> int | None:
        """How many pulses are known after one time, until another; None: that is too long ago."""


class Verdict(Enum):
    """What becomes of a frame."""

    ACCEPTED = "accepted"
    WAITS = "waits"
    REJECTED = "rejected"


class _Evidence(NamedTuple):
    """What is known when a frame is judged: the arguments of `Plausibility.judge`, and what follows from them.

    Attributes:
        group: the frames from the first on that come in one rhythm.
        arrivals: test of their arrivals.
        closed: whether a frame has come that does not belong to the group.
        final: no more evidence can be waited for.
    """

    last: HostNs | None
    waiting: Sequence[Timed]
    group: Sequence[Timed]
    arrivals: ArrivalTest
    others: Others
    read: bool
    closed: bool
    final: bool


class Plausibility:
    """Judges the frames of one camera.

    Args:
        train: the rhythm of the pulses.
        arrivals: how long after their triggers the accepted frames came.

    Attributes:
        doubted: frames refused since a frame was rejected; 0: the camera is not doubted.
    """

    def __init__(self, train: PulseTrain, arrivals: Arrivals) -> None:
        self._train, self._arrivals = train, arrivals
        self.doubted = 0

    @property
    def warm(self) -> bool:
        """Whether enough is known to judge frames by it."""
        return self._arrivals.frames >= _FIRST

    def judge(
        self, last: HostNs | None, waiting: Sequence[Timed], *, read: bool, others: Others, final: bool = False
    ) -> Verdict:
        """Judge the first of the frames that wait.

        Args:
            last: trigger time of the last accepted frame; None: there is none in this epoch.
            waiting: the frames that have come since, in order.
            read: whether the clock has been read after the first of them, and goes on as it did.
            others: the frames of the other cameras.
            final: no more evidence can be waited for.
        """
        first = waiting[0]
        if not self._train.rhythm.steady:
            return Verdict.ACCEPTED if read else Verdict.WAITS
        goes_on = last is not None and self._follows(last, first)
        if goes_on and self.doubted <= _SINGLE and self._arrivals.is_usual(first.latency_ns):
            return Verdict.ACCEPTED
        group = list(islice(self._group(waiting, gaps=not goes_on), _FRAMES_JUDGED))
        arrivals = self._arrivals.test([frame.latency_ns for frame in group])
        if arrivals.contradicts:
            return Verdict.REJECTED
        closed = len(group) < min(len(waiting), _FRAMES_JUDGED)
        evidence = _Evidence(last, waiting, group, arrivals, others, read, closed, final)
        if self.doubted:
            return self._judge_in_doubt(evidence)
        return self._judge_in_turn(evidence) if goes_on else self._judge_out_of_turn(evidence)

    def _judge_in_doubt(self, evidence: _Evidence) -> Verdict:
        """Judge a frame of a doubted camera: several in a row have to agree in everything."""
        several = len(evidence.group) >= _FRAMES_TO_END_DOUBT
        sound = several and evidence.read and self._is_sound(evidence)
        if sound and all(evidence.others.coincide(frame.time) is not False for frame in evidence.group):
            return Verdict.ACCEPTED
        return Verdict.REJECTED if evidence.closed or several else Verdict.WAITS

    def _is_sound(self, evidence: _Evidence) -> bool:
        """Whether arrivals confirm a group with its first frame; the time of that one alone may still be off."""
        if self._arrivals.scatter:
            return self._has_room(evidence)
        return evidence.arrivals.confirms and self._is_first_sound(evidence)

    def _is_first_sound(self, evidence: _Evidence) -> bool:
        """Whether the first frame alone came nearer to its own pulse than to a neighbouring one."""
        return self._arrivals.is_usual(evidence.waiting[0].latency_ns)

    def _is_first_against(self, evidence: _Evidence) -> bool:
        """Whether the arrival of the first frame alone speaks against its time, whatever came behind it."""
        return self._arrivals.test([evidence.waiting[0].latency_ns]).speaks_against

    def _judge_in_turn(self, evidence: _Evidence) -> Verdict:
        """Judge a frame that goes on from the last one in number and time, but did not come as usual."""
        arrivals, ended = evidence.arrivals, evidence.final or evidence.closed
        if arrivals.confirms or (arrivals.shifted < 0 and evidence.read):
            return Verdict.ACCEPTED
        if ended and arrivals.speaks_against:
            return Verdict.REJECTED
        return Verdict.ACCEPTED if evidence.final or (evidence.closed and evidence.read) else Verdict.WAITS

    def _judge_out_of_turn(self, evidence: _Evidence) -> Verdict:
        """Judge a frame that does not go on in number and time: of a pulse after missed ones, or beside the rhythm."""
        arrivals, several = evidence.arrivals, len(evidence.group) >= _FRAMES_TO_END_DOUBT
        # Frames behind it that came as usual confirm the rhythm, but not that the first one belongs to it.
        if arrivals.confirms and self._is_first_sound(evidence):
            enough = True
        else:
            has_room = self._has_room(evidence)
            if not has_room and (evidence.closed or several or evidence.final):
                return Verdict.REJECTED
            against = arrivals.speaks_against or self._is_first_against(evidence)
            if against and (evidence.closed or evidence.final):
                return Verdict.REJECTED
            no_more = evidence.final or self._arrivals.scatter
            enough = no_more and not against and has_room
        return self._judge_place(evidence) if enough and evidence.read else Verdict.WAITS

    def _judge_place(self, evidence: _Evidence) -> Verdict:
        """Judge by the other cameras a frame out of turn, whose clock was read after it."""
        last, waiting, first = evidence.last, evidence.waiting, evidence.waiting[0]
        near = evidence.others.coincide(first.time)
        skips = near is None and (last is None or self._skips(last, first))  # alone, after pulses that it missed
        beside = last is not None and any(self._follows(last, later) for later in _since_last(waiting))
        if last is not None and first.step is not None and self._periods_beyond(last, first):
            if beside:  # the camera took each frame of the rhythm, and this one at another pulse than its time says
                return Verdict.REJECTED
            known = evidence.others.pulses(last, first.time)
            if len(waiting) == 1 and known != first.step and not evidence.final:  # the next frame tells
                return Verdict.WAITS
        if near or skips or beside:
            return Verdict.ACCEPTED
        if near is None and all(evidence.others.coincide(frame.time) is not False for frame in evidence.group):
            # Alone, with those behind it: there is no frame beside which it could be set wrongly.
            return Verdict.ACCEPTED if evidence.final or len(evidence.group) >= _FRAMES_OFF_RHYTHM else Verdict.WAITS
        return Verdict.WAITS if len(waiting) < _FRAMES_OFF_RHYTHM else Verdict.REJECTED

    def _has_room(self, evidence: _Evidence) -> bool:
        """Whether there were as many pulses since the last accepted frame as the camera took frames."""
        last, frame = evidence.last, evidence.waiting[0]
        if last is None or frame.step is None:
            return not self.doubted
        if frame.step <= 0:
            return False
        if not self.doubted and frame.time - last >= frame.step * self._train.period_ns - self._train.tolerance_ns:
            return True
        pulses = evidence.others.pulses(last, frame.time)
        return pulses is not None and pulses >= frame.step

    def _skips(self, last: HostNs, frame: Timed) -> bool:
        """Whether a frame comes whole periods later than its number says: the camera missed pulses between."""
        return self._periods_beyond(last, frame) > 0

    def _periods_beyond(self, last: HostNs, frame: Timed) -> int:
        """By how many whole periods a frame comes later than its number says; 0: by none, or beside the rhythm."""
        if frame.step is None or frame.step <= 0:
            return 0
        beyond = frame.time - last - frame.step * self._train.period_ns
        periods = round(beyond / self._train.period_ns)
        return periods if abs(beyond - periods * self._train.period_ns) <= self._train.tolerance_ns else 0

    def _follows(self, before: HostNs, frame: Timed) -> bool:
        """Whether a frame comes as long after another one as its number says."""
        if frame.step is None or frame.step <= 0:
            return False
        return abs(frame.time - before - frame.step * self._train.period_ns) <= self._train.tolerance_ns

    def _group(self, waiting: Sequence[Timed], *, gaps: bool) -> Iterator[Timed]:
        """The first frames that come in one rhythm; `gaps`: the camera may have missed pulses between them."""
        before = None
        for frame in waiting:
            if before is not None and not (
                self._follows(before.time, frame) or (gaps and self._skips(before.time, frame))
            ):
                return
            yield frame
            before = frame


def _since_last(waiting: Sequence[Timed]) -> Iterator[Timed]:
    """The frames behind the first one, with their steps since the last accepted frame."""
    step = waiting[0].step
    for frame in waiting[1:]:
        if step is None or frame.step is None:
            return
        step += frame.step
        yield frame._replace(step=step)
