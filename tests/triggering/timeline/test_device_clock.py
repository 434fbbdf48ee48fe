"""The estimated device clock against a true one that latches read with errors."""

import random

from hypothesis import given, settings
from hypothesis import strategies as st

from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs
from triggering.timeline.device_clock import DeviceClock

MS = 1_000_000
START = 5_000 * NS_PER_S


class TrueClock:
    """A device clock with offset and drift, and a link that delays readings by an unknown share of the round trip."""

    def __init__(self, *, offset: int = 0, ppm: float = 0.0, seed: int = 0) -> None:
        self.offset, self.rate, self.rng = offset, 1 + ppm * 1e-6, random.Random(seed)

    def device(self, host: float) -> DeviceNs:
        return DeviceNs(self.offset + round((host - START) * self.rate))

    def latch(self, host: int, round_trip_ns: int, error: float | None = None) -> ClockLatch:
        """A reading whose true time differs from the middle of the round trip by `error` times half the round trip."""
        share = self.rng.uniform(-1, 1) if error is None else error
        return ClockLatch(self.device(host + share * round_trip_ns / 2), HostNs(host), round_trip_ns)

    def burst(self, clock: DeviceClock, host: int, round_trips_ns: list[int]) -> None:
        for index, round_trip in enumerate(round_trips_ns):
            clock.latch(self.latch(host + index * MS // 4, round_trip))


def test_without_latch_nothing_is_known() -> None:
    clock = DeviceClock()
    assert not clock.known
    assert clock.uncertainty_ns > 1e18


def test_one_latch_is_enough_to_begin() -> None:
    true, clock = TrueClock(offset=3), DeviceClock()
    clock.latch(true.latch(START, 1000, error=0.0))
    assert clock.known
    assert clock.to_host(true.device(START + MS)) == START + MS
    assert clock.uncertainty_ns == 500
    assert clock.drift_ppm == 0


def test_shortest_round_trip_of_a_burst_decides() -> None:
    true, clock = TrueClock(offset=77 * NS_PER_S), DeviceClock()
    for index, round_trip in enumerate([10 * MS, 8 * MS, 100_000, 9 * MS]):
        clock.latch(true.latch(START + index * MS, round_trip, error=0.0 if round_trip == 100_000 else 1.0))
    assert abs(clock.to_host(true.device(START)) - START) < 2_000


def test_drift_is_learned_and_latches_under_load_do_not_disturb() -> None:
    true, clock = TrueClock(ppm=-87.0), DeviceClock()
    for second in range(0, 31, 2):
        loaded = second in (8, 10, 12, 14)
        true.burst(clock, START + second * NS_PER_S, [10 * MS] * 8 if loaded else [120_000] * 8)
    assert abs(clock.drift_ppm + 87.0) < 5.0
    later = START + 32 * NS_PER_S
    assert abs(clock.to_host(true.device(later)) - later) < 60_000


def test_drift_of_a_short_span_is_not_guessed_from_noise() -> None:
    true, clock = TrueClock(ppm=0.0), DeviceClock()
    clock.latch(true.latch(START, 4 * MS, error=1.0))
    clock.latch(true.latch(START + NS_PER_S, 4 * MS, error=-1.0))  # looks like 4000 ppm
    assert abs(clock.drift_ppm) < 100


def test_frames_refine_the_clock_but_cannot_walk_it_away() -> None:
    true, clock = TrueClock(), DeviceClock()
    true.burst(clock, START, [200_000] * 10)
    host = START + NS_PER_S // 100
    device = true.device(host)
    before = clock.to_host(device)
    clock.correct(device, 40_000)
    assert 1_000 < clock.to_host(device) - before < 10_000
    for _ in range(10_000):
        clock.correct(device, 10 * MS)
    assert clock.to_host(device) - before <= clock.uncertainty_at(device) + 1


def test_latches_overrule_the_frames() -> None:
    true, clock = TrueClock(), DeviceClock()
    true.burst(clock, START, [400_000] * 10)
    for _ in range(1000):
        clock.correct(true.device(START), MS)
    for second in range(1, 12):
        true.burst(clock, START + second * NS_PER_S, [10_000] * 4)
    end = START + 12 * NS_PER_S
    assert abs(clock.to_host(true.device(end)) - end) < 12_000


def test_a_better_fit_does_not_move_a_clock_that_the_frames_had_right() -> None:
    """Before the drift is known, the trim follows it; the latch that shows the drift must not add it again."""
    true, clock = TrueClock(ppm=100.0), DeviceClock()
    true.burst(clock, START, [40_000] * 8)
    for frame in range(400):
        host = START + 10 * MS + frame * 5 * MS
        clock.correct(true.device(host), host - clock.to_host(true.device(host)))
    host = START + 2010 * MS
    assert abs(clock.to_host(true.device(host)) - host) < 20_000
    clock.latch(true.latch(host, 40_000, error=0.0))
    assert clock.drift_ppm > 80
    assert abs(clock.to_host(true.device(host)) - host) < 40_000


def test_what_the_frames_said_fades() -> None:
    true, clock = TrueClock(), DeviceClock()
    clock.latch(true.latch(START, 400_000, error=0.0))
    for _ in range(100):
        clock.correct(true.device(START), MS)
    assert clock.to_host(true.device(START)) - START > 190_000
    for index in range(60):
        clock.latch(true.latch(START + index * NS_PER_S // 4, 400_000, error=0.0))
    end = START + 15 * NS_PER_S
    assert abs(clock.to_host(true.device(end)) - end) < 5_000


def test_a_misread_register_is_ignored() -> None:
    true, clock = TrueClock(), DeviceClock()
    true.burst(clock, START, [100_000] * 4)
    good = true.latch(START + NS_PER_S, 100_000)
    clock.latch(
        ClockLatch(DeviceNs(good.device + 2**32), good.host, good.round_trip_ns)
    )  # the high word was read too late
    assert abs(clock.to_host(good.device) - good.host) < 400_000
    clock.latch(ClockLatch(DeviceNs(good.device - 2**33), good.host, good.round_trip_ns))  # does not agree with it
    assert abs(clock.to_host(good.device) - good.host) < 400_000
    assert clock.steps == 0


def test_a_clock_that_was_set_anew_is_followed() -> None:
    true, clock = TrueClock(offset=10**15), DeviceClock()
    for second in range(5):
        true.burst(clock, START + second * NS_PER_S, [100_000] * 4)
    rebooted = TrueClock(offset=0, ppm=30)
    rebooted.burst(clock, START + 6 * NS_PER_S, [100_000] * 4)
    assert clock.steps == 1
    time = START + 6 * NS_PER_S
    assert abs(clock.to_host(rebooted.device(time)) - time) < 150_000


def test_state_does_not_grow() -> None:
    true, clock = TrueClock(ppm=20.0), DeviceClock()
    for second in range(2_000):
        clock.latch(true.latch(START + second * NS_PER_S, 100_000))
    assert len(clock._best) <= 16


@settings(max_examples=60)
@given(
    seed=st.integers(0, 2**32),
    ppm=st.floats(-100, 100),
    offset=st.one_of(st.just(0), st.integers(0, 10**19), st.integers(-(10**15), 0)),
    load=st.floats(0, 0.9),
    pushes=st.lists(st.integers(-5 * MS, 5 * MS), max_size=50),
)
def test_the_truth_is_within_the_uncertainty(
    seed: int, ppm: float, offset: int, load: float, pushes: list[int]
) -> None:
    """Under any load, and, with twice the uncertainty, whatever frames trim."""
    true, clock, rng = TrueClock(offset=offset, ppm=ppm, seed=seed), DeviceClock(), random.Random(seed)
    pushed = DeviceClock()
    for second in range(0, 24, 2):
        for index in range(8):
            round_trip = rng.randrange(MS, 10 * MS) if rng.random() < load else rng.randrange(20_000, 200_000)
            latch = true.latch(START + second * NS_PER_S + index * MS, round_trip)
            clock.latch(latch)
            pushed.latch(latch)
        for ahead in (0, 1, 2):
            host = START + (second + ahead) * NS_PER_S + 8 * MS
            device = true.device(host)
            for push in pushes:
                pushed.correct(device, push)
            assert abs(clock.to_host(device) - host) <= clock.uncertainty_at(device) + 1_000
            assert abs(pushed.to_host(device) - host) <= 2 * pushed.uncertainty_at(device) + 1_000
    assert clock.steps == 0
