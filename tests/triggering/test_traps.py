"""One example for each trap that real cameras have shown, and for what the recorder relies on."""

from dataclasses import replace
from itertools import pairwise

import pytest

from rig.clocks import NS_PER_S, ClockLatch, DeviceNs, HostNs
from rig.errors import BadInputError
from rig.frame import FrameStatus, Record, RecordKind
from tests.triggering.oracle import ABSENT, DAMAGED, LOST, MISSED, OK, check, check_no_pulse_is_mixed
from tests.triggering.simulation import MS, US, Hill, Outage, Run, Scenario
from triggering.pairing import Pairer

PERIOD = NS_PER_S // 30
HOLD = 3 * PERIOD + 60 * MS
START = HostNs(1_000 * NS_PER_S)


def run(**scenario: object) -> Run:
    """A run in which the iron rules hold."""
    done = Run(Hill(replace(Scenario(pulses=40), **scenario)))  # type: ignore[arg-type]
    check(done)
    return done


def statuses(done: Run, pulse: int) -> list[FrameStatus]:
    """What was decided for a true pulse that some camera delivered."""
    tags = [tag for tag, true in zip(done.closed, check_no_pulse_is_mixed(done), strict=True) if true == pulse]
    assert len(tags) == 1
    return [outcome.status for outcome in tags[0].outcomes]


def test_without_faults_every_pulse_is_complete() -> None:
    done = run()
    assert [tag.complete for tag in done.closed] == [True] * 40
    assert done.unplaced == []
    assert max(abs(o.offset_ns or 0) for tag in done.closed for o in tag.outcomes) < MS
    assert not done.pairer.health()["alarm"]


def test_one_camera_misses_the_very_first_pulse() -> None:
    """Counting from the first frame after arming would be one period off for ever."""
    done = run(faults={(0, 1): MISSED})
    assert statuses(done, 0) == [OK, MISSED, OK]
    assert sum(tag.complete for tag in done.closed) == 39


@pytest.mark.parametrize(("fate", "first_id"), [(LOST, 1), (MISSED, 1), (DAMAGED, 1), (DAMAGED, 65401)])
def test_the_first_frame_after_the_start_fails(fate: FrameStatus, first_id: int) -> None:
    assert statuses(run(faults={(0, 2): fate}, first_id=first_id), 0) == [OK, OK, fate]


def test_ids_that_do_not_begin_at_1_prove_nothing_before_the_first_frame() -> None:
    assert statuses(run(faults={(0, 2): LOST}, first_id=65401), 0) == [OK, OK, ABSENT]


def test_after_a_missed_pulse_equal_ids_are_of_different_pulses() -> None:
    done = run(faults={(20, 1): MISSED})
    assert statuses(done, 20) == [OK, MISSED, OK]
    ids = [[outcome.record.frame_id if outcome.record else None for outcome in tag.outcomes] for tag in done.closed]
    assert ids[19] == [20, 20, 20]
    assert ids[21] == [22, 21, 22]


def test_a_hole_in_the_ids_is_a_lost_frame() -> None:
    assert statuses(run(faults={(20, 0): LOST}), 20) == [LOST, OK, OK]


def test_a_damaged_frame_is_told_by_its_arrival_alone() -> None:
    """A buffer whose leader was lost carries id and time of its previous use; the simulation does likewise."""
    assert statuses(run(faults={(20, 0): DAMAGED}), 20) == [DAMAGED, OK, OK]


def test_good_frames_held_up_behind_a_damaged_one_stay_with_their_pulses() -> None:
    done = run(faults={(20, 0): DAMAGED}, retention_ns=100 * MS, hold_periods=5.0)
    assert statuses(done, 20) == [DAMAGED, OK, OK]
    assert sum(tag.complete for tag in done.closed) == 39


@pytest.mark.parametrize("fates", [(LOST, DAMAGED), (DAMAGED, LOST), (MISSED, DAMAGED), (DAMAGED, MISSED)])
def test_a_damaged_arrival_goes_to_the_pulse_that_it_fits_best(fates: tuple[FrameStatus, FrameStatus]) -> None:
    done = run(faults={(20, 0): fates[0], (21, 0): fates[1]}, latency_ns=(20 * MS, 24 * MS))
    assert (statuses(done, 20)[0], statuses(done, 21)[0]) == fates


def test_how_late_damaged_frames_come_is_learned() -> None:
    """Held back for three periods: told from the next pulses' only by experience."""
    experience = {(pulse, 0): DAMAGED for pulse in range(8, 200, 8)}
    ambiguous = {(210, 0): DAMAGED, (211, 0): MISSED, (212, 0): MISSED}
    done = run(
        pulses=230,
        faults=experience | ambiguous,
        latency_ns=(5 * MS, 9 * MS),
        retention_ns=3 * PERIOD,
        hold_periods=8.0,
    )
    assert [statuses(done, pulse)[0] for pulse in (210, 211, 212)] == [DAMAGED, MISSED, MISSED]


def test_a_lost_packet_on_firewire_costs_two_frames() -> None:
    """The shifted frame comes one period late, the next one vanishes."""
    faults = {(20, 0): DAMAGED, (21, 0): LOST}
    done = run(faults=faults, retention_ns=PERIOD, modulus=0)
    assert {statuses(done, 20)[0], statuses(done, 21)[0]} == {DAMAGED, LOST}


def test_several_causes_in_one_gap_are_right_in_number() -> None:
    done = run(faults={(20, 1): MISSED, (21, 1): LOST, (22, 1): LOST}, hold_periods=6.0)
    assert [statuses(done, pulse)[1] for pulse in (20, 21, 22)] == [LOST, LOST, MISSED]


@pytest.mark.parametrize("modulus", [65535, 0])
def test_ids_wrap_or_go_on(modulus: int) -> None:
    done = run(first_id=65520, modulus=modulus, faults={(15, 1): LOST, (16, 2): MISSED})
    assert statuses(done, 15) == [OK, LOST, OK]
    assert statuses(done, 16) == [OK, OK, MISSED]


def test_a_pulse_that_all_cameras_lost_has_a_tag() -> None:
    done = run(faults={(20, camera): LOST for camera in range(3)})
    tag = done.closed[20]
    assert [outcome.status for outcome in tag.outcomes] == [LOST] * 3
    assert tag.cargo is None
    assert abs(tag.time - done.hill.times[20]) < MS
    assert done.pairer.health()["proven_by_ids"] == 1


def test_a_pulse_that_only_one_camera_saw_and_lost_has_a_tag() -> None:
    done = run(faults={(20, 0): MISSED, (20, 1): LOST, (20, 2): MISSED})
    assert [outcome.status for outcome in done.closed[20].outcomes] == [MISSED, LOST, MISSED]


def test_many_pulses_that_all_cameras_lost_have_tags() -> None:
    faults = {(pulse, camera): LOST for pulse in range(10, 30) for camera in range(3)}
    done = run(faults=faults)
    assert len(done.closed) == 40
    assert all(outcome.status is LOST for tag in done.closed[10:30] for outcome in tag.outcomes)


def test_a_pulse_that_nobody_saw_is_not_invented() -> None:
    done = run(faults={(20, camera): MISSED for camera in range(3)})
    assert len(done.closed) == 39


@pytest.mark.parametrize("pause_s", [0.4, 1.0, 7.3123])
def test_a_pause_is_not_filled(pause_s: float) -> None:
    done = run(pauses={20: pause_s})
    assert [tag.complete for tag in done.closed] == [True] * 40
    assert done.silent == set()


def test_a_pause_right_after_a_lost_frame() -> None:
    done = run(pauses={20: 3.217}, faults={(19, 1): LOST, (20, 2): MISSED})
    assert statuses(done, 19) == [OK, LOST, OK]
    assert statuses(done, 20) == [OK, OK, MISSED]
    assert len(done.closed) == 40


def test_an_id_gone_wild_does_not_fill_a_pause() -> None:
    done = run(pauses={20: 60.0})
    feed = Feed()
    for pulse in range(3):
        feed.all_cameras(pulse, [pulse + 1] * 3)
    feed.all_cameras(1800, [4, 1000, 4])
    assert [tag.complete for tag in feed.closed] == [True] * 4
    assert feed.pairer.counters[1].unexplained == 996
    assert len(done.closed) == 40


def test_a_camera_that_falls_silent_is_told_and_not_waited_for() -> None:
    done = run(outages=(Outage(2, 0.5, 60.0, None),), pulses=60)
    assert done.silent == {2}
    assert done.pairer.silent() == (2,)
    assert {outcome.status for tag in done.closed[-30:] for outcome in tag.outcomes[2:]} == {ABSENT}
    assert all(tag.outcomes[0].status is OK for tag in done.closed)


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
        feed.advance(feed.time_of(pulse) + 5 * MS)
        # The tenth pulse, number 9, is the last one that it delivers: with number 12 it is three behind.
        assert feed.pairer.overdue() == ((1,) if 12 <= pulse <= 14 else ())
    assert [tag.outcomes[1].status for tag in feed.closed[10:15]] == [LOST] * 5


def test_no_camera_is_overdue_while_the_pulses_pause() -> None:
    feed = Feed()
    for pulse in [*range(10), *range(100, 110)]:
        for camera in range(3):
            feed.frame(camera, pulse, pulse + 1 if pulse < 10 else pulse - 89)
            assert feed.pairer.overdue() == ()
        feed.advance(feed.time_of(pulse) + 5 * MS)


def test_a_silent_camera_is_noticed_though_the_others_fail_in_between() -> None:
    done = run(outages=(Outage(2, 0.67, 60.0, None),), faults={(15, 0): MISSED, (15, 1): MISSED})
    first = next(pulse for pulse, fates in enumerate(done.hill.fates) if fates[2] is MISSED)
    assert first == 14
    assert statuses(done, 14) == [OK, OK, ABSENT]


def test_a_silent_camera_that_delivers_again_is_back() -> None:
    done = run(outages=(Outage(2, 0.5, 0.9, None),), pulses=60)
    assert done.silent == {2}
    assert done.pairer.silent() == ()
    assert all(tag.complete for tag in done.closed[-20:])
    assert done.pairer.counters[2].silences == 1


def test_a_camera_that_sends_only_damaged_frames_is_not_silent() -> None:
    done = run(faults={(pulse, 0): DAMAGED for pulse in range(10, 25)}, hold_periods=6.0)
    assert done.silent == set()
    assert [statuses(done, pulse)[0] for pulse in range(10, 25)] == [DAMAGED] * 15


def test_without_pulses_nobody_is_silent() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    assert feed.pairer.advance(HostNs(START + 3600 * NS_PER_S)) == []
    assert feed.pairer.next_deadline() is None
    assert feed.pairer.silent() == ()


def test_reconnection_with_another_clock_and_ids_from_1() -> None:
    done = run(outages=(Outage(1, 0.6, 1.1, 0.1),), pulses=60)
    times = done.hill.times
    away = [pulse for pulse, time in enumerate(times) if 0.6 <= (time - done.hill.start) / NS_PER_S < 1.1]
    assert [statuses(done, pulse) for pulse in away] == [[OK, ABSENT, OK]] * len(away)
    assert statuses(done, away[-1] + 1) == [OK, OK, OK]
    records = [outcome.record for tag in done.closed for outcome in tag.outcomes[1:2] if outcome.record]
    assert {record.epoch for record in records} == {1, 2}
    assert records[-1].frame_id == 60 - (away[-1] + 1)


def test_the_rate_may_be_off() -> None:
    for error in (-0.05, 0.05):
        done = run(rate_error=error, pulses=400, faults={(300, camera): LOST for camera in range(3)})
        assert len(done.closed) == 400
        assert done.pairer.health()["period_us"] == pytest.approx(1e6 / 30 * (1 + error), rel=1e-3)


def test_between_latches_the_frames_keep_the_clocks_together() -> None:
    """90 s without a latch: the clocks drift 18 ms apart, the tolerance is 10 ms."""
    done = run(pulses=2700, drift_ppm=(100.0, 0.0, -100.0), latch_every_s=1e6)
    assert all(tag.complete for tag in done.closed)
    assert done.pairer.health()["spread_max_us"] < 1000


def test_the_recorder_stalls_and_then_takes_camera_after_camera() -> None:
    done = run(batch_ns=700 * MS, rate_hz=200.0, pulses=600, lost=0.05)
    assert done.unplaced == []


def test_trigger_counts_tell_overruns() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1], triggers=[1, 1, 1])
    feed.all_cameras(1, [2, None, 2], triggers=[2, 0, 2])
    feed.all_cameras(2, [3, 2, 3], triggers=[3, 3, 3])
    assert [outcome.status for outcome in feed.closed[1].outcomes] == [OK, MISSED, OK]
    assert [counters.overruns for counters in feed.pairer.counters] == [0, 1, 0]


# -- records by hand: what the simulation does not do ---------------------------------------------------------------


class Feed:
    """Three cameras on one clock, 30 Hz, and records made by hand."""

    def __init__(self, cameras: int = 3, *, latches: bool = True, hold_ns: int = HOLD) -> None:
        self.pairer = Pairer(cameras, PERIOD, hold_ns=hold_ns)
        self.cameras = cameras
        self.closed = self.pairer.advance(START)
        for camera in range(cameras):
            self.pairer.connected(camera, 1, START)
            if latches:
                self.latch(camera)

    @staticmethod
    def time_of(pulse: float) -> HostNs:
        return HostNs(START + NS_PER_S // 2 + round(pulse * PERIOD))

    def latch(self, camera: int, at: int = START, clock: int = 0) -> None:
        self.pairer.latch(camera, ClockLatch(DeviceNs(at - START + clock), HostNs(at), 50 * US))

    def frame(
        self, camera: int, pulse: float, frame_id: int, *, epoch: int = 1, clock: int = 0, after: int = 5 * MS,
        triggers: int = -1,
    ) -> bool:  # fmt: skip
        time = self.time_of(pulse)
        record = Record(
            RecordKind.FRAME, epoch, HostNs(time + after), 0, frame_id, 65535, DeviceNs(time - START + clock), triggers
        )
        return self.pairer.frame(camera, record) is not None

    def all_cameras(self, pulse: float, ids: list[int | None], triggers: list[int] | None = None) -> None:
        for camera, frame_id in enumerate(ids):
            if frame_id is not None:
                self.frame(camera, pulse, frame_id, triggers=triggers[camera] if triggers else -1)
        self.advance(self.time_of(pulse) + 6 * MS)

    def advance(self, now: int) -> None:
        self.closed += self.pairer.advance(HostNs(now))


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
    feed = Feed()
    feed.frame(0, 0, 1)
    feed.frame(1, 0, 1)
    assert feed.pairer.next_deadline() == feed.time_of(0) + HOLD
    feed.advance(feed.time_of(0) + HOLD)
    assert len(feed.closed) == 1
    assert not feed.frame(2, 0, 1, after=HOLD + MS)
    assert feed.pairer.counters[2].late == 1


def test_a_pulse_decided_too_early_is_counted_when_the_ids_contradict() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.all_cameras(1, [2, None, 2])
    feed.advance(feed.time_of(30))
    assert feed.closed[1].outcomes[1].status is LOST, "presumed"
    feed.all_cameras(31, [3, 2, 3])
    assert feed.pairer.counters[1].presumed == 1
    assert feed.pairer.counters[1].contradicted == 1


def test_a_damaged_arrival_outweighs_a_wrong_presumption() -> None:
    feed = Feed()
    feed.all_cameras(0, [1, 1, 1])
    feed.all_cameras(1, [2, None, 2])
    feed.advance(feed.time_of(30))
    feed.pairer.damaged(1, Record(RecordKind.DAMAGED, 1, HostNs(feed.time_of(31) + 5 * MS)))
    feed.all_cameras(31, [3, None, 3])
    feed.all_cameras(32, [4, 3, 4])
    assert [tag.outcomes[1].status for tag in feed.closed] == [OK, LOST, DAMAGED, OK]
    assert feed.pairer.counters[1].contradicted == 1


def test_with_a_short_hold_silence_is_noticed_from_what_was_decided_before() -> None:
    feed = Feed(hold_ns=PERIOD + 5 * MS)
    for pulse in range(8):
        feed.all_cameras(pulse, [pulse + 1, None if pulse >= 4 else pulse + 1, pulse + 1])
    assert feed.pairer.silent() == (1,)
    assert [tag.outcomes[1].status for tag in feed.closed] == [OK] * 4 + [LOST] + [ABSENT] * 3


def test_frames_that_others_may_still_deliver_prove_no_pulse_in_a_pause() -> None:
    """One camera lost two frames after a pause; the second one's pulse is not known yet when the first is decided."""
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
    assert feed.pairer.health()["proven_by_ids"] == 0


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
    for pulse in range(5, 8):  # its frames cannot be placed, so they are as good as damaged
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
    feed.pairer.damaged(0, Record(RecordKind.DAMAGED, 1, feed.time_of(1.5)))
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
    feed.pairer.damaged(0, Record(RecordKind.DAMAGED, 1, HostNs(feed.time_of(1) + 25 * MS)))
    feed.all_cameras(1, [None, 2, 2])
    feed.pairer.disconnected(0, feed.time_of(2.5))
    feed.all_cameras(2, [None, 3, 3])
    assert [tag.outcomes[0].status for tag in feed.closed] == [OK, DAMAGED, ABSENT]


def test_a_camera_that_was_never_there_is_absent_and_not_waited_for() -> None:
    pairer = Pairer(2, PERIOD, hold_ns=4 * PERIOD)
    pairer.connected(0, 1, START)
    pairer.latch(0, ClockLatch(DeviceNs(0), START, 50 * US))
    record = Record(RecordKind.FRAME, 1, HostNs(START + 30 * MS), 0, 1, 0, DeviceNs(20 * MS))
    assert pairer.frame(0, record) is not None
    (tag,) = pairer.advance(HostNs(START + 30 * MS))
    assert [outcome.status for outcome in tag.outcomes] == [OK, ABSENT]
    pairer.disconnected(1, START)  # a grabber that could not even connect says so; that changes nothing
    assert pairer.counters[1].outcomes[ABSENT] == 1


def test_one_camera_alone() -> None:
    feed = Feed(cameras=1)
    for pulse in range(5):
        if pulse != 3:
            feed.all_cameras(pulse, [pulse + 1])
    assert [tag.outcomes[0].status for tag in feed.closed] == [OK, OK, OK, LOST, OK]


def test_clocks_that_drift_apart_raise_the_alarm_long_before_pulses_mix() -> None:
    feed = Feed()
    for pulse in range(10):
        for camera in range(3):
            feed.frame(camera, pulse, pulse + 1, clock=9 * MS if camera == 2 else 0, after=20 * MS)
        feed.advance(feed.time_of(pulse) + 21 * MS)
    health = feed.pairer.health()
    assert health["alarm"]
    assert health["spread_max_us"] > 8000
    assert all(tag.complete for tag in feed.closed)


def test_frames_that_no_longer_find_each_other_raise_the_alarm() -> None:
    feed = Feed()
    for pulse in range(10):
        for camera in range(3):
            feed.frame(camera, pulse, pulse + 1, clock=-13 * MS if camera == 2 else 0)
        feed.advance(feed.time_of(pulse) + 6 * MS)
    assert feed.pairer.health()["alarm"]
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
