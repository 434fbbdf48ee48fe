"""Pulses from a hand or a light barrier come at any time: what became of one often shows only at the next."""

import random
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.clocks import NS_PER_S
from rig.frame import FrameStatus
from tests.triggering.feed import HOLD, PERIOD, START, Feed
from tests.triggering.oracle import LOST, MISSED, OK, check
from tests.triggering.simulation import MS, Hill, Run, Scenario

PULSES = 290


def pressed(seed: int, faults: dict[tuple[int, int], FrameStatus], slowest_s: float = 3.0) -> Run:
    """Pulses 0.3 s apart or more, though the rig file says 30 Hz."""
    rng = random.Random(seed)
    pauses = {pulse: rng.uniform(0.3, slowest_s) for pulse in range(PULSES)}
    return Run(Hill(Scenario(seed=seed, pulses=PULSES, pauses=pauses, faults=faults, hold_periods=6.1)))


@pytest.mark.parametrize("fate", [MISSED, LOST])
def test_each_cause_is_right_though_the_next_pulse_comes_long_after_the_deadline(fate: FrameStatus) -> None:
    rng = random.Random(7)
    # A camera that fails at more than seven in a row is not waited for.
    faults = {(pulse, 1): fate for pulse in range(1, PULSES - 1) if pulse % 6 and rng.random() < 0.6}
    done = pressed(1, faults)
    check(done)
    decided = Counter(tag.outcomes[1].status for tag in done.closed)
    assert decided == {OK: PULSES - len(faults), fate: len(faults)}
    assert done.pairer.counters[1].presumed == 0


@pytest.mark.long
@settings(max_examples=40)
@given(st.integers(0, 2**32), st.floats(0.5, 25.0), st.sampled_from([0.0, 0.1]), st.sampled_from([0.0, 0.1]))
def test_pulses_at_any_time_keep_the_rules(seed: int, slowest_s: float, missed: float, lost: float) -> None:
    rng = random.Random(seed)
    pauses = {pulse: rng.uniform(0.2, slowest_s) for pulse in range(120)}
    run = Run(Hill(Scenario(seed=seed, pulses=120, pauses=pauses, missed=missed, lost=lost)))
    check(run)


def by_hand() -> Feed:
    feed = Feed()
    for index, pulse in enumerate([0, 20, 71, 90, 133]):
        feed.all_cameras(pulse, [index + 1] * 3)
    return feed


def test_an_incomplete_pulse_waits_for_the_next_one() -> None:
    feed = by_hand()
    feed.all_cameras(150, [6, None, 6])
    feed.advance(feed.time_of(150) + 3 * NS_PER_S)
    assert len(feed.closed) == 5
    feed.all_cameras(250, [7, 6, 7])
    assert [pulse.outcomes[1].status for pulse in feed.closed[5:]] == [MISSED, OK]
    assert feed.pairer.counters[1].presumed == 0


def test_it_does_not_wait_for_ever() -> None:
    feed = by_hand()
    feed.all_cameras(150, [6, None, 6])
    deadline = feed.pairer.next_deadline()
    assert deadline is not None
    assert feed.time_of(150) + 10 * NS_PER_S < deadline < feed.time_of(150) + 60 * NS_PER_S
    feed.advance(deadline)
    assert feed.closed[5].outcomes[1].status is LOST, "presumed"


def test_nor_for_more_pulses_than_fire_during_the_hold_in_a_rhythm() -> None:
    feed, most = by_hand(), HOLD // PERIOD
    for index in range(most + 1):
        assert len(feed.closed) == 5
        feed.all_cameras(150 + 20 * index, [6 + index, None, 6 + index])
    feed.advance(feed.time_of(150 + 20 * most) + HOLD)
    assert [pulse.outcomes[1].status for pulse in feed.closed[5:]] == [LOST]
    assert feed.pairer.health().open == most
    assert feed.pairer.overdue(feed.time_of(150 + 20 * most)) == (), "three presses of a hand are no silence"


def test_at_the_end_of_a_recording_nothing_waits() -> None:
    feed = by_hand()
    feed.all_cameras(150, [6, None, 6])
    feed.pairer.hurry(feed.time_of(151))
    assert feed.pairer.next_deadline() == feed.time_of(150) + HOLD
    feed.advance(feed.time_of(150) + HOLD)
    assert len(feed.closed) == 6


def test_pulses_in_a_rhythm_do_not_wait() -> None:
    feed = Feed()
    for pulse in range(10):
        feed.all_cameras(pulse, [pulse + 1] * 3)
    feed.all_cameras(10, [11, None, 11])
    feed.advance(START + 2 * NS_PER_S + MS)
    assert feed.closed[10].outcomes[1].status is LOST
