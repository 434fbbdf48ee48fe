"""Cycle time of a FireWire bus: the clock that all its devices share, and that wraps every 128 seconds.

One word: 7 bits of seconds, 13 bits of cycles (8000 per second), 12 bits of ticks (3072 per cycle, 24.576 MHz).
"""

from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S

CYCLE_NS: Final = 125_000
WRAP_NS: Final = 128 * NS_PER_S
_CYCLES, _TICKS = 8000, 3072


@dataclass(frozen=True, slots=True)
class CycleTime:
    """A reading.

    Attributes:
        seconds: 0 to 127.
        cycles: 0 to 7999.
        ticks: 0 to 3071.
    """

    seconds: int
    cycles: int
    ticks: int

    @classmethod
    def from_word(cls, word: int) -> "CycleTime":
        """Take the register or the image's first word apart."""
        return cls(word >> 25, word >> 12 & 0x1FFF, word & 0xFFF)

    @property
    def valid(self) -> bool:
        """Whether a clock can show this."""
        return self.cycles < _CYCLES and self.ticks < _TICKS

    @property
    def ns(self) -> int:
        """Nanoseconds since the last wrap, rounded."""
        ticks = (self.seconds * _CYCLES + self.cycles) * _TICKS + self.ticks
        return (ticks * 15625 + 192) // 384  # 1e9 / 24.576e6 = 15625 / 384


def unwrap(wrapped_ns: int, near_ns: int) -> int:
    """The time that shows as `wrapped_ns` and is nearest to `near_ns`.

    Args:
        wrapped_ns: reading of the clock, 0 to `WRAP_NS`.
        near_ns: what it should be about, within 64 s.
    """
    half = WRAP_NS // 2
    return near_ns + (wrapped_ns - near_ns + half) % WRAP_NS - half
