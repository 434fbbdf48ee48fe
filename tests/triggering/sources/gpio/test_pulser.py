"""When the pulses of a line come, on a clock of the test's own that stalls as a busy computer does."""

import random
from collections.abc import Callable
from itertools import pairwise

import pytest

from rig.clocks import HostNs
from triggering.sources.gate import Gate
from triggering.sources.gpio.pulser import LATEST, Pulser

US = 1_000
ORIGIN = HostNs(7_000_000_000)


class _Computer:
    """A clock that stands still except while it is waited on and while the line is set.

    Args:
        late_ns: how late a wait ends.
        slow_ns: how long setting the line takes.
        end: no wait goes beyond.
    """

    def __init__(self, late_ns: Callable[[], int], slow_ns: Callable[[], int], end: HostNs) -> None:
        self._late_ns, self._slow_ns, self._end = late_ns, slow_ns, end
        self.time = ORIGIN
        self.edges: list[tuple[HostNs, bool]] = []

    def now(self) -> HostNs:
        return self.time

    def wait(self, until: HostNs, *, precisely: bool) -> bool:
        del precisely
        if self.time < self._end:
            self.time = HostNs(max(until, self.time) + self._late_ns())
        return self.time < self._end

    def set_line(self, active: bool) -> None:
        slow = self._slow_ns()
        self.time = HostNs(self.time + slow // 2)
        self.edges.append((self.time, active))
        self.time = HostNs(self.time + slow - slow // 2)

    @property
    def rises(self) -> list[HostNs]:
        return [time for time, active in self.edges if active]


def _run(
    computer: _Computer,
    rate_hz: float,
    width_us: int = 1000,
    gate: Gate | None = None,
    is_open: Callable[[], bool] | None = None,
) -> Pulser:
    pulser = Pulser(computer.set_line, computer, ORIGIN, rate_hz, width_us * US, gate or Gate(), is_open)
    pulser.run()
    return pulser


def test_what_the_gate_lets_through_is_at_the_times_of_the_train() -> None:
    gate, sets = Gate(still=True), 0

    def opens() -> int:
        nonlocal sets
        sets += 1
        if sets == 10:
            gate.let(3)
        if sets == 100:
            gate.let(None)
        return 0

    computer = _Computer(opens, lambda: 0, HostNs(ORIGIN + 20_000_000 * US))
    pulser = _run(computer, 10.0, gate=gate)
    pulses = [(time - ORIGIN) / 1e8 for time in computer.rises]
    first, after = pulses[0], pulses[3]
    assert first >= 10 - 1
    assert pulses[:3] == [first, first + 1, first + 2]
    assert after > first + 3
    assert pulses[3:] == [after + number for number in range(len(pulses) - 3)]
    assert pulser.figures(realtime=False).skipped == 0


def test_a_gate_outside_lets_pulses_through_at_the_times_of_the_train_and_what_it_holds_back_is_not_late() -> None:
    """The gate is open from 1.05 s to 2.05 s; one second before, and one while it is open, the computer stalls."""
    stalls = {5: 300_000_000, 15: 300_000_000}
    waits = iter(range(10_000))
    computer = _Computer(lambda: stalls.get(next(waits), 0), lambda: 0, HostNs(ORIGIN + 4_000_000 * US))
    pulser = _run(computer, 10.0, is_open=lambda: 1.05e9 < computer.time - ORIGIN < 2.05e9)
    pulses = [(time - ORIGIN) / 1e8 for time in computer.rises]
    assert pulses == [number for number in range(11, 21) if number in pulses]
    made = pulser.figures(realtime=True)
    assert (made.made, made.skipped, made.gate_open) == (len(pulses), 10 - len(pulses), False)
    assert made.skipped > 0


def test_pulses_on_request_wait_for_the_gate_outside() -> None:
    gate = Gate(still=True)
    gate.let(3)
    computer = _Computer(lambda: 0, lambda: 0, HostNs(ORIGIN + 3_000_000 * US))
    _run(computer, 10.0, gate=gate, is_open=lambda: computer.time - ORIGIN > 1.05e9)
    assert [(time - ORIGIN) / 1e8 for time in computer.rises] == [11, 12, 13]


@pytest.mark.parametrize("rate_hz", [0.1, 29.97, 30.0, 200.0])
def test_pulses_of_an_idle_computer_are_at_even_times_for_ever(rate_hz: float) -> None:
    computer = _Computer(lambda: 0, lambda: 0, HostNs(ORIGIN + round(1000e9 / rate_hz) + 2_000_000))
    pulser = _run(computer, rate_hz)
    assert computer.rises == [ORIGIN + round(pulse * 1e9 / rate_hz) for pulse in range(1, 1001)]
    assert {fall - rise for (rise, _), (fall, _) in zip(computer.edges[::2], computer.edges[1::2], strict=True)} == {
        1000 * US
    }
    made = pulser.figures(realtime=True)
    assert (made.made, made.skipped, made.late_max_us) == (1000, 0, 0.0)


def test_after_a_stall_the_train_goes_on_at_its_even_times_without_a_burst() -> None:
    waits = iter([0] * 20 + [1_000_000_000] + [0] * 10_000)
    computer = _Computer(lambda: next(waits), lambda: 0, HostNs(ORIGIN + 3_000_000_000))
    made = _run(computer, 30.0).figures(realtime=False)
    pulses = [round((time - ORIGIN) * 30 / 1e9) for time in computer.rises]
    # The eleventh wait for a pulse was late by a second, until the 41st is due.
    assert pulses == [*range(1, 11), *range(41, 90)]
    assert made.skipped == 30
    assert all(time == ORIGIN + round(n * 1e9 / 30) for time, n in zip(computer.rises, pulses, strict=True))


@pytest.mark.parametrize("seed", range(5))
def test_however_the_computer_stalls_pulses_keep_their_distance_and_are_counted(seed: int) -> None:
    chance, period_ns, width_ns = random.Random(seed), 1e9 / 60, 1000 * US

    def late() -> int:
        return round(chance.expovariate(1 / (30 * US)) + (chance.random() < 0.05) * chance.expovariate(1 / period_ns))

    computer = _Computer(late, lambda: late() // 4, HostNs(ORIGIN + 60_000_000_000))
    pulser = _run(computer, 60.0)
    rises, made = computer.rises, pulser.figures(realtime=True)
    distances = [after - before for before, after in pairwise(rises)]
    assert min(distances) >= (1 - LATEST) * period_ns - 1
    falls = [time for time, active in computer.edges if not active]
    assert min(rise - fall for fall, rise in zip(falls, rises[1:], strict=False)) >= width_ns
    assert not computer.edges[-1][1]
    assert made.made == len(rises)
    assert abs(made.made + made.skipped - 3600) <= 1
    assert 0.02 < made.skipped / 3600 < 0.2
    fired, until = pulser.fetch()
    assert until == computer.time
    assert [each.number for each in fired] == list(range(made.made - len(fired) + 1, made.made + 1))
    assert all(abs(e.time - t) <= e.uncertainty_ns for e, t in zip(fired, rises[-len(fired) :], strict=True))


def test_no_time_is_said_to_be_told_before_its_pulse_is() -> None:
    """Whenever another thread asks: between two pulses, while the line is being set, while it is active."""
    told: list[tuple[list[int], HostNs]] = []

    class Asked(_Computer):
        def set_line(self, active: bool) -> None:
            self.ask()
            super().set_line(active)
            self.ask()

        def ask(self) -> None:
            fired, until = pulser.fetch()
            told.append(([pulse.time for pulse in fired], until))

    computer = Asked(lambda: 300 * US, lambda: 200 * US, HostNs(ORIGIN + 1_000_000_000))
    pulser = Pulser(computer.set_line, computer, ORIGIN, 30.0, 1000 * US, Gate())
    pulser.run()
    computer.ask()
    untold = HostNs(0)
    for times, until in told:
        assert all(time > untold for time in times)
        untold = until
    assert [time for times, _ in told for time in times] == computer.rises


def test_a_line_that_was_active_when_the_train_was_ended_is_inactive() -> None:
    computer = _Computer(lambda: 0, lambda: 0, HostNs(ORIGIN + 100_500_000))
    _run(computer, 10.0)
    assert computer.edges == [(ORIGIN + 100_000_000, True), (ORIGIN + 101_000_000, False)]


def test_an_error_in_a_pulse_leaves_the_line_inactive() -> None:
    computer = _Computer(lambda: 0, lambda: 0, HostNs(ORIGIN + 100_500_000))

    def fail() -> int:
        if computer.edges:
            raise RuntimeError("unforeseen")
        return 0

    computer._late_ns = fail
    with pytest.raises(RuntimeError, match="unforeseen"):
        _run(computer, 10.0)
    assert [active for _, active in computer.edges] == [True, False]


def test_the_lateness_is_told_by_median_99_percent_and_the_latest() -> None:
    late = iter([n * US for n in range(1, 201) for _ in (0, 1)])
    computer = _Computer(lambda: next(late, 0), lambda: 0, HostNs(ORIGIN + 6_680_000_000))
    made = _run(computer, 30.0).figures(realtime=True)
    assert (made.late_median_us, made.late_p99_us, made.late_max_us) == (101.0, 199.0, 200.0)
