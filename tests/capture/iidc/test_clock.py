"""The cycle time of the bus: words, nanoseconds, wraps."""

from hypothesis import given
from hypothesis import strategies as st

from capture.iidc.clock import WRAP_NS, CycleTime, unwrap

TICKS = 128 * 8000 * 3072
words = st.builds(
    lambda s, c, t: s << 25 | c << 12 | t, st.integers(0, 127), st.integers(0, 7999), st.integers(0, 3071)
)


def test_a_word_of_the_register() -> None:
    time = CycleTime.from_word(5 << 25 | 4000 << 12 | 1536)
    assert (time.seconds, time.cycles, time.ticks, time.valid) == (5, 4000, 1536, True)
    assert time.ns == 5_500_062_500


@given(words)
def test_a_tick_is_the_exact_share_of_a_second(word: int) -> None:
    time = CycleTime.from_word(word)
    ticks = (time.seconds * 8000 + time.cycles) * 3072 + time.ticks
    assert time.valid
    assert abs(time.ns * 24_576_000 - ticks * 1_000_000_000) <= 24_576_000 // 2
    assert 0 <= time.ns < WRAP_NS


@given(st.integers(0, 127), st.one_of(st.integers(8000, 8191).map(lambda c: (c, 0)),
                                      st.integers(3072, 4095).map(lambda t: (0, t))))  # fmt: skip
def test_what_no_clock_shows_is_not_valid(seconds: int, rest: tuple[int, int]) -> None:
    assert not CycleTime.from_word(seconds << 25 | rest[0] << 12 | rest[1]).valid


@given(st.integers(0, 10**15), st.integers(-63 * 10**9, 63 * 10**9))
def test_any_number_of_wraps_is_undone_within_a_minute(true_ns: int, off_by: int) -> None:
    assert unwrap(true_ns % WRAP_NS, true_ns + off_by) == true_ns
