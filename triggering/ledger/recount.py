"""Recomputes the fate of every pulse in every camera from the frames of a log, and compares it with the tags.

The pairing decided while frames were still coming. Afterwards all frames are there, and two consecutive whole frames of
a camera determine the fate of the pulses between them: the frame numbers say how many frames the camera took, its
trigger count how many pulses it saw, its clock whether the second frame belongs to the pulse under which it is filed.
No other result of the pairing is used than the tags, which are compared.

Where there is no proof, the tags are counted as they are: pulses before the first and after the last frame of a camera,
and pulses at which the camera was gone or silent (by the log's events) or its clock was set.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final

from rig.clocks import NS_PER_S, UtcNs
from rig.events import Event
from rig.frame import FrameStatus
from rig.health import Health
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from rig.transport.recorder_reports import CameraNews
from triggering.ledger.recounted import Difference, Recounted
from triggering.ledger.source_recount import SourceRecount
from triggering.ledger.stretches import FRAMES, Run, shifts, stretches
from triggering.ledger.tagged_frames import TaggedFrame, frame_of, goes_on, id_step, is_of_another_pulse, recomputed

#: News after which numbers and clock of a camera prove nothing about the frames before it.
_BREAKS: Final = frozenset(
    {CameraNews.CONNECTED.value, CameraNews.SILENT.value, CameraNews.GONE.value, FrameStatus.ABSENT.value}
)
#: The rate of a camera's clock is known from frames that are at least so far apart.
_BASE_NS: Final = NS_PER_S
#: No clock is wrong by more than this share; a larger deviation is an error.
_GAIN_MAX: Final = 0.01
#: Disagreements that are kept one by one; the counts go on.
_KEPT: Final = 10_000


@dataclass(frozen=True, slots=True)
class _Gap:
    """The pulses between two whole frames of a camera; one of the frames is missing at the ends of the log.

    Attributes:
        before, after: the frames.
        tagged: the pulses between them that have tags, with their states.
        cut: the clock or the numbers do not go on from one to the other.
        run: the run of frames that begins with `after`.
    """

    before: TaggedFrame | None
    after: TaggedFrame | None
    tagged: tuple[tuple[PulseNumber, FrameStatus], ...]
    cut: bool
    run: Run | None = None


@dataclass(slots=True)
class _Camera:
    """State of one camera."""

    name: str
    states: Counter[FrameStatus] = field(default_factory=Counter)
    last: TaggedFrame | None = None
    first: TaggedFrame | None = None  #: since which the clock has been going on
    between: list[tuple[PulseNumber, FrameStatus]] = field(default_factory=list)
    gaps: list[_Gap] = field(default_factory=list)
    runs: list[Run] = field(default_factory=list)
    elsewhere: Difference | None = None  #: the stretch of frames of other pulses, by their clock, that goes on
    breaks: list[UtcNs] = field(default_factory=list)
    soonest: int | None = None  #: time from a pulse to the arrival of its frame, ns
    latest: int = 0

    def arrived(self, frame: TaggedFrame) -> None:
        """Note how long after its pulse a frame came."""
        late = frame.host - frame.time
        self.soonest = late if self.soonest is None else min(self.soonest, late)
        self.latest = max(self.latest, late)

    @property
    def scatter(self) -> int:
        """By how much the arrivals of its frames vary, ns."""
        return 0 if self.soonest is None else self.latest - self.soonest

    def comes_back(self, last: TaggedFrame, frame: TaggedFrame, nearest: int) -> bool:
        """Whether the last frame is the one that is filed under a wrong pulse, as its arrival says.

        It came otherwise than the first frames of the log, which are taken to be right, and this one came as they did.
        """
        first = self.runs[0]
        if first.frames < FRAMES:
            return False
        usual = first.late / first.frames
        last_off, off = (abs(each.host - each.time - usual) for each in (last, frame))
        return off < nearest / 2 < last_off

    def gain(self) -> float:
        """How much faster than the pulses' clock the camera's runs, as a factor."""
        if self.first is None or self.last is None or self.last.time - self.first.time < _BASE_NS:
            return 1.0
        gain = (self.last.device - self.first.device) / (self.last.time - self.first.time)
        return gain if abs(gain - 1) < _GAIN_MAX else 1.0


class Recount:
    """Takes tags and events of a log in their order; memory grows with the missing frames only."""

    def __init__(self) -> None:
        self._cameras: dict[str, _Camera] = {}
        self._pulses = 0
        self._earlier: TripletTag | None = None
        self._held: TripletTag | None = None
        self._differences: list[Difference] = []
        self._disagreements = self._unproven = 0
        self._source = SourceRecount()

    def add(self, tag: TripletTag) -> None:
        """Take the next tag; one that comes twice or too late is left out."""
        if self._held is not None:
            if tag.pulse <= self._held.pulse:
                return
            self._take(self._held, tag)
        self._source.add(tag)
        self._earlier, self._held = self._held, tag

    def happened(self, event: Event) -> None:
        """Take an event: numbers and clock of a camera prove nothing across its coming, going and falling silent."""
        if event.message.partition(":")[0] in _BREAKS:
            self._camera(event.name).breaks.append(event.time)

    def reported(self, health: Health, written: UtcNs) -> None:
        """Take a health record, written at a time: it holds reports of the source of the pulses."""
        self._source.reported(health, written)

    def finish(self, *, merged: bool = False) -> Recounted:
        """Judge everything; for use once, at the end of the log.

        Args:
            merged: the log is one of two computers, whose health records have two clocks.
        """
        if self._held is not None:
            self._take(self._held, None)
        for camera in self._cameras.values():
            camera.breaks.sort()
            self._end_elsewhere(camera)
            if camera.between:
                camera.gaps.append(_Gap(camera.last, None, tuple(camera.between), cut=True))
            for gap, moved in _with_moves(camera):
                if moved:
                    self._count_as_tagged(camera, gap)
                else:
                    self._judge(camera, gap)
            for stretch in stretches(camera.runs, shifts(camera.runs)):
                late = f"{abs(stretch.later) / 1e6:.1f} ms {'later' if stretch.by > 0 else 'sooner'}"
                why = f"its frame numbers jump against the pulses, and its frames come {late} after them than before"
                ok = FrameStatus.OK
                self._differs(Difference(stretch.first, camera.name, ok, None, why, stretch.last, stretch.by))
        self._differences.sort(key=lambda each: each.pulse)
        seen = {name: camera.states for name, camera in self._cameras.items() if camera.states}
        source = None if merged else self._source.finish()
        return Recounted(self._pulses, seen, self._unproven, tuple(self._differences), self._disagreements, source)

    def _camera(self, name: str) -> _Camera:
        return self._cameras.setdefault(name, _Camera(name))

    def _take(self, tag: TripletTag, later: TripletTag | None) -> None:
        """Take a tag whose neighbours are known."""
        self._pulses += 1
        times = [other.time for other in (self._earlier, later) if other is not None]
        apart = [abs(tag.time - time) for time in times] or [NS_PER_S]
        for part in tag.cameras:
            camera = self._camera(part.name)
            if part.status is not FrameStatus.OK:
                camera.between.append((tag.pulse, part.status))
            elif (frame := frame_of(tag, part)) is not None:
                self._whole(camera, frame, min(apart), max(apart))
            else:  # a tag that names no number or time: nothing can be proved across it
                camera.states[FrameStatus.OK] += 1
                camera.gaps.append(_Gap(camera.last, None, tuple(camera.between), cut=True))
                camera.between.clear()
                camera.last = None

    def _whole(self, camera: _Camera, frame: TaggedFrame, nearest: int, farther: int) -> None:
        """Take a whole frame; `nearest` and `farther` are the times from its pulse to those beside it, ns."""
        last = camera.last
        if last is None:
            cut, camera.first = True, frame
        else:
            by_clock = (frame.device - last.device) / camera.gain()
            off = by_clock - (frame.time - last.time)
            cut = abs(off) >= nearest / 2
            if cut and (frames := _slept_through(camera, last, frame, off)):
                why = f"{frames} frames that its numbers tell of came while this computer's clock stood still"
                self._differs(Difference(last.pulse, camera.name, FrameStatus.OK, None, why))
            elif (
                cut
                and not camera.comes_back(last, frame, nearest)
                and is_of_another_pulse(last, frame, by_clock, nearest, certain=not camera.between)
            ):
                why = f"clock and number say that it was triggered {abs(off) / 1e6:.1f} ms "
                why += "after this pulse" if off > 0 else "before this pulse"
                self._is_elsewhere(camera, frame.pulse, why, round(off / nearest))
                return
        self._end_elsewhere(camera)
        camera.arrived(frame)
        camera.states[FrameStatus.OK] += 1
        steps = 0 if last is None else frame.pulse - last.pulse
        excess = 0 if last is None or cut else id_step(last.frame_id, frame.frame_id) - steps
        if last is None or cut or excess or camera.between:
            camera.runs.append(Run(frame.pulse, frame.pulse, excess, nearest, farther))
        camera.runs[-1].take(frame.pulse, frame.host - frame.time, nearest, farther)
        if cut or camera.between or not goes_on(last, frame, steps):
            camera.gaps.append(_Gap(last, frame, tuple(camera.between), cut, camera.runs[-1]))
            camera.between.clear()
        camera.last = frame
        if cut:
            camera.first = frame

    def _judge(self, camera: _Camera, gap: _Gap) -> None:
        before, after = gap.before, gap.after
        if gap.cut or before is None or after is None or _broken(camera, before, after):
            self._count_as_tagged(camera, gap)
            return
        step = id_step(before.frame_id, after.frame_id)
        if step <= 0:
            why = f"its frame number is {after.frame_id}, that of pulse {before.pulse} is {before.frame_id}, and its "
            why += "clock goes on"
            self._differs(Difference(after.pulse, camera.name, FrameStatus.OK, None, why))
            self._count_as_tagged(camera, gap)
            return
        pulses = after.pulse - before.pulse - 1
        taken, untagged = step - 1, pulses - len(gap.tagged)
        if taken > pulses:
            why = f"its frame numbers tell of {taken - pulses} frames until pulse {after.pulse} that have no pulse"
            self._differs(Difference(before.pulse, camera.name, FrameStatus.OK, None, why))
            taken = pulses
        seen = None
        if before.triggers is not None and after.triggers is not None:
            seen = after.triggers - before.triggers - 1
            if seen > pulses:
                why = f"it counted {seen - pulses} triggers until pulse {after.pulse} that have no pulse"
                self._differs(Difference(before.pulse, camera.name, FrameStatus.OK, None, why))
        for pulse, tagged, found in recomputed(gap.tagged, taken, untagged):
            camera.states[found] += 1
            if found is not tagged:
                why = f"its frame numbers say that it took {taken} of the {pulses} frames between pulses "
                why += f"{before.pulse} and {after.pulse}"
                self._differs(Difference(pulse, camera.name, tagged, found, why))

    def _count_as_tagged(self, camera: _Camera, gap: _Gap) -> None:
        """Count the pulses of a gap as they are tagged: there is no evidence."""
        self._unproven += len(gap.tagged)
        camera.states.update(status for _, status in gap.tagged)

    def _is_elsewhere(self, camera: _Camera, pulse: PulseNumber, why: str, by: int) -> None:
        """Note a frame that belongs to another pulse by its clock; consecutive ones are one stretch."""
        earlier = camera.elsewhere
        if earlier is not None and earlier.by == by:
            camera.elsewhere = replace(earlier, last=pulse)
            return
        self._end_elsewhere(camera)
        camera.elsewhere = Difference(pulse, camera.name, FrameStatus.OK, None, why, pulse, by)

    def _end_elsewhere(self, camera: _Camera) -> None:
        if camera.elsewhere is not None:
            self._differs(camera.elsewhere)
            camera.elsewhere = None

    def _differs(self, difference: Difference) -> None:
        self._disagreements += 1
        if len(self._differences) < _KEPT:
            self._differences.append(difference)


def _slept_through(camera: _Camera, last: TaggedFrame, frame: TaggedFrame, off: float) -> int:
    """How many frames the camera took while the clock stood still that times pulses and arrivals; 0: it went on.

    That clock stops while the computer is suspended; then pulses and arrivals agree, and the camera's clock went on.
    """
    frames = id_step(last.frame_id, frame.frame_id) - (frame.pulse - last.pulse)
    by_arrival = (frame.host - last.host) - (frame.time - last.time)
    return frames if frames > 0 and off > 2 * camera.scatter and abs(by_arrival) < off / 2 else 0


def _broken(camera: _Camera, before: TaggedFrame, after: TaggedFrame) -> bool:
    """Whether the camera came, went or fell silent between two frames."""
    place = bisect_left(camera.breaks, before.time)
    return place < len(camera.breaks) and camera.breaks[place] <= after.host


def _with_moves(camera: _Camera) -> Iterator[tuple[_Gap, bool]]:
    """The gaps of a camera, and whether a stretch of frames of other pulses begins or ends in each."""
    for gap in camera.gaps:
        if gap.run is not None and gap.before is not None and gap.after is not None:
            gap.run.anew |= gap.run.first == gap.after.pulse and _broken(camera, gap.before, gap.after)
    shifted = shifts(camera.runs)
    earlier = [0, *shifted]
    moves = {run.first: after != before for run, after, before in zip(camera.runs, shifted, earlier, strict=False)}
    for gap in camera.gaps:
        yield gap, gap.after is not None and moves.get(gap.after.pulse, False)
