"""Pulses at whole multiples of the period in PTP time, and cameras that do not share this time."""

import random
from itertools import pairwise

from rig.clocks import HostNs
from triggering.sources.ptp_time import PtpTime, ScheduledTrain

MS = 1_000_000
S = 1_000_000_000
PERIOD = 33_333_333
UTC = 1_795_216_434_399_239_123


def test_each_command_is_sent_once_and_with_at_least_half_its_lead_left() -> None:
    chance, ptp, train = random.Random(1), PtpTime(UTC), ScheduledTrain(PERIOD, 10 * MS, 5 * MS)
    now, sent = HostNs(5 * S), list[int]()
    for _ in range(400):
        if (time := train.due(now, ptp)) is not None:
            assert 5 * MS <= time - ptp.at(now) <= 10 * MS
            sent.append(time)
        wait = train.until_next_ns(now, ptp)
        assert 0 <= wait < PERIOD
        now = HostNs(now + wait + round(chance.expovariate(1 / (3 * MS))))  # some come too late to be sent
    assert all(time % PERIOD == 0 for time in sent)
    pulses = [time // PERIOD for time in sent]
    assert pulses == sorted(set(pulses))
    assert 0.6 < len(pulses) / (pulses[-1] - pulses[0] + 1) < 0.95


def test_two_computers_choose_the_same_times() -> None:
    """Each reads the cameras' clocks with an error of its own."""
    times = []
    for error in (0, 180_000):
        ptp, train = PtpTime(UTC + error), ScheduledTrain(PERIOD, 10 * MS, 5 * MS)
        found, now = list[int](), HostNs(7 * S)
        while len(found) < 30:
            if (time := train.due(now, ptp)) is not None:
                found.append(time)
            now = HostNs(now + MS)
        times.append(found)
    assert times[0] == times[1]


def test_pulses_go_on_after_ptp_time_was_set_back_and_none_comes_twice_while_its_reading_trembles() -> None:
    train, now, sent = ScheduledTrain(PERIOD, 10 * MS, 5 * MS), HostNs(0), list[int]()
    for step in range(4000):
        now = HostNs(now + MS)
        away = (-37 * S if step > 2000 else 0) + (150_000 if step % 2 else 0)
        if (time := train.due(now, PtpTime(UTC + away))) is not None:
            sent.append(time)
    assert len(sent) == len(set(sent))
    assert 118 <= len(sent) <= 121
    assert sum(later < earlier for earlier, later in pairwise(sent)) == 1


def test_a_camera_whose_clock_shows_another_time_is_named() -> None:
    ptp = PtpTime.of([UTC, None, UTC + 37 * S, UTC + 200_000])
    assert ptp is not None
    assert (ptp.offset_ns, ptp.astray) == (UTC + 200_000, ((2, 37 * S - 200_000),))
    (said,) = ptp.words(["K1", "K2", "K3", "K4"])
    assert str(said).startswith("the PTP clock of K3 is 37.0 s off those of the others")
    assert PtpTime.of([None, None]) is None
