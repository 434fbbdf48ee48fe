"""One example for each trap that real cameras have shown, with simulated cameras."""

from dataclasses import replace

import pytest

from rig.clocks import NS_PER_S
from rig.frame import FrameStatus
from tests.triggering.feed import PERIOD
from tests.triggering.oracle import ABSENT, DAMAGED, LOST, MISSED, OK, check, check_no_pulse_is_mixed
from tests.triggering.simulation import MS, Hill, Outage, Run, Scenario


def run(**scenario: object) -> Run:
    """A run that keeps the rules of `oracle`."""
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
    assert not done.pairer.health().alarm


def test_one_camera_misses_the_very_first_pulse() -> None:
    """Counting from the first frame after arming would pair every frame with the wrong pulse."""
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
    """A buffer whose leader was lost has id and time of its previous use, in the simulation too."""
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
    """Held back for three periods, they cannot be told from those of the next pulses until the delay is learned."""
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
    assert done.pairer.health().proven_by_ids == 1


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


def test_a_camera_that_falls_silent_is_told_and_not_waited_for() -> None:
    done = run(outages=(Outage(2, 0.5, 60.0, None),), pulses=60)
    assert done.silent == {2}
    assert done.pairer.silent() == (2,)
    assert {outcome.status for tag in done.closed[-30:] for outcome in tag.outcomes[2:]} == {ABSENT}
    assert all(tag.outcomes[0].status is OK for tag in done.closed)


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
        assert done.pairer.health().period_us == pytest.approx(1e6 / 30 * (1 + error), rel=1e-3)


def test_between_latches_the_frames_keep_the_clocks_together() -> None:
    """90 s without a latch: the clocks drift 18 ms apart, the tolerance is 10 ms."""
    done = run(pulses=2700, drift_ppm=(100.0, 0.0, -100.0), latch_every_s=None)
    assert all(tag.complete for tag in done.closed)
    assert done.pairer.health().spread_max_us < 1000


def test_the_recorder_stalls_and_then_takes_camera_after_camera() -> None:
    done = run(batch_ns=700 * MS, rate_hz=200.0, pulses=600, lost=0.05)
    assert done.unplaced == []


@pytest.mark.parametrize("rate_hz", [30.0, 100.0, 200.0])
def test_frames_that_are_only_on_their_way_make_no_camera_overdue(rate_hz: float) -> None:
    """At 200 Hz three pulses are 15 ms: less than the transport of one frame."""
    done = run(rate_hz=rate_hz, pulses=600, damaged=0.01, hold_periods=20.0)
    assert done.overdue == set()
