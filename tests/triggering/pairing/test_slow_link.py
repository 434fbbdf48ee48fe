"""Frames that come too late: the camera took them, so they are lost, and the camera is slow, not absent or silent."""

import pytest

from rig.clocks import HostNs
from rig.frame import FrameStatus
from tests.triggering.feed import PERIOD
from tests.triggering.oracle import ABSENT, LOST, OK
from tests.triggering.pairing.test_records import running_train
from tests.triggering.simulation import MS


class SlowLink:
    """Camera 1 of a feed sends through a link that needs `frame_ms` for a frame; pulses come every 33 ms."""

    def __init__(self, frame_ms: float, *, since: int, until: int) -> None:
        self.feed = running_train(since)
        self.arrivals: list[tuple[int, int]] = []
        free = 0
        for pulse in range(since, until):
            free = max(free, self.feed.time_of(pulse)) + round(frame_ms * MS)
            self.arrivals.append((free, pulse))
        self.slow: set[int] = set()
        self.silent: set[int] = set()

    def run(self, pulses: range) -> None:
        for pulse in pulses:
            now = self.feed.time_of(pulse) + 6 * MS
            while self.arrivals and self.arrivals[0][0] <= now:
                arrival, late = self.arrivals.pop(0)
                self.feed.frame(1, late, late + 1, after=arrival - self.feed.time_of(late))
                self.step(arrival)
            self.feed.all_cameras(pulse, [pulse + 1, None if self.arrivals else pulse + 1, pulse + 1])
            self.step(now)

    def step(self, now: int) -> None:
        self.feed.advance(now)
        self.slow |= set(self.feed.pairer.slow(HostNs(now)))
        self.silent |= set(self.feed.pairer.silent())

    def fates(self) -> list[FrameStatus]:
        return [pulse.outcomes[1].status for pulse in self.feed.closed]


@pytest.mark.parametrize("frame_ms", [60, 80, 150, 240, 450, 900])
def test_frames_that_come_too_late_are_lost_not_absent(frame_ms: float) -> None:
    link = SlowLink(frame_ms, since=20, until=80)
    link.run(range(20, 200))
    fates = link.fates()
    assert fates[:20] == [OK] * 20
    # Before the first late frame comes nobody can know of it: nothing comes, as from a camera that is silent.
    first = 20 + (0 if frame_ms < 140 else 1 + round(frame_ms * MS / PERIOD))
    assert set(fates[first:80]) <= {OK, LOST}
    assert frame_ms > 140 or link.silent == set()
    assert link.feed.pairer.counters[1].late > 5
    assert link.slow == {1}


def test_when_the_link_is_quick_again_the_camera_is_as_before() -> None:
    link = SlowLink(60, since=20, until=80)
    link.run(range(20, 260))
    assert set(link.fates()[170:]) == {OK}
    assert link.feed.pairer.slow(link.feed.time_of(260)) == ()
    assert link.feed.pairer.health().unwatched == 0


def test_what_came_too_late_proves_no_pulses_in_a_pause_that_follows() -> None:
    link = SlowLink(100, since=20, until=60)
    link.run(range(20, 60))
    for arrival, late in link.arrivals[:25]:
        link.feed.frame(1, late, late + 1, after=arrival - link.feed.time_of(late))
        link.feed.advance(arrival)
    link.feed.all_cameras(400, [61, 61, 61])
    link.feed.advance(link.feed.time_of(420))
    assert len(link.feed.closed) == 61


def test_a_camera_that_was_slow_and_then_sends_nothing_is_silent() -> None:
    link = SlowLink(80, since=20, until=50)
    link.run(range(20, 48))
    link.arrivals = [(1 << 62, 0)]
    link.run(range(48, 140))
    assert link.silent == {1}
    assert set(link.fates()[100:]) == {ABSENT}


def test_one_late_frame_makes_no_slow_camera() -> None:
    feed = running_train()
    feed.all_cameras(10, [11, None, 11])
    feed.frame(1, 10, 11, after=45 * MS)
    for pulse in range(11, 20):
        feed.all_cameras(pulse, [pulse + 1] * 3)
    assert feed.pairer.slow(feed.time_of(20)) == ()
    assert {outcome.status for pulse in feed.closed for outcome in pulse.outcomes} == {OK}
