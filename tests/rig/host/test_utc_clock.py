"""What a log says of UTC: as the kernel judges, whole through a metadata record, nothing made of nonsense."""

import ctypes
from dataclasses import replace

import pytest

from rig.clocks import UtcAnchor
from rig.host.utc_clock import SetClock, UtcState, utc_fields, utc_state

STATE = UtcState(True, "chrony", -12.5, 20.0, 812.0)


def test_the_kernel_is_asked() -> None:
    clock_error = 5  # TIME_ERROR, sys/timex.h: not synchronized, says the return value
    state = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(512))
    found = utc_state()
    assert found.synchronized is (state != clock_error)
    assert found.at_most_us >= found.estimated_us >= 0
    assert UtcState.from_fields(utc_fields()) is not None


@pytest.mark.parametrize("state", [STATE, replace(STATE, synchronized=False)])
def test_it_stands_in_a_log_as_it_was(state: UtcState) -> None:
    assert UtcState.from_fields({"name": "rig", **state.to_fields()}) == state


def test_it_is_said_in_one_line() -> None:
    assert STATE.in_words() == (
        "synchronized by chrony, off by 20 us (estimated), 812 us at most; -12 us being corrected"
    )
    assert replace(STATE, at_most_us=16e6).in_words().count("16.0 s at most") == 1
    assert replace(STATE, synchronized=False).in_words().startswith("not synchronized (chrony runs): date and time are")
    assert replace(STATE, keeper="").in_words().startswith("synchronized, off by 20 us")


@pytest.mark.parametrize(
    "fields",
    [{}, {"utc": "unknown"}, STATE.to_fields() | {"utc": "perhaps"}, STATE.to_fields() | {"utc_at_most_us": "nan"}],
)
def test_what_makes_no_sense_is_nothing(fields: dict[str, str]) -> None:
    assert UtcState.from_fields(fields) is None


def test_a_clock_that_is_set_is_noticed_once() -> None:
    offsets = iter([10**18, 10**18 + 500_000, 10**18 + 2_500_500_000, 10**18 + 2_500_500_000, 10**18])
    clock = SetClock(lambda: UtcAnchor(next(offsets)))
    assert [clock.moved_s() for _ in range(4)] == [0.0, 2.5, 0.0, -2.5005]


def test_the_clock_of_this_computer_is_not_set() -> None:
    clock = SetClock()
    assert [clock.moved_s() for _ in range(20)] == [0.0] * 20
