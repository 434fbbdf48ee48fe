"""The rate of a few pulses, how far it can be wrong, and which rates contradict the rig file's."""

import random

import pytest

from rig.clocks import HostNs
from triggering.timeline.steady_rate import SteadyRate, steady_rate

S = 1_000_000_000


def test_the_true_rate_is_within_the_error_whatever_the_jitter() -> None:
    chance, measured = random.Random(4), 0
    for _ in range(2000):
        hz, jitter, count = chance.uniform(5, 200), chance.uniform(0, 0.05), chance.randrange(3, 17)
        times = [HostNs(round((k + chance.uniform(-jitter, jitter)) * S / hz)) for k in range(count)]
        if (rate := steady_rate(times)) is not None:
            measured += 1
            assert abs(rate.hz / hz - 1) <= rate.error
    assert measured > 1000


def test_only_the_last_pulses_that_come_evenly_count() -> None:
    times = [HostNs(round(k * S / 30)) for k in (0, 5, 6, 8, 9, 10, 11)]
    rate = steady_rate(times)
    assert rate is not None
    assert (round(rate.hz, 3), round(rate.error, 6)) == (30.0, 0.033333)
    assert steady_rate(times[:4]) is None
    assert steady_rate(times[:1]) is None


@pytest.mark.parametrize(
    ("hz", "wrong"),
    [
        (30.0, False), (30.5, False), (30.7, None), (30.9, None), (31.1, True), (29.3, None), (28.9, True),
        (101.0, True), (70.0, True), (36.0, True), (20.0, True), (13.0, True), (3.0, False),
        (15.0, False), (10.0, False), (7.5, False), (14.6, None),
    ],
)  # fmt: skip
def test_rates_that_contradict_30_hz(hz: float, wrong: bool | None) -> None:
    """Beyond 2 %, surely or perhaps; but cameras may take every second pulse only, or fewer."""
    assert SteadyRate(hz, 0.0125).contradicts(30.0, 0.02) is wrong
