import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.pulse import HillPulse
from simrig.world.pulses import PulseTrain

RATES = st.floats(0.5, 1000.0)
EPOCHS = st.integers(0, 10**15).map(HostNs)
PAUSES = st.lists(
    st.tuples(st.integers(0, 500), st.integers(1, 40)).map(lambda p: (p[0], p[0] + p[1])), max_size=4
).map(tuple)


def fires(train: PulseTrain, n: int) -> bool:
    """Whether pulse `n` is fired: not negative and in no pause."""
    return n >= 0 and not any(first <= n < end for first, end in train.pauses)


def test_pulses_stand_at_whole_multiples_of_the_period() -> None:
    train = PulseTrain(HostNs(1_000), 30.0)
    assert [train.time(HillPulse(n)) for n in (0, 1, 2, 3)] == [1_000, 33_334_333, 66_667_667, 100_001_000]


@given(EPOCHS, RATES, PAUSES, st.integers(0, 10**6).map(HillPulse), st.floats(-0.24, 0.24))
def test_a_pulse_is_told_by_its_time(
    epoch: HostNs, rate: float, pauses: tuple[tuple[int, int], ...], pulse: HillPulse, off: float
) -> None:
    train = PulseTrain(epoch, rate, pauses)
    measured = HostNs(train.time(pulse) + round(off * 1e9 / rate))
    assert train.fired_at(measured) == (pulse if fires(train, pulse) else None)
    assert train.fired_at(HostNs(train.time(pulse) + round(0.4 * 1e9 / rate))) is None


def test_the_error_does_not_grow() -> None:
    assert PulseTrain(HostNs(0), 30.0).time(HillPulse(30 * 86_400)) == 86_400 * 10**9


@given(EPOCHS, RATES, PAUSES, st.integers(-(10**9), 10**12))
def test_next_index_is_the_first_later_pulse_that_fires(
    epoch: HostNs, rate: float, pauses: tuple[tuple[int, int], ...], since_epoch: int
) -> None:
    train = PulseTrain(epoch, rate, pauses)
    after = HostNs(epoch + since_epoch)
    n = train.next_index(after)
    assert train.time(HillPulse(n)) > after
    assert fires(train, n)
    earlier = n - 1
    while earlier >= 0 and not fires(train, earlier):
        earlier -= 1
    assert earlier < 0 or train.time(HillPulse(earlier)) <= after


@given(EPOCHS, RATES, st.integers(0, 10**5))
def test_the_pulse_itself_is_not_later_than_itself(epoch: HostNs, rate: float, n: int) -> None:
    train = PulseTrain(epoch, rate)
    assert train.next_index(train.time(HillPulse(n))) == n + 1
    assert train.next_index(HostNs(train.time(HillPulse(n)) - 1)) == n


def test_pauses_may_touch_and_come_in_any_order() -> None:
    train = PulseTrain(HostNs(0), 10.0, [(20, 30), (5, 20)])
    assert train.next_index(train.time(HillPulse(4))) == 30
    assert [fires(train, n) for n in (-1, 4, 5, 19, 20, 29, 30)] == [False, True, False, False, False, False, True]


@pytest.mark.parametrize("rate", [0.0, -1.0, math.nan, math.inf])
def test_a_rate_that_is_none_is_refused(rate: float) -> None:
    with pytest.raises(BadInputError, match="give a rate above 0"):
        PulseTrain(HostNs(0), rate)


@pytest.mark.parametrize("pause", [(5, 5), (6, 5), (-1, 5)])
def test_an_empty_pause_is_refused(pause: tuple[int, int]) -> None:
    with pytest.raises(BadInputError, match="later end"):
        PulseTrain(HostNs(0), 30.0, (pause,))
