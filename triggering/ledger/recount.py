"""Recomputes what became of every pulse in every camera from what a log holds of its frames, and compares the tags.

The pairing decided while frames were still coming. Afterwards everything is there, and for two whole frames of a camera
that follow each other, the log says by itself what must have become of the pulses between them: the frame numbers say
how many frames the camera took, its trigger count how many pulses it saw, its clock whether the second frame belongs to
the pulse that it is filed under. Of all that the pairing found out, only the tags are used, to be compared.

What cannot be proved is left to the tags and counted: pulses before the first and after the last frame of a camera, and
those at which it was gone or silent (the log's events tell) or its clock was set.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

from rig.clocks import NS_PER_S, UtcNs
from rig.events import Event
from rig.frame import FrameStatus
from rig.health import Health
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from rig.transport.recorder_reports import CameraNews
from triggering.ledger.recounted import Difference, Recounted
from triggering.ledger.source_recount import SourceRecount

#: News after which numbers and clock of a camera prove nothing about the frames before it.
_BREAKS: Final = frozenset(
    {CameraNews.CONNECTED.value, CameraNews.SILENT.value, CameraNews.GONE.value, FrameStatus.ABSENT.value}
)
#: 16-bit block ids run from 1 to this and skip 0.
_IDS_16_BIT: Final = 65535
#: The rate of a camera's clock is known from frames that are at least so far apart.
_BASE_NS: Final = NS_PER_S
#: No clock is wrong by more than this share; what looks like it is no clock.
_GAIN_MAX: Final = 0.01
#: Frame numbers and trigger counts have 64 bits.
_COUNT_MAX: Final = 1 << 64
#: Disagreements that are kept one by one; the counts go on.
_KEPT: Final = 10_000


@dataclass(frozen=True, slots=True)
class _Frame:
    """A whole frame as its tag describes it; times in ns."""

    pulse: PulseNumber
    time: UtcNs
    frame_id: int
    triggers: int | None
    device: int
    host: int


@dataclass(frozen=True, slots=True)
class _Gap:
    """What lies between two whole frames of a camera; one of them is missing at the ends of the log.

    Attributes:
        before, after: the frames.
        tagged: the pulses between them that have tags, with their states.
        cut: the clock or the numbers do not go on from one to the other.
    """

    before: _Frame | None
    after: _Frame | None
    tagged: tuple[tuple[PulseNumber, FrameStatus], ...]
    cut: bool


@dataclass(slots=True)
class _Camera:
    """What is known of a camera so far."""

    name: str
    states: Counter[FrameStatus] = field(default_factory=Counter)
    last: _Frame | None = None
    first: _Frame | None = None  #: since which the clock has been going on
    between: list[tuple[PulseNumber, FrameStatus]] = field(default_factory=list)
    gaps: list[_Gap] = field(default_factory=list)
    breaks: list[UtcNs] = field(default_factory=list)
    soonest: int | None = None  #: time from a pulse to the arrival of its frame, ns
    latest: int = 0

    def arrived(self, frame: _Frame) -> None:
        """Note how long after its pulse a frame came."""
        late = frame.host - frame.time
        self.soonest = late if self.soonest is None else min(self.soonest, late)
        self.latest = max(self.latest, late)

    @property
    def scatter(self) -> int:
        """By how much the arrivals of its frames vary, ns."""
        return 0 if self.soonest is None else self.latest - self.soonest

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

    def told(self, health: Health, written: UtcNs) -> None:
        """Take a health record, written at a time: it says what the source of the pulses told."""
        self._source.told(health, written)

    def finish(self, *, merged: bool = False) -> Recounted:
        """Judge everything; for use once, at the end of the log.

        Args:
            merged: the log is one of two computers, whose health records have two clocks.
        """
        if self._held is not None:
            self._take(self._held, None)
        for camera in self._cameras.values():
            camera.breaks.sort()
            if camera.between:
                camera.gaps.append(_Gap(camera.last, None, tuple(camera.between), cut=True))
            for gap in camera.gaps:
                self._judge(camera, gap)
        seen = {name: camera.states for name, camera in self._cameras.items() if camera.states}
        source = None if merged else self._source.finish()
        return Recounted(self._pulses, seen, self._unproven, tuple(self._differences), self._disagreements, source)

    def _camera(self, name: str) -> _Camera:
        return self._cameras.setdefault(name, _Camera(name))

    def _take(self, tag: TripletTag, later: TripletTag | None) -> None:
        """Take a tag whose neighbours are known."""
        self._pulses += 1
        times = [other.time for other in (self._earlier, later) if other is not None]
        nearest = min((abs(tag.time - time) for time in times), default=NS_PER_S)
        for part in tag.cameras:
            camera = self._camera(part.name)
            if part.status is not FrameStatus.OK:
                camera.between.append((tag.pulse, part.status))
            elif (frame := _frame(tag, part)) is not None:
                self._whole(camera, frame, nearest)
            else:  # a tag that names no number or time: nothing can be proved across it
                camera.states[FrameStatus.OK] += 1
                camera.gaps.append(_Gap(camera.last, None, tuple(camera.between), cut=True))
                camera.between.clear()
                camera.last = None

    def _whole(self, camera: _Camera, frame: _Frame, nearest: int) -> None:
        """Take a whole frame; `nearest` is the time from its pulse to the nearest other one, ns."""
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
            elif cut and _is_of_another_pulse(last, frame, by_clock, nearest, certain=not camera.between):
                why = f"clock and number say that it was triggered {abs(off) / 1e6:.1f} ms "
                why += "after this pulse" if off > 0 else "before this pulse"
                self._differs(Difference(frame.pulse, camera.name, FrameStatus.OK, None, why))
                return
        camera.arrived(frame)
        camera.states[FrameStatus.OK] += 1
        steps = 0 if last is None else frame.pulse - last.pulse
        if cut or camera.between or not _goes_on(last, frame, steps):
            camera.gaps.append(_Gap(last, frame, tuple(camera.between), cut))
            camera.between.clear()
        camera.last = frame
        if cut:
            camera.first = frame

    def _judge(self, camera: _Camera, gap: _Gap) -> None:
        before, after = gap.before, gap.after
        if gap.cut or before is None or after is None or _broken(camera, before, after):
            self._believe(camera, gap)
            return
        step = _id_step(before.frame_id, after.frame_id)
        if step <= 0:
            self._believe(camera, gap)
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
        for pulse, tagged, found in _recomputed(gap.tagged, taken, untagged):
            camera.states[found] += 1
            if found is not tagged:
                why = f"its frame numbers say that it took {taken} of the {pulses} frames between pulses "
                why += f"{before.pulse} and {after.pulse}"
                self._differs(Difference(pulse, camera.name, tagged, found, why))

    def _believe(self, camera: _Camera, gap: _Gap) -> None:
        """Count the pulses of a gap as they are tagged, for want of evidence."""
        self._unproven += len(gap.tagged)
        camera.states.update(status for _, status in gap.tagged)

    def _differs(self, difference: Difference) -> None:
        self._disagreements += 1
        if len(self._differences) < _KEPT:
            self._differences.append(difference)


def _frame(tag: TripletTag, part: CameraTag) -> _Frame | None:
    """The frame of a camera's part of a tag; None if that says too little of it."""
    if part.frame_id is None or part.device_time is None or part.host_time is None:
        return None
    if max(abs(part.frame_id), abs(part.trigger_count or 0)) > _COUNT_MAX:
        return None
    return _Frame(tag.pulse, tag.time, part.frame_id, part.trigger_count, part.device_time, part.host_time)


def _goes_on(last: _Frame | None, frame: _Frame, steps: int) -> bool:
    """Whether numbers and triggers of a frame go on from the last one as the pulses do."""
    if last is None or _id_step(last.frame_id, frame.frame_id) != steps:
        return False
    return last.triggers is None or frame.triggers is None or frame.triggers - last.triggers == steps


def _slept_through(camera: _Camera, last: _Frame, frame: _Frame, off: float) -> int:
    """How many frames the camera took while the clock stood still that times pulses and arrivals; 0: it went on.

    That clock stops while the computer is suspended; then pulses and arrivals agree, and the camera's clock went on.
    """
    frames = _id_step(last.frame_id, frame.frame_id) - (frame.pulse - last.pulse)
    by_arrival = (frame.host - last.host) - (frame.time - last.time)
    return frames if frames > 0 and off > 2 * camera.scatter and abs(by_arrival) < off / 2 else 0


def _is_of_another_pulse(last: _Frame, frame: _Frame, by_clock: float, nearest: int, *, certain: bool) -> bool:
    """Whether a frame is filed under a wrong pulse, where its clock says so and its number bears the clock out.

    Otherwise the clock was set: then it stands alone. A camera that missed a pulse while its clock was set back by just
    one period looks alike; there, the arrival decides. `certain`: no pulse between the two is said to be missing.
    """
    step = _id_step(last.frame_id, frame.frame_id)
    if abs(by_clock - step * nearest) >= nearest / 2:
        return False
    return certain or step > frame.pulse - last.pulse or abs(by_clock - (frame.host - last.host)) < nearest / 2


def _broken(camera: _Camera, before: _Frame, after: _Frame) -> bool:
    """Whether the camera came, went or fell silent between two frames."""
    place = bisect_left(camera.breaks, before.time)
    return place < len(camera.breaks) and camera.breaks[place] <= after.host


def _recomputed(
    tagged: tuple[tuple[PulseNumber, FrameStatus], ...], taken: int, untagged: int
) -> Iterator[tuple[PulseNumber, FrameStatus, FrameStatus]]:
    """Pulse, tagged and recomputed state in a gap in which the camera took `taken` frames.

    The numbers tell how many, not at which pulses; as many tags as possible are left as they are. `untagged` pulses of
    the gap have no tag: any of them may have had one of the frames.
    """
    is_taken = {FrameStatus.LOST, FrameStatus.DAMAGED}
    claimed = sum(status in is_taken for _, status in tagged)
    too_few, too_many = max(0, taken - untagged - claimed), max(0, claimed - taken)
    # Damage was seen to arrive; "lost" was concluded, and so it is revised first.
    spare = sum(status is FrameStatus.LOST for _, status in tagged)
    for pulse, status in tagged:
        found = status
        if status in is_taken and too_many > 0 and (status is FrameStatus.LOST or too_many > spare):
            found, too_many = FrameStatus.MISSED, too_many - 1
        elif status not in is_taken:
            found = FrameStatus.LOST if too_few > 0 else FrameStatus.MISSED
            too_few -= found is FrameStatus.LOST
        spare -= status is FrameStatus.LOST
        yield pulse, status, found


def _id_step(before: int, after: int) -> int:
    """Frames taken from one frame number to another; a log does not say whether numbers wrap, but they do at 65535."""
    step = after - before
    wraps = step < 0 and before <= _IDS_16_BIT and step < -_IDS_16_BIT // 2
    return step + _IDS_16_BIT if wraps else step
