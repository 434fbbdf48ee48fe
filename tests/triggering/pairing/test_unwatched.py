"""While no camera is there, the rhythm of the train says which pulses fired; they are tagged absent in all cameras."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.clocks import NS_PER_S, HostNs
from rig.frame import DamagedRecord, FrameStatus
from tests.triggering.feed import HOLD, PERIOD, Feed
from tests.triggering.oracle import ABSENT, DAMAGED, LOST, OK, check, check_no_pulse_is_mixed
from tests.triggering.pairing.test_records import running_train
from tests.triggering.simulation import MS, Hill, Outage, Run, Scenario


def fates(feed: Feed) -> list[set[FrameStatus]]:
    return [{outcome.status for outcome in pulse.outcomes} for pulse in feed.closed]


def all_gone(feed: Feed, pulse: float) -> None:
    for camera in range(3):
        feed.pairer.disconnected(camera, feed.time_of(pulse))


def test_pulses_go_on_while_every_camera_is_gone_and_are_counted_when_they_are_decided() -> None:
    feed = running_train(20)
    all_gone(feed, 20.5)
    feed.advance(feed.time_of(50) + HOLD - MS)
    assert len(feed.closed) == 50, "pulse 50 may still come late"
    feed.advance(feed.time_of(50) + HOLD + MS)
    assert fates(feed) == [{OK}] * 20 + [{ABSENT}] * 31
    assert feed.pairer.health().unwatched == 31
    for pulse, closed in enumerate(feed.closed):
        assert closed.number == pulse + 1
        assert abs(closed.time - feed.time_of(pulse)) < MS
        assert closed.cargo is None or pulse < 20


def test_the_train_goes_on_where_it_is_when_the_cameras_are_back() -> None:
    feed = running_train(20)
    all_gone(feed, 20.5)
    feed.advance(feed.time_of(60))
    for camera in range(3):
        feed.pairer.connected(camera, 2, feed.time_of(80.2))
        feed.latch(camera, feed.time_of(80.3), clock=10**12)
    for pulse in range(84, 90):  # the first frames after a connection take a while
        for camera in range(3):
            feed.frame(camera, pulse, pulse - 83, epoch=2, clock=10**12)
        feed.advance(feed.time_of(pulse) + 6 * MS)
    assert fates(feed) == [{OK}] * 20 + [{ABSENT}] * 64 + [{OK}] * 6
    assert all(abs(closed.time - feed.time_of(pulse)) < MS for pulse, closed in enumerate(feed.closed))


def test_one_camera_that_is_there_shows_that_the_train_paused() -> None:
    feed = running_train(20)
    for camera in (0, 1):
        feed.pairer.disconnected(camera, feed.time_of(20.5))
    feed.advance(feed.time_of(200))
    assert len(feed.closed) == 20
    feed.all_cameras(200, [None, None, 21])
    feed.all_cameras(201, [None, None, 22])
    assert fates(feed) == [{OK}] * 20 + [{ABSENT, OK}] * 2


@pytest.mark.parametrize("late_ms", [6, 40, 110])
def test_a_frame_that_was_cut_off_with_its_camera_stops_no_train(late_ms: int) -> None:
    """Power goes while a frame is being sent: what comes of it, soon or when the rest is given up, is damaged."""
    feed = running_train(20)
    feed.pairer.damaged(2, DamagedRecord(HostNs(feed.time_of(20) + late_ms * MS), epoch=1))
    all_gone(feed, 25)
    feed.advance(feed.time_of(60) + HOLD + MS)
    assert len(feed.closed) == 61
    assert fates(feed)[:20] == [{OK}] * 20
    assert all(found <= {ABSENT, DAMAGED} for found in fates(feed)[20:])
    assert sum(DAMAGED in found for found in fates(feed)) == 1


def test_a_train_that_paused_before_the_cameras_were_unplugged_is_not_continued() -> None:
    feed = running_train(20)
    for camera in range(3):
        feed.latch(camera, feed.time_of(60))  # it answers, and no frame came: the train has paused
    all_gone(feed, 61)
    feed.advance(feed.time_of(400))
    assert len(feed.closed) == 20


def test_cameras_that_fall_silent_together_are_absent_from_their_last_frame_on_once_they_are_given_up() -> None:
    feed = running_train(20)
    feed.advance(feed.time_of(100))
    assert len(feed.closed) == 20, "the train may have paused"
    all_gone(feed, 110)
    feed.advance(feed.time_of(110) + HOLD + MS)
    assert fates(feed) == [{OK}] * 20 + [{ABSENT}] * 91


def test_nothing_is_invented_before_the_rhythm_is_known() -> None:
    feed = running_train(2)
    all_gone(feed, 2.5)
    feed.advance(feed.time_of(1000))
    assert len(feed.closed) == 2


def test_pulses_by_hand_have_no_rhythm_that_could_go_on() -> None:
    feed, pulse = Feed(), 0.0
    for index, step in enumerate([11.3, 40, 17.7, 31, 55, 12, 23.4, 71, 19, 33.3]):
        pulse += step
        feed.all_cameras(pulse, [index + 1] * 3)
    all_gone(feed, pulse + 1)
    feed.advance(feed.time_of(pulse + 1000))
    assert len(feed.closed) == 10


def test_the_true_rate_counts_not_the_nominal_one() -> None:
    feed = Feed()
    for pulse in range(40):
        feed.all_cameras(pulse * 1.04, [pulse + 1] * 3)
    all_gone(feed, 40.6 * 1.04)
    feed.advance(feed.time_of(340 * 1.04) + HOLD + MS)
    assert len(feed.closed) == 341
    assert abs(feed.closed[-1].time - feed.time_of(340 * 1.04)) < PERIOD // 4


def test_a_frame_that_was_on_its_way_when_its_camera_was_given_up_is_used() -> None:
    feed = running_train(20)
    all_gone(feed, 20.2)
    assert feed.frame(1, 20, 21)
    feed.advance(feed.time_of(23) + HOLD + MS)
    assert [outcome.status for outcome in feed.closed[20].outcomes] == [ABSENT, OK, ABSENT]
    assert fates(feed)[21:] == [{ABSENT}] * 3


@settings(max_examples=80)
@given(
    st.integers(0, 2**32),
    st.sampled_from([10.0, 29.97, 100.0]),
    st.sampled_from([0.0, 3e-4, -0.05, 0.05]),
    st.floats(0.3, 0.5),
    st.lists(st.tuples(st.floats(0.0, 0.05), st.floats(0.1, 0.4), st.floats(0.0, 0.5)), min_size=3, max_size=3),
    st.sampled_from([0.0, 0.02]),
)
def test_all_cameras_go_and_come_back_one_after_the_other(
    seed: int,
    rate_hz: float,
    rate_error: float,
    begin: float,
    away: list[tuple[float, float, float]],
    lost: float,
) -> None:
    """No pulse is mixed, invented or forgotten, however the cameras go and come."""
    pulses = 240
    length_s = pulses / rate_hz
    outages = tuple(
        Outage(camera, (begin + later) * length_s, (begin + later + length) * length_s, told * length * length_s)
        for camera, (later, length, told) in enumerate(away)
    )
    run = Run(Hill(Scenario(
        seed=seed, pulses=pulses, rate_hz=rate_hz, rate_error=rate_error, outages=outages, lost=lost, jitter_ns=20_000,
    )))  # fmt: skip
    check(run)
    true = check_no_pulse_is_mixed(run)
    places = [place for place, pulse in enumerate(true) if pulse is not None]
    first, last = true[places[0]], true[places[-1]]
    assert first is not None
    assert last is not None
    assert places[-1] - places[0] == last - first, "a pulse was invented or forgotten"
    unseen = [closed for closed, pulse in zip(run.closed, true, strict=True) if pulse is None]
    assert all({outcome.status for outcome in closed.outcomes} <= {ABSENT, LOST} for closed in unseen)


def test_absent_pulses_take_no_memory() -> None:
    feed = running_train(20)
    all_gone(feed, 20.5)
    feed.advance(feed.time_of(20) + 3600 * NS_PER_S)
    assert len(feed.closed) > 107_000
    assert feed.pairer.health().open == 0
