"""The cycle timer, the clock that all nodes of a bus share: 24.576 MHz, in cycles of 3072 ticks or 125 us."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from rig.clocks import HostNs

CYCLE_NS: Final = 125_000
TICKS_PER_CYCLE: Final = 3072
CYCLES_PER_S: Final = 8000
_WRAP_S: Final = 128  # the register counts seconds in 7 bits
_STAMP_WRAP_S: Final = 8  # the stamp of a packet in 3


class CycleTimer:
    """The timer of the cycle master, which every other node follows.

    Args:
        master: what the cycle master's own clock shows at a host time, ns.
    """

    def __init__(self, master: Callable[[HostNs], int]) -> None:
        self._master = master

    def ticks(self, host: HostNs) -> int:
        """Ticks since the clock began; never wraps."""
        return self._master(host) * TICKS_PER_CYCLE // CYCLE_NS

    def register(self, host: HostNs) -> int:
        """CYCLE_TIME: seconds (7 bits), cycles (13 bits), ticks (12 bits)."""
        cycle, offset = divmod(self.ticks(host), TICKS_PER_CYCLE)
        second, cycle = divmod(cycle, CYCLES_PER_S)
        return second % _WRAP_S << 25 | cycle << 12 | offset

    def next_cycle(self, host: HostNs) -> tuple[int, HostNs]:
        """Number and begin of the first cycle that begins at `host` or later."""
        ticks = self.ticks(host)
        cycle = -(-ticks // TICKS_PER_CYCLE)
        return cycle, HostNs(host + (cycle * TICKS_PER_CYCLE - ticks) * CYCLE_NS // TICKS_PER_CYCLE)


def stamps(cycles: NDArray[np.int64]) -> NDArray[np.int64]:
    """The 16-bit stamps with which the host marks packets received in `cycles`."""
    stamped: NDArray[np.int64] = cycles // CYCLES_PER_S % _STAMP_WRAP_S << 13 | cycles % CYCLES_PER_S
    return stamped
