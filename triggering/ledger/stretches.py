"""Finds stretches of pulses that hold the frames of other pulses, from frame numbers and arrivals.

Where the times of a camera's frames slip by whole periods, tags and times agree, and two kinds of evidence remain: the
frame numbers jump against the pulses where the slip begins or ends, and in between each frame comes by so many periods
later, or sooner, after its pulse than the frames before. Frame numbers alone do not tell how long the slip lasts: where
they fall short, the times may have come back, or the camera missed a pulse. If it missed one just when they slipped,
the numbers do not jump at all, and the arrivals alone tell it (`arrivals`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from rig.pulse import PulseNumber
from triggering.ledger.arrivals import FRAMES, RHYTHM

#: The soonest of n arrivals lies beyond half a period by chance with a probability of exp(-n p / 2 m), where m is their
#: mean excess over the soonest possible one and p the period, if they are exponential, and less often if they are
#: bounded. n p / m must be so large that this is below 1e-4.
_FRAMES_NEAR_LEAST: Final = 18.4


@dataclass(slots=True)
class Run:
    """Whole frames of a camera, one for each pulse.

    Attributes:
        first, last: pulses of its first and last frame.
        excess: by how much the numbers went on more than the pulses where it begins; 0 where they prove nothing.
        nearest, farther: the least times from one of its pulses to the nearer and the farther pulse beside it, ns.
        anew: the camera came, went or was silent before it, or its latency changed, so that nothing is known of an
            earlier slip.
        behind: the pulse before its first one has no frame of the camera.
        level: by how many periods later than usual its frames came; None: they scatter too much to tell.
        sure: pulse of the last frame that came at the level; there are `at_level` of these.
        frames: how many there are whose arrivals say something.
        soonest: least time from a pulse to the arrival of its frame, ns.
        late: sum of these times, ns.
    """

    first: PulseNumber
    last: PulseNumber
    excess: int
    nearest: int
    farther: int
    anew: bool = False
    behind: bool = False
    level: int | None = None
    sure: PulseNumber | None = None
    at_level: int = 0
    frames: int = 0
    soonest: float = 0
    late: float = 0

    def take(self, pulse: PulseNumber, late: float | None, nearest: int, farther: int) -> None:
        """Take the next frame; it arrived `late` ns after its pulse, None: its arrival is no evidence."""
        self.nearest, self.farther = min(self.nearest, nearest), min(self.farther, farther)
        self.last = pulse
        if late is not None:
            self.soonest = min(self.soonest, late) if self.frames else late
            self.frames, self.late = self.frames + 1, self.late + late

    def came_at(self, level: int) -> None:
        """Note that the last frame came by so many periods later than usual."""
        self.level, self.sure, self.at_level = level, self.last, self.at_level + 1

    def add(self, other: "Run") -> None:
        """Take the frames of another run."""
        self.soonest = min(self.soonest, other.soonest) if self.frames else other.soonest
        self.frames, self.late = self.frames + other.frames, self.late + other.late


@dataclass(frozen=True, slots=True)
class Stretch:
    """Pulses with frames of a camera that belong to other pulses.

    Attributes:
        first, last: its pulses.
        by: the frames are of so many pulses later; negative: earlier.
        later: by how much later, on average, they came after their pulses than the frames before, ns.
        jumps: the frame numbers jump where it begins.
    """

    first: PulseNumber
    last: PulseNumber
    by: int
    later: float
    jumps: bool


def shifts(runs: Sequence[Run]) -> list[int]:
    """By how many pulses the frames of each run are filed too early; the first one is taken to be right.

    Frames that come as they used to are right, whatever their numbers do. Where too few frames come to tell, a run is
    like those around it, and right if these differ.
    """
    found: list[int | None] = []
    usual = Run(PulseNumber(0), PulseNumber(0), 0, 0, 0)  # all frames that are right
    shift = low = high = base = 0
    for place, run in enumerate(runs):
        if run.anew:
            usual = Run(run.first, run.first, 0, 0, 0)
            shift = low = high = 0
            base = run.level or 0
        low, high = low + min(0, run.excess), high + max(0, run.excess)
        if run.level is not None:
            shift = run.level - base if _lasts(runs, place) else 0
            found.append(shift)
            low = high = 0
        else:
            # A camera may miss pulses where its times come back: the numbers only bound what arrivals tell.
            if (low == high and not shift) or usual.frames < FRAMES:
                own: int | None = 0
            else:
                own = shift_of(usual, run)
            found.append(own)
            if own is None:
                continue
            if low <= own - shift <= high or not own:
                shift = own
            found[-1], low, high = shift, 0, 0
        if not shift:
            usual.add(run)
    return [_between(found, place) for place in range(len(found))]


def _lasts(runs: Sequence[Run], place: int) -> bool:
    """Whether a run at another level holds frames of other pulses, and not a few frames that were late.

    Where the times of a few frames were off, the pulse of the last of them, or of the first, has no frame.
    """
    run = runs[place]
    if not run.level or run.at_level >= FRAMES:
        return True
    beside = [runs[at] for at in (place - 1, place + 1) if 0 <= at < len(runs)]
    hole = run.behind if run.level < 0 else place + 1 < len(runs) and runs[place + 1].behind
    return hole or any(each.level == run.level for each in beside)


def stretches(runs: Sequence[Run], shifted: Sequence[int]) -> list[Stretch]:
    """The stretches of runs that are shifted, as `shifts` says."""
    found: list[Stretch] = []
    usual = 0.0
    for place, (run, by) in enumerate(zip(runs, shifted, strict=True)):
        mean = run.late / run.frames if run.frames else usual + by * run.nearest
        if not by:
            usual = mean
        elif place and shifted[place - 1] == by:
            found[-1] = replace(found[-1], last=run.sure or run.last)
        else:
            found.append(Stretch(run.first, run.sure or run.last, by, mean - usual, run.excess != 0))
    return found


def shift_of(usual: Run, run: Run) -> int | None:
    """By how many periods later than usual the frames of a run came; None: too few to tell, or no rhythm.

    The soonest tells it, which a slow link does not change, and the mean, which one odd time does not change.
    """
    if run.farther >= RHYTHM * run.nearest:
        return None
    if not run.frames:
        return None
    mean_excess = max(each.late / each.frames - each.soonest for each in (usual, run))
    if min(usual.frames, run.frames) * run.nearest < _FRAMES_NEAR_LEAST * mean_excess:
        return None
    soonest = round((run.soonest - usual.soonest) / run.nearest)
    mean = round((run.late / run.frames - usual.late / usual.frames) / run.nearest)
    return min(soonest, mean, key=abs)


def _between(found: Sequence[int | None], place: int) -> int:
    """The shift of a run; where it is not known, the shift of its neighbours if they agree."""
    shift = found[place]
    if shift is not None:
        return shift
    before = next((each for each in reversed(found[:place]) if each is not None), 0)
    after = next((each for each in found[place:] if each is not None), 0)
    return before if before == after else 0
