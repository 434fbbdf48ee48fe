"""The account of a recording: pauses by the times of the tags, counts, and memory that does not grow."""

import random
import tracemalloc
from collections.abc import Iterable, Sequence

import pytest

from rig.clocks import NS_PER_S, UtcNs
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from tests.support.repeats import repeats
from tests.triggering.feed import PERIOD
from triggering.ledger.account import Ledger

START = 1_795_216_434 * NS_PER_S
NAMES = ("K1", "K2", "K3")
OK = FrameStatus.OK


def tag_at(pulse: int, time: int, ids: Sequence[int | None], fates: Sequence[FrameStatus] | None = None) -> TripletTag:
    """A tag; a camera without an id has no frame."""
    fates = fates or [FrameStatus.LOST if frame_id is None else OK for frame_id in ids]
    cameras = tuple(
        CameraTag(name, (64 * place, 64 * place + 64), fate, frame_id, offset_us=None if frame_id is None else 1.5)
        for place, (name, frame_id, fate) in enumerate(zip(NAMES, ids, fates, strict=True))
    )
    return TripletTag(PulseNumber(pulse), UtcNs(time), "", "r", (48, 192), cameras)


def account(intervals_ns: Iterable[float], *, holes: dict[int, int] | None = None) -> Ledger:
    """A complete recording with these times between its pulses; `holes`: pulse -> frames that were taken before it."""
    ledger, time, first = Ledger(), float(START), 1
    for pulse, interval in enumerate([0.0, *intervals_ns], 1):
        time, first = time + interval, first + (holes or {}).get(pulse, 0)
        ledger.add(tag_at(pulse, round(time), [first, first + 7, first + 99]))
        first += 1
    return ledger


def test_an_unbroken_train_has_no_pause() -> None:
    rng = random.Random(1)
    ledger = account(PERIOD + rng.gauss(0, 0.004 * PERIOD) for _ in range(500))
    assert ledger.pauses() == ()
    assert ledger.whole


@pytest.mark.parametrize("before", [1, 2, 20, 399, 400])
def test_a_pause_is_found_wherever_it_is(before: int) -> None:
    intervals = [PERIOD] * 400
    intervals[before - 1] = 97 * PERIOD
    (pause,) = account(intervals).pauses()
    assert (pause.after_pulse, pause.before_pulse, pause.pulses) == (before, before + 1, 96)
    assert pause.seconds == pytest.approx(97 / 30)
    assert pause.idle == NAMES
    assert "no pulses for 3.23 s after pulse" in pause.in_words()
    assert "K1, K2, K3 took no frame in it" in pause.in_words()


def test_one_pulse_that_has_no_tag_is_a_pause() -> None:
    ledger = account([PERIOD] * 50 + [2 * PERIOD] + [PERIOD] * 50)
    assert [pause.pulses for pause in ledger.pauses()] == [1]
    assert not ledger.whole


def test_frame_numbers_with_a_hole_do_not_prove_that_nobody_took_a_frame() -> None:
    (pause,) = account([PERIOD] * 50 + [30 * PERIOD] + [PERIOD] * 50, holes={52: 29}).pauses()
    assert pause.idle == ()
    assert "do not tell" in pause.in_words()


def test_a_train_that_becomes_slower_or_faster_pauses_once_at_most() -> None:
    slower, faster = [PERIOD] * 100 + [3 * PERIOD] * 100, [3 * PERIOD] * 100 + [PERIOD] * 100
    assert len(account(slower).pauses()) <= 1
    assert account(faster).pauses() == ()


def test_pulses_by_hand_have_no_rhythm_that_could_be_broken() -> None:
    rng = random.Random(2)
    ledger = account(rng.uniform(0.4, 6.0) * NS_PER_S for _ in range(300))
    assert ledger.pauses() == ()
    assert ledger.whole


def test_pulses_without_a_tag_are_no_pause() -> None:
    ledger = Ledger()
    for pulse in [*range(1, 40), *range(60, 100)]:
        ledger.add(tag_at(pulse, START + pulse * PERIOD, [pulse] * 3))
    assert ledger.missing == [(40, 59)]
    assert ledger.pauses() == ()
    assert not ledger.whole


def test_time_before_the_first_and_after_the_last_pulse_counts() -> None:
    ledger = account([PERIOD] * 59)
    ledger.lasted(UtcNs(START - PERIOD), UtcNs(START + 60 * PERIOD), PERIOD)
    assert ledger.whole
    ledger.lasted(UtcNs(START - 2 * NS_PER_S), UtcNs(START + 5 * NS_PER_S), PERIOD)
    head, tail = ledger.pauses()
    assert (head.after_pulse, head.before_pulse, head.pulses) == (0, 1, 60)
    assert (tail.after_pulse, tail.before_pulse) == (60, None)
    assert "in the first 2 s" in head.in_words()
    assert "in the last 3.03 s" in tail.in_words()


def test_a_recording_without_a_pulse_is_one_pause() -> None:
    ledger = Ledger()
    assert ledger.whole, "nothing is known of its length"
    ledger.lasted(UtcNs(START), UtcNs(START + 8 * NS_PER_S), PERIOD)
    (pause,) = ledger.pauses()
    assert (pause.pulses, "in the 8 s of the recording" in pause.in_words()) == (240, True)
    one = account([])
    one.lasted(UtcNs(START), UtcNs(START + 8 * NS_PER_S), PERIOD)
    assert [pause.after_pulse for pause in one.pauses()] == [1]


def test_two_pulses_are_judged_by_the_nominal_rate() -> None:
    ledger = account([5 * NS_PER_S])
    ledger.lasted(None, None, PERIOD)
    assert [pause.pulses for pause in ledger.pauses()] == [149]


def test_the_account_says_pauses_in_words() -> None:
    ledger = account([PERIOD] * 50 + [31 * PERIOD] + [PERIOD] * 50 + [61 * PERIOD])
    assert "no pulses for 3.07 s in 2 pauses" in ledger.summary_line()
    assert sum("no pulses for" in line for line in ledger.in_words()) == 2


def test_neighbouring_pulses_with_the_same_fate_are_one_run() -> None:
    ledger = Ledger()
    for pulse in range(1, 101):
        ledger.add(tag_at(pulse, START + pulse * PERIOD, [pulse, None if 20 <= pulse <= 60 else pulse, pulse]))
    assert [(run.first, run.last) for run in ledger.failed.runs] == [(20, 60)]
    assert (ledger.failed.pulses, ledger.complete, ledger.failed.cameras["K2"][FrameStatus.LOST]) == (41, 59, 41)
    assert [pulse["pulse"] for pulse in ledger.incomplete_pulses(5)] == [20, 21, 22, 23, 24]
    assert list(ledger.in_words()) == ["pulses 20-60: K2 lost"]


@pytest.mark.parametrize("every", repeats([2, 1]))
def test_memory_does_not_grow_with_the_pulses(every: int) -> None:
    """One camera is away for twenty minutes, or fails at every second pulse."""
    ledger, rng = Ledger(), random.Random(3)

    def add(pulses: range) -> None:
        for pulse in pulses:
            frame_id = None if pulse % every == 0 else pulse
            ledger.add(tag_at(pulse, START + pulse * PERIOD + rng.randrange(50_000), [pulse, frame_id, pulse]))

    add(range(1, 40_001))
    tracemalloc.start()
    try:
        add(range(40_001, 80_001))
        grown, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert grown < 40_000, f"{grown} bytes for 40 000 pulses"
    assert ledger.failed.pulses == 80_000 // every


@pytest.mark.parametrize("known_first", [True, False])
def test_pulses_between_two_logs_of_a_recording_are_counted_and_not_taken_for_unreadable(known_first: bool) -> None:
    ledger, begin = Ledger(), START + 119 * PERIOD  # the log before this one ends with pulse 119
    if known_first:
        ledger.follows(PulseNumber(119))
    for pulse in range(172, 232):
        ledger.add(tag_at(pulse, START + pulse * PERIOD, [pulse, pulse, pulse]))
    if not known_first:  # the session record of a damaged log may be found late
        assert ledger.missing == [(1, 171)]
        ledger.follows(PulseNumber(119))
    ledger.lasted(UtcNs(begin), UtcNs(START + 231 * PERIOD), PERIOD)
    (gap,) = ledger.pauses()
    assert (gap.after_pulse, gap.before_pulse, gap.pulses, gap.between_logs) == (119, 172, 52, True)
    assert gap.seconds == pytest.approx(53 * PERIOD / NS_PER_S)
    assert gap.in_words().startswith("pulses 120-171 are in no log")
    assert (ledger.missing, ledger.whole) == ([], False)
