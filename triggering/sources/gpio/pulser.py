"""Makes pulses at even times of the host's clock, and never in a burst to catch up.

A pulse that would come late is left out and counted. So two pulses are never nearer to each other than the period less
the lateness that is allowed, whatever the computer does: cameras that can take the rate miss none.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S, NS_PER_US, HostNs
from rig.health import PulsesMade
from triggering.sources.gate import Gate
from triggering.sources.gpio.timer import Waiting

#: A pulse begins so late at most, as a share of the period, or it is left out. The alarm for pulses that have no even
#: distances any more begins there, too.
LATEST: Final = 0.05
#: The lateness is told of so many pulses.
_REMEMBERED: Final = 1000
_PERCENT: Final = 99


@dataclass(frozen=True, slots=True)
class Fired:
    """A pulse that was made.

    Attributes:
        number: counts the pulses that were made, from 1.
        time: of its edge.
        uncertainty_ns: largest error of the time: half of the time that setting the line took.
    """

    number: int
    time: HostNs
    uncertainty_ns: int


class Pulser:
    """The pulses of one line.

    Args:
        set_line: sets the line, to active or inactive.
        waiting: clock to count on.
        origin: time of a pulse.
        rate_hz: pulses per second.
        width_ns: length of a pulse, at most half of the period.
        gate: lets pulses through.
        is_open: whether a gate outside lets pulses through now; asked when one is due. None: there is none.

    One thread makes the pulses, another may ask for `figures` and `fetch` them.
    """

    def __init__(
        self,
        set_line: Callable[[bool], None],
        waiting: Waiting,
        origin: HostNs,
        rate_hz: float,
        width_ns: int,
        gate: Gate,
        is_open: Callable[[], bool] | None = None,
    ) -> None:
        self._set_line, self._waiting, self._gate, self._is_open = set_line, waiting, gate, is_open
        self._opened: bool | None = None
        self._origin, self._rate_hz, self._width_ns = origin, rate_hz, width_ns
        self._latest_ns = round(LATEST * NS_PER_S / rate_hz)
        self._nearest_ns = round((1 - LATEST) * NS_PER_S / rate_hz)
        self._free_from: HostNs | None = None
        self._late_ns: deque[int] = deque(maxlen=_REMEMBERED)
        self._made = self._skipped = self._latest_made_ns = 0
        self._making: HostNs | None = None  # the time for which a pulse is due that is being made
        self._fired: deque[Fired] = deque(maxlen=_REMEMBERED)

    def run(self) -> None:
        """Make pulses until the waiting is ended; the line is inactive then.

        Raises:
            TriggerError: the line cannot be set any more, or the gate cannot be asked.
        """
        pulse = self._first_after(self._waiting.now())
        while self._waiting.wait(self._due(pulse), precisely=True):
            if self._is_open is not None:
                self._opened = self._is_open()
            now = self._waiting.now()
            if self._opened is False:
                pass  # a pulse that is not wanted is not late either
            elif now > self._due(pulse) + self._latest_ns or (self._free_from is not None and now < self._free_from):
                self._skipped += not self._gate.still
            elif self._gate.passes() and not self._pulse(self._due(pulse)):
                return
            pulse += 1

    def figures(self, *, realtime: bool) -> PulsesMade:
        """What has been made, and how late.

        Args:
            realtime: whether the thread has a real-time priority.
        """
        late = sorted(self._late_ns.copy())
        return PulsesMade(
            made=self._made,
            skipped=self._skipped,
            late_median_us=_us(late[len(late) // 2]) if late else None,
            late_p99_us=_us(late[len(late) * _PERCENT // 100]) if late else None,
            late_max_us=_us(self._latest_made_ns) if late else None,
            realtime=realtime,
            gate_open=self._opened,
        )

    def fetch(self) -> tuple[list[Fired], HostNs]:
        """Pulses that have been made and not been fetched, and a time: all pulses up to then have been fetched.

        Their numbers follow each other; after a gap they are left to the next call.
        """
        until, making = self._waiting.now(), self._making  # in this order: a pulse that begins later is after `until`
        fired: list[Fired] = []
        while self._fired and (not fired or self._fired[0].number == fired[-1].number + 1):
            fired.append(self._fired.popleft())
        return fired, until if making is None else min(until, making)

    def _due(self, pulse: int) -> HostNs:
        return HostNs(self._origin + round(pulse * NS_PER_S / self._rate_hz))

    def _first_after(self, now: HostNs) -> int:
        return int((now - self._origin) * self._rate_hz // NS_PER_S) + 1

    def _pulse(self, due: HostNs) -> bool:
        """Make one; whether to go on."""
        self._making = due
        before = self._waiting.now()
        self._set_line(True)
        try:
            after = self._waiting.now()
            time = HostNs((before + after) // 2)
            self._made += 1
            self._fired.append(Fired(self._made, time, (after - before + 1) // 2))
            self._making = None
            goes_on = self._waiting.wait(HostNs(before + self._width_ns), precisely=False)
        finally:
            self._set_line(False)
        # A camera needs the line inactive for as long as active, or it sees no edge.
        self._free_from = HostNs(max(after + self._nearest_ns, self._waiting.now() + self._width_ns))
        self._late_ns.append(time - due)
        self._latest_made_ns = max(self._latest_made_ns, time - due)
        return goes_on


def _us(ns: int) -> float:
    return round(ns / NS_PER_US, 1)
