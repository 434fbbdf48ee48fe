"""Judges whether the trigger time of a frame can be believed: frame numbers, times and arrivals must agree.

A camera's clock may be set at any time, by PTP that locks or by a restart that nobody reports, and the times of its
frames may slip while the clock that can be read goes on. A time that is off by a whole period looks like a good one of
another pulse. Three witnesses tell: the frame number, which goes on by one for each frame that the camera took; the
readings of the clock; and the arrival, since a frame comes about as long after its pulse as those before it. A frame
that all of them bear out is believed at once. Any other one waits for more evidence: for its camera's next frames, the
next reading of the clock, and the frames of the other cameras. Once a camera was contradicted, it is doubted: its
frames are refused until several in a row agree in everything.
"""

import math
from collections import deque
from collections.abc import Iterator, Sequence
from enum import Enum
from itertools import islice
from typing import Final, NamedTuple, Protocol

from rig.clocks import HostNs
from triggering.timeline.pulse_train import PulseTrain

#: A camera's first frames are believed: the rig warms up, and no rhythm is known by which they could be judged.
_FIRST: Final = 16
#: Weight of a frame in the longest time to the arrival, which otherwise fades.
_FADES: Final = 0.01
#: What is usual of arrivals is learned from so many, anew after each so many: their median, and how far one
#: standard deviation lies below it: what comes late lies above.
_RECENT: Final = 256
_LEARN_EVERY: Final = 16
#: How widely they scatter is known from so many on.
_KNOWN: Final = 64
_QUANTILES: Final = (0.16, 0.5)
#: Standard deviation of an arrival at least, ns: clocks are read, and processes are woken, no more exactly.
_LEAST_NS: Final = 1e6
#: So many arrivals in a thousand say nothing: the computer was busy. They are anywhere within `_ANYWHERE_NS`.
_IDLE: Final = 0.01
_ANYWHERE_NS: Final = 1e9
#: Logarithm of the odds at which arrivals bear times out, speak against them, and contradict them: two frames that
#: came as usual after another pulse.
_FOR: Final = 3.0
_SPEAKS: Final = 6.0
_AGAINST: Final = 14.0
#: Arrivals whose standard deviation is a smaller share of the period tell one pulse from the next, if not one by one.
_TELLING: Final = 2
#: Shifts by so many periods are told from none.
_SHIFTS: Final = 8
#: Frames in a row that end a doubt, and that end the wait where nothing contradicts them.
_SEVERAL: Final = 8
#: So many frames of a group are enough to judge it by.
_MOST: Final = 32
#: Frames beside the rhythm of which nothing else is known, and that go on so.
_FEW: Final = 3
#: A camera that is contradicted goes on from the frame before within so many frames, or not at all: a single odd time.
_SINGLE: Final = 4


class Timed(NamedTuple):
    """A frame: its number, its trigger time by the camera's clock, and when it came.

    Attributes:
        step: frames that the camera took since the one before it, by the numbers; of the first one since the last
            frame that was believed, None if there is none.
    """

    step: int | None
    time: HostNs
    arrival: HostNs


class _Arrivals(NamedTuple):
    """What the arrivals of frames say of their times.

    Attributes:
        favour: logarithm of the odds that they came as usual.
        against: the same of that their times are off by periods.
    """

    favour: float
    against: float

    @property
    def bear_out(self) -> bool:
        """They bear the times out."""
        return self.favour >= _FOR

    @property
    def speak_against(self) -> bool:
        """They speak against the times, but a few frames may have come so by chance."""
        return self.against >= _SPEAKS

    @property
    def contradict(self) -> bool:
        """They contradict the times."""
        return self.against >= _AGAINST


class Others(Protocol):
    """What is known of the frames of the other cameras."""

    def coincide(self, time: HostNs) -> bool | None:
        """Whether one of them has a frame of a time, and this camera has none yet; None: none has any near it."""

    def pulses(self, since: HostNs, until: HostNs) -> int | None:
        """How many pulses are known after one time, until another; None: that is too long ago."""


class Verdict(Enum):
    """What a frame's time is worth."""

    BELIEVED = "believed"
    WAITS = "waits"
    CONTRADICTED = "contradicted"


class _Evidence(NamedTuple):
    """What is known when a frame is judged: the arguments of `Belief.judge`, and what follows from them.

    Attributes:
        group: the frames from the first on that come in one rhythm.
        arrivals: what their arrivals say.
        closed: whether a frame has come that does not belong to the group.
        final: no more evidence can be waited for.
    """

    last: HostNs | None
    waiting: Sequence[Timed]
    group: Sequence[Timed]
    arrivals: _Arrivals
    others: Others
    read: bool
    closed: bool
    final: bool


class Belief:
    """Judges the frames of one camera.

    Args:
        train: the rhythm of the pulses.

    Attributes:
        longest_ns: longest time of late from the trigger of a frame to its arrival.
        doubted: frames refused since the camera was contradicted; 0: it is not doubted.
    """

    def __init__(self, train: PulseTrain) -> None:
        self._train = train
        self._frames = 0
        self._usual_ns, self._sigma_ns = 0.0, _LEAST_NS
        self._latencies: deque[int] = deque(maxlen=_RECENT)
        self.longest_ns = 0.0
        self.doubted = 0

    def saw(self, latency_ns: int) -> None:
        """Enter the time from the trigger of a frame that was believed to its arrival."""
        self._frames += 1
        self._latencies.append(latency_ns)
        if self._frames % _LEARN_EVERY == 0:
            self._learn()
        longer = latency_ns - self.longest_ns
        self.longest_ns += longer if longer > 0 else _FADES * longer

    def _learn(self) -> None:
        """Learn what is usual: quantiles, on which what comes late for once has no weight."""
        ordered = sorted(self._latencies)
        low, self._usual_ns = (float(ordered[round(share * (len(ordered) - 1))]) for share in _QUANTILES)
        doubtful = 1 + 2 / math.sqrt(len(ordered))  # a few arrivals may lie closer together than all do
        self._sigma_ns = max(doubtful * (self._usual_ns - low), _LEAST_NS)

    @property
    def warm(self) -> bool:
        """Whether enough is known to judge frames by it."""
        return self._frames >= _FIRST

    def judge(
        self,
        last: HostNs | None,
        waiting: Sequence[Timed],
        *,
        read: bool,
        others: Others,
        now_or_never: bool = False,
    ) -> Verdict:
        """Judge the first of the frames that wait.

        Args:
            last: trigger time of the last frame that was believed; None: there is none in this epoch.
            waiting: the frames that have come since, in order.
            read: whether the clock has been read after the first of them, and goes on as it did.
            others: the frames of the other cameras.
            now_or_never: no more evidence can be waited for.
        """
        first = waiting[0]
        if not self._train.steady:
            return Verdict.BELIEVED if read else Verdict.WAITS
        goes_on = last is not None and self._follows(last, first)
        if goes_on and self.doubted <= _SINGLE and self._comes_as_usual(first):
            return Verdict.BELIEVED
        group = list(islice(self._group(waiting, gaps=not goes_on), _MOST))
        arrivals = self._arrivals(group)
        if arrivals.contradict:
            return Verdict.CONTRADICTED
        evidence = _Evidence(
            last,
            waiting,
            group,
            arrivals,
            others,
            read,
            closed=len(group) < min(len(waiting), _MOST),
            final=now_or_never,
        )
        if self.doubted:
            return self._judge_in_doubt(evidence)
        return self._judge_in_turn(evidence) if goes_on else self._judge_out_of_turn(evidence)

    def _judge_in_doubt(self, evidence: _Evidence) -> Verdict:
        """Judge a frame of a camera that was contradicted: several in a row have to agree in everything."""
        first, several = evidence.waiting[0], len(evidence.group) >= _SEVERAL
        sound = several and evidence.read and self._is_sound(evidence)
        if sound and evidence.others.coincide(first.time) is not False:
            return Verdict.BELIEVED
        return Verdict.CONTRADICTED if evidence.closed or several else Verdict.WAITS

    def _is_sound(self, evidence: _Evidence) -> bool:
        """Whether arrivals bear a group out, its first frame too, which may be the last whose time was off."""
        if self._scatter:
            return self._has_room(evidence)
        return evidence.arrivals.bear_out and self._arrivals(evidence.waiting[:1]).against < _FOR

    def _judge_in_turn(self, evidence: _Evidence) -> Verdict:
        """Judge a frame that goes on from the last one in number and time, but did not come as usual."""
        arrivals, ended = evidence.arrivals, evidence.final or evidence.closed
        if arrivals.bear_out or (arrivals.against < 0 and evidence.read):
            return Verdict.BELIEVED
        if ended and arrivals.speak_against:
            return Verdict.CONTRADICTED
        return Verdict.BELIEVED if evidence.final or (evidence.closed and evidence.read) else Verdict.WAITS

    def _judge_out_of_turn(self, evidence: _Evidence) -> Verdict:
        """Judge a frame that does not go on in number and time: of a pulse after missed ones, or beside the rhythm."""
        arrivals, several = evidence.arrivals, len(evidence.group) >= _SEVERAL
        if not arrivals.bear_out:
            if not self._has_room(evidence) and (evidence.closed or several or evidence.final):
                return Verdict.CONTRADICTED
            if evidence.closed and arrivals.speak_against:
                return Verdict.CONTRADICTED
            told = evidence.final or self._scatter
            enough = told and not arrivals.speak_against and self._has_room(evidence)
        else:
            enough = True
        return self._judge_place(evidence) if enough and evidence.read else Verdict.WAITS

    def _judge_place(self, evidence: _Evidence) -> Verdict:
        """Judge by the other cameras a frame out of turn, whose clock was read after it."""
        last, waiting, first = evidence.last, evidence.waiting, evidence.waiting[0]
        near = evidence.others.coincide(first.time)
        skips = near is None and (last is None or self._skips(last, first))  # alone, after pulses that it missed
        beside = last is not None and any(self._follows(last, later) for later in _since_last(waiting))
        if near or skips or beside:
            return Verdict.BELIEVED
        if near is None:  # alone: there is no frame beside which it could be set wrongly
            return Verdict.BELIEVED if evidence.final or len(evidence.group) >= _FEW else Verdict.WAITS
        return Verdict.WAITS if len(waiting) < _FEW else Verdict.CONTRADICTED

    def _has_room(self, evidence: _Evidence) -> bool:
        """Whether there were as many pulses since the last frame that was believed as the camera took frames."""
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
        """Whether a frame comes whole periods after its numbers would have it: the camera missed pulses between."""
        if frame.step is None or frame.step <= 0:
            return False
        beyond = frame.time - last - frame.step * self._train.period_ns
        periods = round(beyond / self._train.period_ns)
        return periods > 0 and abs(beyond - periods * self._train.period_ns) <= self._train.tolerance_ns

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

    def _comes_as_usual(self, frame: Timed) -> bool:
        """Whether a frame comes so long after its pulse that it cannot be taken for one of a neighbouring pulse."""
        return self._scatter or abs(self._late(frame)) < self._train.period_ns / 2

    @property
    def _scatter(self) -> bool:
        """Whether arrivals scatter so widely that they cannot tell one pulse from the next, or may do so."""
        return self._frames < _KNOWN or self._sigma_ns > self._train.period_ns / _TELLING

    def _arrivals(self, group: Sequence[Timed]) -> _Arrivals:
        """What the arrivals of frames say of their times.

        They came as usual; or the link has become slow, and they come at any time; or their times are off by a number
        of periods, and they came as usual after other pulses.
        """
        if self._scatter:
            return _Arrivals(favour=0.0, against=-_FOR)
        late, sigma = [self._late(frame) for frame in group], self._sigma_ns
        usual, slow = (
            sum(_likelihood(each, sigma) for each in late),
            math.log(_IDLE) - len(late) * math.log(_ANYWHERE_NS),
        )
        period = self._train.period_ns
        shifted = max(
            sum(_likelihood(each - shift * period, sigma) for each in late)
            for shift in range(-_SHIFTS, _SHIFTS + 1)
            if shift != 0
        )
        return _Arrivals(favour=usual - max(slow, shifted), against=shifted - max(usual, slow))

    def _late(self, frame: Timed) -> float:
        return frame.arrival - frame.time - self._usual_ns


def _since_last(waiting: Sequence[Timed]) -> Iterator[Timed]:
    """The frames behind the first one, with their steps since the last believed one."""
    step = waiting[0].step
    for frame in waiting[1:]:
        if step is None or frame.step is None:
            return
        step += frame.step
        yield frame._replace(step=step)


def _likelihood(off_ns: float, sigma_ns: float) -> float:
    """Logarithm of the likelihood of an arrival, so much later than usual."""
    bell = math.exp(-0.5 * (off_ns / sigma_ns) ** 2) / (sigma_ns * math.sqrt(2 * math.pi))
    return math.log((1 - _IDLE) * bell + _IDLE / _ANYWHERE_NS)
