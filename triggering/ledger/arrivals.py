"""By how many whole periods the frames of a camera come later than usual, while those of the other cameras do not.

A camera that misses a pulse just when the times of its frames slip by a period contradicts neither its frame numbers
nor its clock; only the arrivals of its frames show it. They prove nothing where they scatter widely, where the pulses
have no rhythm, and where the frames of all cameras come later at once: then the computer or its network stood still.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

#: A change of the arrivals lasts if so many frames in a row show it.
FRAMES: Final = 8
#: So many frames tell how late a camera's frames come, and how much that scatters.
_LEARNED: Final = 32
#: Pulses have a rhythm if the times between neighbours differ by less than this factor.
RHYTHM: Final = 1.5
#: A frame whose lateness differs by more than this part of a period from whole periods tells no level.
_BESIDE: Final = 0.25
#: Arrivals tell one pulse from the next if their mean deviation from whole periods is less than this part of a period.
#: If frames come at any time it is 0.25, which the mean over the last ones stays above by five standard deviations.
_SHARP: Final = 0.18
#: Frames of a pulse that are compared, at least.
WITNESSES: Final = 2
#: Share of a frame in the usual latency and its deviation.
_SHARE: Final = 1 / 64


class Change(Enum):
    """What begins with a frame."""

    LEVEL = "level"  #: frames that come by another number of periods later than usual
    LATENCY = "latency"  #: another latency, which differs by something else than whole periods, and is learned anew


@dataclass(slots=True)
class Arrivals:
    """The latencies of one camera: the times from a pulse to the arrival of its frame.

    Attributes:
        level: by how many periods later than usual its last frames came; negative: sooner.
    """

    level: int = 0
    _usual: float = 0.0
    _spread: float = 0.0
    _frames: int = 0
    _odd: int = 0

    def excess(self, late: float) -> float | None:
        """How much later than usual a frame came, ns; None: nobody knows what is usual."""
        return late - self._usual if self.certain else None

    @property
    def known(self) -> bool:
        """Whether enough frames have come to know their usual latency."""
        return self._frames >= _LEARNED

    @property
    def certain(self) -> bool:
        """Whether the arrivals tell one pulse from the next."""
        return self.known and self._spread < _SHARP

    @property
    def clear(self) -> bool:
        """Whether the last frame came at the level."""
        return self.certain and not self._odd

    @property
    def shifted(self) -> bool:
        """Whether the last frames came as usual after other pulses."""
        return self.certain and self.level != 0

    def take(self, late: float, period: int) -> Change | None:
        """Enter a frame of pulses that have a rhythm.

        Args:
            late: time from the pulse to its arrival, ns.
            period: of the pulses, ns.

        Returns:
            What begins with this frame; None: it came as the last ones.
        """
        if not self.known:
            self._learn(late, period)
            return None
        periods = (late - self._usual) / period
        level = round(periods)
        beside = abs(periods - level)
        self._spread += _SHARE * (beside - self._spread)
        if beside > _BESIDE:
            self._odd += 1
            if self._odd < FRAMES or not self.certain:
                return None
            self.level = self._frames = self._odd = 0
            self._learn(late, period)
            return Change.LATENCY
        self._odd = 0
        self._usual += _SHARE * (late - level * period - self._usual)
        if level == self.level or not self.certain:
            return None
        self.level = level
        return Change.LEVEL

    def _learn(self, late: float, period: int) -> None:
        self._frames += 1
        self._usual += (late - self._usual) / self._frames
        self._spread += (abs(late - self._usual) / period - self._spread) / self._frames


@dataclass(slots=True)
class Delay:
    """By how much the frames of all cameras come later than they used to."""

    offset: float = 0.0
    _last: float = 0.0
    _pulses: int = 0

    def hides(self, excesses: Sequence[float], period: int) -> bool:
        """Whether the arrivals of a pulse prove nothing, because all of them are late, or all too soon.

        Args:
            excesses: of the frames of the pulse, beyond the offset, ns.
            period: to the nearest pulse, ns.
        """
        if len(excesses) < WITNESSES:
            return False
        common = max(min(excesses), 0.0) + min(max(excesses), 0.0)
        if abs(common) <= _BESIDE * period:
            self._pulses = 0
            return False
        alike = self._pulses > 0 and abs(common - self._last) <= _BESIDE * period
        self._last, self._pulses = common, self._pulses + 1 if alike else 1
        if self._pulses == FRAMES:  # it lasts
            self.offset += common
            self._pulses = 0
        return True
