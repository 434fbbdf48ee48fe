"""Pairing of hand-made records: cases that the simulated cameras do not produce, and what the recorder relies on."""

from itertools import pairwise

import pytest

from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs
from rig.errors import BadInputError
from rig.frame import DamagedRecord, FrameRecord
from tests.triggering.feed import HOLD, PERIOD, START, Feed
from tests.triggering.oracle import ABSENT, DAMAGED, LOST, MISSED, OK
from tests.triggering.simulation import MS, US
from triggering.pairing.pairer import Pairer


def running_train(pulses: int = 10) -> Feed:
    """A feed with some complete pulses, so that their rhythm is known."""
    feed = Feed(reads=True)
    for pulse in range(pulses):
        feed.all_cameras(pulse, [pulse + 1] * 3)
    return feed


def test_an_id_gone_wild_does_not_fill_a_pause() -> None:
    feed = Feed()
    for pulse in range(3):
        feed.all_cameras(pulse, [pulse + 1] * 3)
    feed.all_cameras(1800, [4, 1000, 4])
    assert [tag.complete for tag in feed.closed] == [True] * 4
    assert feed.pairer.counters[1].unexplained == 996


def test_a_silent_camera_is_noticed_at_the_first_deadline() -> None:
    feed = Feed()
    for pulse in range(20):
        for camera in range(3):
            if camera != 1 or pulse < 10:
                feed.frame(camera, pulse, pulse + 1)
        feed.advance(feed.time_of(pulse) + 5 * MS)
        deadline = feed.time_of(10) + HOLD
        assert feed.pairer.silent() == ((1,) if feed.time_of(pulse) + 5 * MS >= deadline else ())
    assert feed.closed[-1].number == 20, "pulses no longer wait for it"


def test_a_camera_three_pulses_behind_the_others_is_overdue_but_still_waited_for() -> None:
    feed = Feed()
    for pulse in range(20):
        for camera in range(3):
            if camera != 1 or pulse < 10 or pulse > 14:
                feed.frame(camera, pulse, pulse + 1)
        now = HostNs(feed.time_of(pulse) + 5 * MS)
        feed.advance(now)
        # Pulse 9 is the last one that the camera delivers: at pulse 12 it is three behind.
        assert feed.pairer.overdue(now) == ((1,) if 12 <= pulse <= 14 else ())
    assert [tag.outcomes[1].status for tag in feed.closed[10:15]] == [LOST] * 5


def test_no_camera_is_overdue_while_the_pulses_pause() -> None:
    feed = Feed()
    for pulse in [*range(10), *range(100, 110)]:
        for camera in range(3):
            feed.frame(camera, pulse, pulse + 1 if pulse < 10 else pulse - 89)
            assert feed.pairer.overdue(feed.time_of(pulse)) == ()
        feed.advance(feed.time_of(pulse) + 5 * MS)


def test_without_pulses_nobody_is_silent() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    assert feed.pairer.advance(HostNs(START + 3600 * NS_PER_S)) == []
    assert feed.pairer.next_deadline() is None
    assert feed.pairer.silent() == ()


def test_trigger_counts_tell_overruns() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1], triggers=[1, 1, 1])
    feed.all_cameras(1, [2, None, 2], triggers=[2, 0, 2])
    feed.all_cameras(2, [3, 2, 3], triggers=[3, 3, 3])
    assert [outcome.status for outcome in feed.closed[1].outcomes] == [OK, MISSED, OK]
    assert [counters.overruns for counters in feed.pairer.counters] == [0, 1, 0]
    assert [outcome.overrun for outcome in feed.closed[1].outcomes] == [False, True, False]


def test_a_pulse_that_the_camera_did_not_see_is_no_overrun() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1], triggers=[1, 1, 1])
    feed.all_cameras(1, [2, None, 2], triggers=[2, 0, 2])
    feed.all_cameras(2, [3, 2, 3], triggers=[3, 2, 3])
    assert feed.closed[1].outcomes[1].status is MISSED
    assert not feed.closed[1].outcomes[1].overrun


def test_of_several_pulses_in_a_row_as_many_are_overruns_as_the_camera_counted() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1], triggers=[1, 1, 1])
    for pulse in (1, 2, 3):
        feed.all_cameras(pulse, [pulse + 1, None, pulse + 1], triggers=[pulse + 1, 0, pulse + 1])
    feed.all_cameras(4, [5, 3, 5], triggers=[5, 4, 5])
    between = [pulse.outcomes[1] for pulse in feed.closed[1:4]]
    assert [outcome.status for outcome in between] == [LOST, MISSED, MISSED]
    assert [outcome.overrun for outcome in between] == [False, True, False]


@pytest.mark.parametrize("late_by", [3 * MS, 40 * MS])
@pytest.mark.parametrize("damaged_pulse", [1, 2])
def test_a_damaged_frame_that_tells_its_trigger_time_is_placed_by_it(damaged_pulse: int, late_by: int) -> None:
    """FireWire delivers a torn frame only when the next one begins or ends."""
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    for pulse in (1, 2):
        for camera in (0, 2):
            feed.frame(camera, pulse, pulse + 1)
    trigger = feed.time_of(damaged_pulse)
    arrival = HostNs(feed.time_of(2) + late_by)
    device = DeviceNs(trigger - START + 100 * US)
    feed.pairer.damaged(1, DamagedRecord(arrival, device, epoch=1))
    feed.all_cameras(3, [4, 4, 4])
    statuses = [pulse.outcomes[1].status for pulse in feed.closed[1:3]]
    assert statuses == ([DAMAGED, LOST] if damaged_pulse == 1 else [LOST, DAMAGED])


def test_frames_before_the_clock_is_known_are_counted_not_placed() -> None:
    feed = Feed(latches=False)
    assert not feed.frame(0, 0, 1)
    assert feed.pairer.counters[0].unanchored == 1
    feed.latch(0, feed.time_of(0.5))
    assert feed.frame(0, 1, 2)


def test_a_clock_that_is_known_too_badly_does_not_place_frames() -> None:
    feed = Feed(latches=False)
    feed.pairer.latch(0, ClockLatch(DeviceNs(0), START, PERIOD))
    assert not feed.frame(0, 0, 1)
    feed.latch(0, START + MS)
    assert feed.frame(0, 1, 2)


def test_a_frame_that_comes_twice_is_placed_once() -> None:
    feed = Feed()
    assert feed.frame(0, 0, 1)
    assert not feed.frame(0, 0, 1)
    assert feed.pairer.counters[0].duplicate == 1


def test_a_frame_after_its_pulse_is_decided_is_late() -> None:
    feed = running_train()
    feed.frame(0, 10, 11)
    feed.frame(1, 10, 11)
    assert feed.pairer.next_deadline() == feed.time_of(10) + HOLD
    feed.advance(feed.time_of(10) + HOLD)
    assert len(feed.closed) == 11
    assert not feed.frame(2, 10, 11, after=HOLD + MS)
    assert feed.pairer.counters[2].late == 1


def test_a_pulse_decided_too_early_is_counted_when_the_ids_contradict() -> None:
    feed = running_train()
    feed.all_cameras(10, [11, None, 11])
    feed.advance(feed.time_of(30))
    assert feed.closed[10].outcomes[1].status is LOST, "presumed"
    feed.all_cameras(31, [12, 11, 12])
    assert feed.pairer.counters[1].presumed == 1
    assert feed.pairer.counters[1].contradicted == 1


def test_a_damaged_arrival_outweighs_a_wrong_presumption() -> None:
    feed = running_train()
    feed.all_cameras(10, [11, None, 11])
    feed.advance(feed.time_of(30))
    feed.pairer.damaged(1, DamagedRecord(HostNs(feed.time_of(31) + 5 * MS), epoch=1))
    feed.all_cameras(31, [12, None, 12])
    feed.all_cameras(32, [13, 12, 13])
    assert [tag.outcomes[1].status for tag in feed.closed[9:]] == [OK, LOST, DAMAGED, OK]
    assert feed.pairer.counters[1].contradicted == 1


def test_with_a_short_hold_silence_is_noticed_from_what_was_decided_before() -> None:
    feed = Feed(hold_ns=PERIOD + 5 * MS)
    for pulse in range(14):
        feed.all_cameras(pulse, [pulse + 1, None if pulse >= 10 else pulse + 1, pulse + 1])
    assert feed.pairer.silent() == (1,)
    assert [tag.outcomes[1].status for tag in feed.closed] == [OK] * 10 + [LOST] + [ABSENT] * 3


def test_frames_that_others_may_still_deliver_prove_no_pulse_in_a_pause() -> None:
    """A camera lost two frames after a pause; the second pulse is not known yet when the first is decided."""
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.frame(0, 12.5, 4)
    feed.frame(1, 10.5, 2)
    feed.frame(2, 10.5, 2)
    feed.advance(feed.time_of(12.6))
    for camera in (1, 2):
        feed.frame(camera, 11.5, 3)
        feed.frame(camera, 12.5, 4)
    feed.advance(feed.time_of(12.7))
    assert [tag.outcomes[0].status for tag in feed.closed] == [OK, LOST, LOST, OK]
    assert feed.pairer.health().proven_by_ids == 0


def test_ids_that_begin_anew_without_notice_are_reported() -> None:
    feed = Feed()
    feed.all_cameras(0, [500, 500, 500])
    feed.all_cameras(1, [501, None, 501])
    feed.all_cameras(2, [502, 1, 502])
    assert feed.pairer.counters[1].restarts == 1
    assert [tag.outcomes[1].status for tag in feed.closed] == [OK, ABSENT, OK]


def test_16_bit_ids_that_begin_anew_near_the_wrap_are_not_a_great_loss() -> None:
    feed = Feed()
    feed.all_cameras(0, [65000, 65000, 65000])
    feed.all_cameras(1, [65001, None, 65001])
    feed.all_cameras(2, [65002, 1, 65002])
    assert feed.pairer.counters[1].restarts == 1
    assert len(feed.closed) == 3


def test_pulses_before_a_camera_first_came_are_absent_however_late_they_are_decided() -> None:
    feed = Feed()
    feed.pairer = Pairer(2, PERIOD, hold_ns=10 * PERIOD)
    for camera, since in ((0, START), (1, feed.time_of(0.5))):
        feed.pairer.connected(camera, 1, since)
        feed.latch(camera, since)
    feed.frame(0, 0, 1)
    feed.frame(0, 1, 2)
    feed.frame(1, 1, 1)
    feed.advance(feed.time_of(1.5))
    assert [tag.outcomes[1].status for tag in feed.closed] == [ABSENT, OK]


def test_a_frame_taken_just_before_the_connection_was_reported_is_waited_for() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.pairer.disconnected(0, feed.time_of(0.2))
    feed.pairer.connected(0, 2, HostNs(feed.time_of(1) + MS))
    feed.latch(0, feed.time_of(1) + 2 * MS, clock=77)
    feed.all_cameras(1, [None, 2, 2])
    assert feed.frame(0, 1, 1, epoch=2, clock=77, after=20 * MS)
    feed.advance(feed.time_of(1) + 20 * MS)
    assert feed.closed[1].complete


def test_a_device_clock_that_is_set_anew_without_notice() -> None:
    feed, behind = Feed(), -400 * NS_PER_S
    for pulse in range(5):
        feed.all_cameras(pulse, [pulse + 1] * 3)
    for pulse in range(5, 8):  # its frames have no trigger time, so they count as damaged
        feed.frame(1, pulse, pulse + 1, clock=behind)
        feed.all_cameras(pulse, [pulse + 1, None, pulse + 1])
    for index in range(2):
        feed.latch(1, feed.time_of(7.5) + index * MS, clock=behind)
    for pulse in range(8, 12):
        feed.frame(1, pulse, pulse + 1, clock=behind)
        feed.all_cameras(pulse, [pulse + 1, None, pulse + 1])
    assert [tag.outcomes[1].status for tag in feed.closed] == [OK] * 5 + [DAMAGED] * 3 + [OK] * 4
    assert feed.pairer.counters[1].implausible == 3
    assert feed.pairer.counters[1].clock_steps == 1


def test_a_device_time_in_the_future_is_not_believed() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.frame(0, 1, 2, clock=10**15)
    feed.all_cameras(1, [None, 2, 2])
    feed.all_cameras(2, [3, 3, 3])
    assert [tag.outcomes[0].status for tag in feed.closed] == [OK, DAMAGED, OK]


def test_records_of_an_epoch_that_is_over_are_dropped() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.pairer.disconnected(0, feed.time_of(0.3))
    feed.pairer.connected(0, 2, feed.time_of(0.4))
    assert not feed.frame(0, 1, 2, epoch=1)
    feed.pairer.damaged(0, DamagedRecord(feed.time_of(1.5), epoch=1))
    assert feed.pairer.counters[0].stale == 2


def test_a_new_grabber_counts_its_epochs_from_1_again() -> None:
    feed, ahead = Feed(), 10**12
    feed.all_cameras(0, [1, 1, 1])
    feed.pairer.disconnected(0, feed.time_of(0.3))
    feed.all_cameras(1, [None, 2, 2])
    assert [outcome.status for outcome in feed.closed[1].outcomes] == [ABSENT, OK, OK]
    feed.pairer.connected(0, 1, feed.time_of(1.5))
    feed.latch(0, feed.time_of(1.6), clock=ahead)
    feed.frame(0, 2, 1, clock=ahead)
    feed.all_cameras(2, [None, 3, 3])
    assert feed.closed[2].complete


def test_frames_still_queued_when_their_grabber_is_given_up_are_placed() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.frame(1, 1, 2)
    feed.frame(2, 1, 2)
    feed.pairer.disconnected(0, feed.time_of(1.5))
    assert feed.frame(0, 1, 2)
    feed.advance(feed.time_of(1.6))
    assert feed.closed[1].complete


def test_damaged_frames_before_a_disconnection_keep_their_cause() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.pairer.damaged(0, DamagedRecord(HostNs(feed.time_of(1) + 25 * MS), epoch=1))
    feed.all_cameras(1, [None, 2, 2])
    feed.pairer.disconnected(0, feed.time_of(2.5))
    feed.all_cameras(2, [None, 3, 3])
    assert [tag.outcomes[0].status for tag in feed.closed] == [OK, DAMAGED, ABSENT]


def test_a_camera_that_was_never_there_is_absent_and_not_waited_for() -> None:
    pairer = Pairer(2, PERIOD, hold_ns=4 * PERIOD)
    pairer.connected(0, 1, START)
    pairer.latch(0, ClockLatch(DeviceNs(0), START, 50 * US))
    record = FrameRecord(HostNs(START + 30 * MS), 0, 1, 0, DeviceNs(20 * MS), epoch=1)
    assert pairer.frame(0, record) is not None
    (tag,) = pairer.advance(HostNs(START + 30 * MS))
    assert [outcome.status for outcome in tag.outcomes] == [OK, ABSENT]
    pairer.disconnected(1, START)  # a grabber that never connected reports that too, which changes nothing
    assert pairer.counters[1].outcomes[ABSENT] == 1


def test_one_camera_alone() -> None:
    feed = Feed(cameras=1)
    for pulse in range(5):
        if pulse != 3:
            feed.all_cameras(pulse, [pulse + 1])
    assert [tag.outcomes[0].status for tag in feed.closed] == [OK, OK, OK, LOST, OK]


def test_cameras_that_always_differ_find_each_other_and_raise_the_alarm() -> None:
    """How far the frames of one pulse lie apart is learned: the cameras may have different delays."""
    feed = Feed()
    for pulse in range(60):
        for camera in range(3):
            feed.frame(camera, pulse, pulse + 1, clock=9 * MS if camera == 2 else 0, after=20 * MS)
        feed.advance(feed.time_of(pulse) + 21 * MS)
    health = feed.pairer.health()
    assert health.alarm
    assert health.spread_max_us > 8000
    assert all(tag.complete for tag in feed.closed[-15:])


def test_frames_that_no_longer_find_each_other_raise_the_alarm() -> None:
    feed = Feed()
    for pulse in range(10):
        for camera in range(3):
            feed.frame(camera, pulse, pulse + 1, clock=-13 * MS if camera == 2 else 0)
        feed.advance(feed.time_of(pulse) + 6 * MS)
    assert feed.pairer.health().alarm
    assert not any(tag.complete for tag in feed.closed)


def test_times_of_the_pulses_are_the_median_of_the_frames() -> None:
    feed = Feed()
    for camera, clock in enumerate((0, 300 * US, 100 * US)):
        feed.frame(camera, 0, 1, clock=clock)
    feed.advance(feed.time_of(0) + 6 * MS)
    (tag,) = feed.closed
    assert abs(tag.time - feed.time_of(0) - 100 * US) < 50 * US
    offsets = [outcome.offset_ns for outcome in tag.outcomes]
    assert offsets[2] == 0
    assert all(a is not None and b is not None and a < b for a, b in pairwise([offsets[0], offsets[2], offsets[1]]))


@pytest.mark.parametrize(
    ("cameras", "period", "hold", "tolerance"),
    [(0, PERIOD, PERIOD, None), (3, 0, PERIOD, None), (3, PERIOD, PERIOD, PERIOD), (3, PERIOD, 1, None)],
)
def test_arguments_that_cannot_work_are_refused(cameras: int, period: int, hold: int, tolerance: int | None) -> None:
    with pytest.raises(BadInputError, match="cannot work"):
        Pairer(cameras, period, hold_ns=hold, tolerance_ns=tolerance)
