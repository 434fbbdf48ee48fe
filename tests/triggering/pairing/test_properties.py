"""Property tests: the rules of `oracle` hold under every mixture of faults."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.triggering.oracle import check
from tests.triggering.simulation import MS, Hill, Outage, Run, Scenario

SETTINGS = settings(max_examples=120)

drifts = st.tuples(*[st.floats(-100, 100)] * 3)
seldom_or_often = st.sampled_from([0.0, 0.01, 0.1])
common = {
    "seed": st.integers(0, 2**32),
    "rate_hz": st.sampled_from([1.0, 10.0, 29.97, 50.0, 100.0, 200.0]),
    "rate_error": st.sampled_from([0.0, 3e-4, -0.05, 0.05]),
    "jitter_ns": st.integers(0, MS),
    "drift_ppm": drifts,
    "missed": seldom_or_often,
    "lost": seldom_or_often,
    "damaged": st.sampled_from([0.0, 0.02, 0.05]),
    "first_id": st.sampled_from([1, 1, 40_000, 65_401, 65_460]),
    "modulus": st.sampled_from([65_535, 0]),
    "batch_ns": st.sampled_from([0, 0, 3 * MS, 700 * MS]),
    "trigger_counts": st.booleans(),
    "damage_tells_time": st.booleans(),
}


@SETTINGS
@given(st.builds(Scenario, pulses=st.just(160), hold_periods=st.sampled_from([3.0, 9.0]), **common))
def test_any_faults(scenario: Scenario) -> None:
    run = Run(Hill(scenario))
    check(run)
    # Pulses wait for every camera except one that failed so often in a row that it counts as silent.
    assert run.silent or run.unplaced == []


@pytest.mark.long
@SETTINGS
@given(
    st.builds(Scenario, pulses=st.just(160), hold_periods=st.just(9.0), **common),
    st.dictionaries(st.integers(5, 155), st.floats(6.0, 300.0), min_size=1, max_size=4),
)
def test_pauses_of_the_pulse_train(scenario: Scenario, pauses: dict[int, float]) -> None:
    """After the pause the train goes on at any phase."""
    period_s = scenario.period_ns / 1e9
    for pulse, periods in pauses.items():
        scenario.pauses[pulse] = periods * period_s
    run = Run(Hill(scenario))
    check(run)
    assert run.silent or run.unplaced == []


@pytest.mark.long
@SETTINGS
@given(
    st.builds(Scenario, pulses=st.just(200), hold_periods=st.sampled_from([3.0, 9.0]), **common),
    st.lists(
        st.tuples(st.floats(0.05, 0.6), st.floats(0.02, 0.3), st.one_of(st.none(), st.floats(0.0, 0.9))),
        min_size=1,
        max_size=3,
    ),
)
def test_cameras_go_and_come_back(scenario: Scenario, away: list[tuple[float, float, float | None]]) -> None:
    """The camera comes back with another clock and ids from 1, or without a report, as after a pulled cable."""
    length_s = scenario.pulses / scenario.rate_hz
    outages = tuple(
        Outage(
            camera, begin * length_s, (begin + length) * length_s, None if told is None else told * length * length_s
        )
        for camera, (begin, length, told) in enumerate(away)
    )
    batch_ns = min(scenario.batch_ns, 3 * MS)
    run = Run(Hill(Scenario(**{**vars(scenario), "outages": outages, "batch_ns": batch_ns})))
    check(run)


@SETTINGS
@given(
    st.builds(Scenario, pulses=st.just(160), hold_periods=st.sampled_from([3.0, 9.0]), **common),
    st.dictionaries(st.tuples(st.integers(20, 140), st.integers(0, 2)), st.just(300 * MS), min_size=1, max_size=4),
)
def test_bursts_of_late_frames(scenario: Scenario, bursts: dict[tuple[int, int], int]) -> None:
    """A link stands still for 0.3 s, then all frames come at once: too late for their pulses, or just in time."""
    run = Run(Hill(Scenario(**{**vars(scenario), "bursts": bursts})))
    check(run, causes=False)
    late = sum(counters.late for counters in run.pairer.counters)
    assert len(run.unplaced) <= late + sum(counters.implausible + counters.stale for counters in run.pairer.counters)
