import time

from hypothesis import given
from hypothesis import strategies as st

from rig.clocks import NS_PER_S, HostNs, UtcAnchor, host_now


def test_the_anchor_says_what_time_it_is() -> None:
    anchor = UtcAnchor.take()
    before = time.time_ns()
    utc = anchor.utc(host_now())
    after = time.time_ns()
    assert before - NS_PER_S // 100 <= utc <= after + NS_PER_S // 100


@given(st.integers(0, 2**62), st.integers(0, 2**61))
def test_there_and_back_is_the_same_time(host: int, offset_ns: int) -> None:
    anchor = UtcAnchor(offset_ns)
    assert anchor.host(anchor.utc(HostNs(host))) == host


@given(st.integers(0, 2**61), st.integers(0, 2**61), st.integers(0, 2**61))
def test_durations_are_the_same_on_both_sides(first: int, second: int, offset_ns: int) -> None:
    anchor = UtcAnchor(offset_ns)
    assert anchor.utc(HostNs(second)) - anchor.utc(HostNs(first)) == second - first


def test_the_host_clock_does_not_run_backwards() -> None:
    readings = [host_now() for _ in range(1000)]
    assert readings == sorted(readings)
