"""How well this computer knows UTC: what the kernel says of its clock, and which program keeps it right.

Pulses are paired by a clock that never jumps, so this decides nothing. It says how far the times in a log may be off
from those of others: a timing system, a camera of the television, a second computer.
"""

import ctypes
import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.clocks import NS_PER_S, UtcAnchor

#: Readings of the two clocks differ by far less, even on a busy computer.
_SET_NS: Final = NS_PER_S // 100
_UNSYNCHRONIZED: Final = 0x0040  # STA_UNSYNC, sys/timex.h
_NANO: Final = 0x2000  # STA_NANO: the offset is in ns, not us
#: Programs that set a computer's clock, by the name that the kernel has for their process (15 characters).
_KEEPERS: Final = {
    "chronyd": "chrony",
    "ntpd": "ntpd",
    "phc2sys": "PTP (phc2sys)",
    "systemd-timesyn": "systemd-timesyncd",
    "timemaster": "PTP (timemaster)",
}
#: Where those leave their traces while they run; a service that must not see other processes sees these.
_TRACES: Final = {"/run/chrony": "chrony", "/run/systemd/timesync": "systemd-timesyncd"}


class _Timex(ctypes.Structure):
    """The first fields of `struct timex` (adjtimex(2)); `rest` is room for the other fields."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 256),
    )


@dataclass(frozen=True, slots=True)
class UtcState:
    """The computer's clock at one moment.

    Attributes:
        synchronized: whether some program keeps it right (NTP, PTP), as the kernel judges.
        keeper: that program; empty if it is not known.
        offset_us: what the kernel is still correcting, us.
        estimated_us: the program's estimate of the error, us.
        at_most_us: largest possible error, us; grows while no server is heard.
    """

    synchronized: bool
    keeper: str
    offset_us: float
    estimated_us: float
    at_most_us: float

    def to_fields(self) -> dict[str, str]:
        """The state as fields of a metadata record."""
        return {
            "utc": "synchronized" if self.synchronized else "free",
            "utc_by": self.keeper,
            "utc_offset_us": f"{self.offset_us:.3f}",
            "utc_estimated_us": f"{self.estimated_us:.3f}",
            "utc_at_most_us": f"{self.at_most_us:.3f}",
        }

    @classmethod
    def from_fields(cls, fields: Mapping[str, str]) -> "UtcState | None":
        """Read what `to_fields` made; None if the fields say nothing of UTC, or nothing that makes sense."""
        state = fields.get("utc", "")
        try:
            figures = [float(fields.get(f"utc_{name}_us", "")) for name in ("offset", "estimated", "at_most")]
        except ValueError:
            return None
        if state not in {"synchronized", "free"} or not all(map(math.isfinite, figures)):
            return None
        return cls(state == "synchronized", fields.get("utc_by", ""), *figures)

    def in_words(self) -> str:
        """The state in one line."""
        if not self.synchronized:
            runs = f" ({self.keeper} runs)" if self.keeper else ""
            return f"not synchronized{runs}: date and time are what this computer believed in"
        keeper = f" by {self.keeper}" if self.keeper else ""
        estimated, most, correcting = map(_time, (self.estimated_us, self.at_most_us, self.offset_us))
        return f"synchronized{keeper}, off by {estimated} (estimated), {most} at most; {correcting} being corrected"


class SetClock:
    """Notices that the computer's clock is set; a program that only lets it go faster or slower moves no time.

    Args:
        take: reads how far UTC is ahead of a clock that never jumps.
        least_ns: smaller moves are none, ns.
    """

    def __init__(self, take: Callable[[], UtcAnchor] = UtcAnchor.take, least_ns: int = _SET_NS) -> None:
        self._take, self._known, self._least_ns = take, take(), least_ns

    def moved_s(self) -> float:
        """By how many seconds it was set since the last call; 0: it was not."""
        before, self._known = self._known, self._take()
        moved = self._known.offset_ns - before.offset_ns
        return moved / NS_PER_S if abs(moved) >= self._least_ns else 0.0


def utc_fields() -> dict[str, str]:
    """The present state as fields of a metadata record, also where the kernel does not tell."""
    try:
        return utc_state().to_fields()
    except OSError as error:  # a container or a unit may forbid to ask
        return {"utc": "unknown", "utc_why": error.strerror or str(error)}


def is_synchronized() -> bool:
    """Whether some program keeps the clock right; where the kernel does not tell, nobody knows of one."""
    try:
        return utc_state().synchronized
    except OSError:  # a container or a unit may forbid to ask
        return False


def utc_state() -> UtcState:
    """Ask the kernel.

    Raises:
        OSError: it does not tell.
    """
    clock = _Timex()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.adjtimex(ctypes.byref(clock)) < 0:
        raise OSError(ctypes.get_errno(), f"adjtimex: {os.strerror(ctypes.get_errno())}")
    offset_us = clock.offset / 1000 if clock.status & _NANO else float(clock.offset)
    synchronized = not clock.status & _UNSYNCHRONIZED
    return UtcState(synchronized, _keeper(), offset_us, float(clock.esterror), float(clock.maxerror))


def _keeper() -> str:
    """The programs that run here and set clocks."""
    found = {keeper for place, keeper in _TRACES.items() if Path(place).exists()}
    for name in Path("/proc").glob("[0-9]*/comm"):
        try:
            keeper = _KEEPERS.get(name.read_text(errors="replace").strip())
        except OSError:  # the process has ended
            continue
        if keeper is not None:
            found.add(keeper)
    return ", ".join(sorted(found))


def _time(us: float) -> str:
    return f"{us / 1e6:.1f} s" if abs(us) >= 1e6 else f"{us / 1000:.1f} ms" if abs(us) >= 1000 else f"{us:.0f} us"
