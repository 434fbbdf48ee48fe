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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

from rig.clocks import NS_PER_S, UtcNs
from rig.events import Event
from rig.frame import FrameStatus
from rig.health import Health
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from rig.transport.recorder_reports import CameraNews
from triggering.ledger.arrivals import FRAMES, RHYTHM, WITNESSES, Arrivals, Change, Delay
from triggering.ledger.recounted import Difference, Recounted
from triggering.ledger.source_recount import SourceRecount
from triggering.ledger.stretches import Run, shift_of, shifts, stretches
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
class _Elsewhere:
    """The stretch of frames of other pulses, by their clock, that goes on.

    Attributes:
        difference: what is to be said of it.
        run: arrivals of its frames.
        frames: how many there are.
    """

    difference: Difference
    run: Run
    frames: int = 0


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
    heard: Run = field(default_factory=lambda: Run(PulseNumber(0), PulseNumber(0), 0, 0, 0))  #: all frames
    elsewhere: _Elsewhere | None = None
    breaks: list[UtcNs] = field(default_factory=list)
    arrivals: Arrivals = field(default_factory=Arrivals)
    soonest: int | None = None  #: time from a pulse to the arrival of its frame, ns
    latest: int = 0

    def arrived(self, frame: TaggedFrame) -> None:
        """Note how long after its pulse a frame came."""
        self.soonest = frame.late if self.soonest is None else min(self.soonest, frame.late)
        self.latest = max(self.latest, frame.late)

    @property
    def scatter(self) -> int:
        """By how much the arrivals of its frames vary, ns."""
        return 0 if self.soonest is None else self.latest - self.soonest

    def off(self, frame: TaggedFrame) -> float | None:
        """By how much its clock went on more than the pulses from its last frame to this one, ns; None: no last one."""
        if self.last is None:
            return None
        return (frame.device - self.last.device) / self.gain() - (frame.time - self.last.time)

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
        self._delay = Delay()

    def add(self, tag: TripletTag) -> None:
        """Take the next tag; a repeated or late one is left out."""
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
                shown = "its frame numbers jump against the pulses, and" if stretch.jumps else "unlike those of others,"
                why = f"{shown} its frames come {late} after them than before"
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
        frames = {part.name: frame_of(tag, part) for part in tag.cameras if part.status is FrameStatus.OK}
        heard = self._heard([(self._camera(name), frame) for name, frame in frames.items() if frame], apart)
        for part in tag.cameras:
            camera = self._camera(part.name)
            if part.status is not FrameStatus.OK:
                camera.between.append((tag.pulse, part.status))
            elif (frame := frames[part.name]) is not None:
                self._whole(camera, frame, apart, heard)
            else:  # a tag that names no number or time: nothing can be proved across it
                camera.states[FrameStatus.OK] += 1
                camera.gaps.append(_Gap(camera.last, None, tuple(camera.between), cut=True))
                camera.between.clear()
                camera.last = None

    def _heard(self, frames: Sequence[tuple[_Camera, TaggedFrame]], apart: Sequence[int]) -> tuple[bool, bool]:
        """Whether the arrivals of the frames of a pulse say something, and whether they bear witness to each other.

        Args:
            frames: with their cameras.
            apart: times to the pulses beside it, ns.
        """
        excesses = [camera.arrivals.excess(frame.late - self._delay.offset) for camera, frame in frames]
        known = [each for each in excesses if each is not None]
        rhythm = max(apart) < RHYTHM * min(apart)
        return rhythm and not self._delay.hides(known, min(apart)), len(known) >= WITNESSES

    def _whole(self, camera: _Camera, frame: TaggedFrame, apart: Sequence[int], heard: tuple[bool, bool]) -> None:
        """Take a whole frame.

        Args:
            camera: whose it is.
            frame: the frame.
            apart: times from its pulse to those beside it, ns.
            heard: its arrival says something, and those of other cameras bear witness.
        """
        late = frame.late - self._delay.offset if heard[0] else None
        tells = heard[1] or not camera.arrivals.known
        change = camera.arrivals.take(late, min(apart)) if late is not None and tells else None
        last, off = camera.last, camera.off(frame)
        cut = off is None or abs(off) >= min(apart) / 2
        if off is not None and cut and self._is_elsewhere(camera, frame, off, late if tells else None, apart):
            return
        self._end_elsewhere(camera, off if off is not None and not camera.arrivals.shifted else 0.0, min(apart))
        camera.arrived(frame)
        camera.states[FrameStatus.OK] += 1
        steps = 0 if last is None else frame.pulse - last.pulse
        excess = 0 if last is None or cut else id_step(last.frame_id, frame.frame_id) - steps
        if cut or excess or camera.between or change is not None:
            anew, behind = change is Change.LATENCY, bool(camera.between)
            camera.runs.append(Run(frame.pulse, frame.pulse, excess, min(apart), max(apart), anew, behind))
        for run in (camera.runs[-1], camera.heard):
            run.take(frame.pulse, late, min(apart), max(apart))
        if late is not None and heard[1] and camera.arrivals.clear:
            camera.runs[-1].came_at(camera.arrivals.level)
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

    def _is_elsewhere(
        self, camera: _Camera, frame: TaggedFrame, off: float, late: float | None, apart: Sequence[int]
    ) -> bool:
        """Whether a frame belongs to another pulse by its clock and number; consecutive ones are one stretch.

        It does not if it came as usual after its pulse: those before it are filed wrongly. Where arrivals scatter, it
        takes several frames to show that.

        Args:
            camera: whose it is.
            frame: the frame.
            off: by how much its clock went on more than the pulses, ns.
            late: time from the pulse to its arrival, ns; None: that says nothing.
            apart: times from the pulse to those beside it, ns.
        """
        last, nearest = camera.last, min(apart)
        if last is None:
            return False
        if frames := _slept_through(camera, last, frame, off):
            why = f"{frames} frames that its numbers tell of came while this computer's clock stood still"
            self._differs(Difference(last.pulse, camera.name, FrameStatus.OK, None, why))
            return False
        by_clock = off + (frame.time - last.time)
        if not is_of_another_pulse(last, frame, by_clock, nearest, certain=not camera.between):
            return False
        if late is not None and camera.arrivals.certain and not camera.arrivals.level:
            return False
        by = round(off / nearest)
        if camera.elsewhere is None or camera.elsewhere.difference.by != by:
            self._end_elsewhere(camera)
            why = f"clock and number say that it was triggered {abs(off) / 1e6:.1f} ms "
            why += "after this pulse" if off > 0 else "before this pulse"
            found = Difference(frame.pulse, camera.name, FrameStatus.OK, None, why, frame.pulse, by)
            camera.elsewhere = _Elsewhere(found, Run(frame.pulse, frame.pulse, 0, nearest, max(apart)))
        elsewhere = camera.elsewhere
        elsewhere.run.take(frame.pulse, late, nearest, max(apart))
        if camera.heard.frames >= FRAMES and shift_of(camera.heard, elsewhere.run) == 0:
            return False
        elsewhere.difference = replace(elsewhere.difference, last=frame.pulse)
        elsewhere.frames += 1
        return True

    def _end_elsewhere(self, camera: _Camera, off: float = 0.0, nearest: int = 1) -> None:
        """End the stretch of frames of other pulses.

        Args:
            camera: whose it is.
            off: by how much the clock of the next frame went on more, ns, if that frame is right: then the frames of a
                stretch that differs by as much are right too.
            nearest: time from its pulse to the nearest one, ns.
        """
        elsewhere, camera.elsewhere = camera.elsewhere, None
        if elsewhere is None:
            return
        if abs(off - elsewhere.difference.by * nearest) < nearest / 2:
            camera.states[FrameStatus.OK] += elsewhere.frames
        else:
            self._differs(elsewhere.difference)

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
