"""What is wrong with clocks, trigger and rate is said in words, and only that."""

import pytest

from rig.clocks import NS_PER_S
from rig.phrase import Phrase
from tests.triggering.feed import START, Feed
from tests.triggering.simulation import MS
from triggering.alarms.momentary import momentary


def said(feed: Feed, rate_hz: float = 30.0) -> list[Phrase]:
    return [alarm.said for alarm in momentary(feed.pairer.health(), ["K1", "K2", "K3"], rate_hz)]


def train(feed: Feed, pulses: range, *, period: float = 1.0) -> None:
    for pulse in pulses:
        feed.all_cameras(pulse * period, [pulse + 1] * 3)


def test_nothing_is_said_of_a_good_train() -> None:
    feed = Feed()
    train(feed, range(60), period=1.01)
    assert said(feed) == []


@pytest.mark.parametrize("rate_hz", [101.0, 15.0, 29.3])
def test_a_rate_that_the_rig_file_does_not_name(rate_hz: float) -> None:
    feed = Feed()
    train(feed, range(12), period=30.0 / rate_hz)
    (only,) = said(feed)
    assert str(only) == (f"pulses come at {rate_hz} Hz, the rig file says rate_hz = 30: correct [trigger] rate_hz")


def test_pulses_without_a_rhythm_contradict_no_rate() -> None:
    feed = Feed()
    for index, pulse in enumerate([0, 20, 71, 90, 133, 140, 180]):
        feed.all_cameras(pulse, [index + 1] * 3)
    assert said(feed) == []


def test_a_clock_that_was_set_is_said_for_ten_seconds() -> None:
    feed = Feed(reads=True)
    train(feed, range(20))
    for index in range(2):
        feed.latch(1, feed.time_of(19.5) + index * MS, clock=-400 * NS_PER_S)
    for pulse in range(20, 340):
        feed.frame(1, pulse, pulse + 1, clock=-400 * NS_PER_S)
        feed.all_cameras(pulse, [pulse + 1, None, pulse + 1])
        assert pulse > 310 or [phrase.code for phrase in said(feed)] == ["pairing_clock"]
    assert said(feed) == []


@pytest.mark.parametrize(
    ("before_s", "after_s", "code"), [(4.29, 0.0, "zero"), (34.36, 0.0, "zero"), (34.36, 20.0, "")]
)
def test_a_clock_that_runs_over_is_not_told_to_lock(before_s: float, after_s: float, code: str) -> None:
    feed = Feed(reads=True, latches=False)
    start, over = round(before_s * NS_PER_S), feed.time_of(19.5)
    begin = start - (over - START)
    feed.latch(1, clock=begin)
    for camera in (0, 2):
        feed.latch(camera)
    for pulse in range(20):
        feed.frame(1, pulse, pulse + 1, clock=begin)
        feed.all_cameras(pulse, [pulse + 1, None, pulse + 1])
    anew = round(after_s * NS_PER_S) - (over - START)
    for pulse in range(20, 40):
        feed.frame(1, pulse, pulse + 1, clock=anew)
        feed.latch(1, feed.time_of(pulse) + 6 * MS, clock=anew)
        feed.all_cameras(pulse, [pulse + 1, None, pulse + 1])
    (only,) = said(feed)
    assert only.code == ("pairing_clock_zero" if code else "pairing_clock")
    assert ("let PTP lock" in only.text) is not bool(code)


def test_two_pulses_of_which_no_camera_has_both() -> None:
    feed = Feed(reads=True)
    train(feed, range(30))
    feed.frame(0, 30, 31)
    feed.frame(1, 30.1, 31)
    feed.frame(2, 30.1, 31)
    for pulse in range(31, 34):
        feed.all_cameras(pulse, [pulse + 1] * 3)
    (only,) = said(feed)
    assert not list(momentary(feed.pairer.health(), ["K1", "K2", "K3"], 30.0, one_edge=False))
    assert only.code == "pairing_double"
    assert only.values == {"apart_ms": 3.3}
