"""A source that tells of its pulses is a further witness: each of them has one tag, whatever the cameras saw of it."""

import random
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.clocks import HostNs
from rig.frame import FrameStatus
from tests.triggering.feed import PERIOD, Feed
from tests.triggering.oracle import ABSENT, MISSED, OK, check_no_pulse_is_mixed
from tests.triggering.simulation import MS, Hill, Run, Scenario
from triggering.alarms.momentary import momentary

SETTINGS = settings(max_examples=12)
EVERY = 100 * MS


@dataclass
class Sourced(Run):
    """A run in which the source tells ten times a second of the pulses it has fired, also before the cameras are there.

    Attributes:
        late_ns: cameras expose so long after the edge of the pulse.
        error_ns: largest error of the source's times.
        untold: pulses of which it does not tell; their numbers are left out.
        mute_from: from this pulse on it says nothing any more.
    """

    late_ns: int = 0
    error_ns: int = 200_000
    untold: range = range(0)
    mute_from: int = 10**9
    _told: int = field(default=0, init=False)
    _ticks: int = field(default=0, init=False)

    def pass_deadlines(self, until: HostNs | None) -> None:
        last = HostNs(self.hill.times[-1] + 20 * EVERY)
        while (tick := self._next_tick) < (last if until is None else min(until, last)):
            super().pass_deadlines(tick)
            self.advance(tick)
        super().pass_deadlines(until)

    def advance(self, now: HostNs) -> None:
        while (tick := self._next_tick) <= now and tick < self.hill.times[-1] + 30 * EVERY:
            self._ticks += 1
            self._tell(tick)
        super().advance(now)

    @property
    def _next_tick(self) -> HostNs:
        return HostNs(self.hill.start + (self._ticks + 1) * EVERY)

    def _tell(self, now: HostNs) -> None:
        if self._told >= self.mute_from:
            return
        chance = random.Random(self._told)
        if self._ticks == 1:
            for pulse in range(-3, 0):
                time = self.hill.start + pulse * self.hill.scenario.period_ns - self.late_ns
                self.pairer.fired(pulse, HostNs(time), self.error_ns)
        while self._told < len(self.hill.times) and self.hill.times[self._told] - self.late_ns < now:
            pulse, self._told = self._told, self._told + 1
            if pulse not in self.untold:
                time = self.hill.times[pulse] - self.late_ns + chance.randint(-self.error_ns, self.error_ns)
                self.pairer.fired(pulse, HostNs(time), self.error_ns)
        if self._told - 1 not in self.untold:
            self.pairer.fired_until(HostNs(now - self.error_ns))


def true_pulses(run: Run) -> list[int]:
    """The true pulse of each tag: by its frames, or by its time where it has none."""
    times, pulses = run.hill.times, []
    for closed, delivered in zip(run.closed, check_no_pulse_is_mixed(run), strict=True):
        nearest = min(range(len(times)), key=lambda pulse: abs(times[pulse] - closed.time))
        assert abs(times[nearest] - closed.time) < run.hill.scenario.period_ns / 2, "a pulse was invented"
        assert delivered in {None, nearest}
        pulses.append(nearest)
    return pulses


common = {
    "seed": st.integers(0, 2**32),
    "pulses": st.just(120),
    "rate_hz": st.sampled_from([10.0, 29.97, 100.0]),
    "rate_error": st.sampled_from([0.0, -3e-4]),
    "jitter_ns": st.integers(0, MS // 2),
    "missed": st.sampled_from([0.0, 0.1, 0.4]),
    "lost": st.sampled_from([0.0, 0.05]),
    "damaged": st.sampled_from([0.0, 0.03]),
    "hold_periods": st.just(9.0),
    "batch_ns": st.sampled_from([0, 3 * MS]),
    "latch_every_s": st.just(0.25),
}


@SETTINGS
@given(
    st.builds(Scenario, **common),
    st.sampled_from([-0.2, 0.0, 0.1, 0.3]),
    st.dictionaries(st.integers(20, 110), st.floats(1.3, 60.0), max_size=2),
    st.tuples(st.integers(10, 100), st.sampled_from([0, 1, 9])),
)
def test_every_pulse_has_one_tag(
    scenario: Scenario, late: float, pauses: dict[int, float], unplugged: tuple[int, int]
) -> None:
    """Pulses reach none of the cameras for a while, besides those that single cameras miss."""
    for pulse, periods in pauses.items():
        scenario.pauses[pulse] = periods * scenario.period_ns / 1e9
    first, count = unplugged
    scenario.faults.update({(pulse, camera): MISSED for pulse in range(first, first + count) for camera in range(3)})
    run = Sourced(Hill(scenario), late_ns=round(late * scenario.period_ns))
    pulses = true_pulses(run)
    assert pulses == list(range(pulses[0], scenario.pulses))
    assert all(fates.count(OK) == 0 for fates in run.hill.fates[: pulses[0]])
    source = run.pairer.health().source
    assert source is not None
    assert (source.fired, source.untagged, source.unfired) == (scenario.pulses + 3, 0, 0)
    for camera in set(range(3)) - run.silent:
        check_causes(run, pulses, camera)


def check_causes(run: Run, pulses: list[int], camera: int) -> None:
    """Between two frames of a camera so many pulses are missed, lost and damaged as in truth."""
    if run.pairer.counters[camera].presumed:
        return  # decided at the deadline, before the camera's next frame
    decided = [closed.outcomes[camera].status for closed in run.closed]
    truth = [run.hill.fates[pulse][camera] for pulse in pulses]
    ends = [index for index, status in enumerate(decided) if status is OK]
    assert ends == [index for index, status in enumerate(truth) if status is OK]
    for begin, end in pairwise(ends):
        assert Counter(decided[begin:end]) == Counter(truth[begin:end])


@SETTINGS
@given(st.builds(Scenario, **common), st.tuples(st.integers(5, 60), st.integers(1, 50)), st.integers(30, 10**4))
def test_a_source_that_falls_silent_or_begins_anew_mixes_and_invents_nothing(
    scenario: Scenario, untold: tuple[int, int], mute_from: int
) -> None:
    first, count = untold
    run = Sourced(Hill(scenario), untold=range(first, first + count), mute_from=mute_from)
    pulses = true_pulses(run)
    assert pulses == sorted(set(pulses))
    came = {pulse for pulse, fates in enumerate(run.hill.fates) if OK in fates}
    assert run.silent or came <= set(pulses)
    source = run.pairer.health().source
    assert source is None or source.unfired == 0


def _trained() -> Feed:
    """Twenty pulses that cameras and source tell of."""
    feed = Feed(reads=True, hold_ns=270 * MS)
    for pulse in range(20):
        feed.pairer.fired(pulse, feed.time_of(pulse), 100_000)
        feed.pairer.fired_until(feed.time_of(pulse))
        feed.all_cameras(pulse, [pulse + 1] * 3)
    return feed


def _codes(feed: Feed) -> list[str]:
    return [alarm.said.code for alarm in momentary(feed.pairer.health(), ["K1", "K2", "K3"], 30.0)]


def test_while_the_cable_is_off_pulses_are_missed_in_all_cameras_and_none_is_thought_dead() -> None:
    feed = _trained()
    for pulse in range(20, 80):
        feed.pairer.fired(pulse, feed.time_of(pulse), 100_000)
        feed.pairer.fired_until(feed.time_of(pulse))
        if pulse % 7 == 0:
            for camera in range(3):
                feed.latch(camera, feed.time_of(pulse))
        feed.advance(feed.time_of(pulse) + MS)
        assert feed.pairer.silent() == feed.pairer.overdue(feed.time_of(pulse)) == ()
    assert len(feed.closed) > 55
    assert {outcome.status for closed in feed.closed[20:] for outcome in closed.outcomes} == {MISSED}
    assert _codes(feed) == ["pairing_unseen"]


@pytest.mark.parametrize("told_gone", [110, 400])
def test_while_no_camera_has_power_the_pulses_of_the_source_and_no_others_are_absent(told_gone: int) -> None:
    """The source pauses in between, which the rhythm tells nothing of; the cameras are found to be gone late."""
    feed = _trained()
    fired = [pulse for pulse in range(20, 300) if not 150 <= pulse < 200]
    for pulse in range(20, 420):
        if pulse in fired:
            feed.pairer.fired(20 + fired.index(pulse), feed.time_of(pulse), 100_000)
        feed.pairer.fired_until(feed.time_of(pulse))
        if pulse == told_gone:
            for camera in range(3):
                feed.pairer.disconnected(camera, feed.time_of(pulse))
        feed.advance(feed.time_of(pulse) + MS)
    assert feed.pairer.counters[0].silences == (told_gone > 300)
    for camera in range(3):
        feed.pairer.connected(camera, 2, feed.time_of(420))
        feed.latch(camera, feed.time_of(421), clock=10**12)
    for pulse in range(440, 460):
        feed.pairer.fired(pulse - 170, feed.time_of(pulse), 100_000)
        feed.pairer.fired_until(feed.time_of(pulse))
        for camera in range(3):
            feed.frame(camera, pulse, pulse - 439, epoch=2, clock=10**12)
        feed.advance(feed.time_of(pulse) + 6 * MS)
    times = [feed.time_of(pulse) for pulse in (*range(20), *fired, *range(440, 460))]
    assert len(feed.closed) == len(times)
    assert all(abs(closed.time - time) < MS for closed, time in zip(feed.closed, times, strict=True))
    fates = [{outcome.status for outcome in closed.outcomes} for closed in feed.closed]
    assert fates == [{OK}] * 20 + [{ABSENT}] * len(fired) + [{OK}] * 20
    source = feed.pairer.health().source
    assert source is not None
    assert (source.unseen, source.untagged, source.unfired) == (0, 0, 0)
    assert feed.pairer.health().unwatched == 0


def test_a_source_that_falls_silent_too_leaves_the_rhythm() -> None:
    feed = _trained()
    for camera in range(3):
        feed.pairer.disconnected(camera, feed.time_of(20.5))
    feed.advance(feed.time_of(45))
    assert len(feed.closed) == 20, "the source may still tell"
    feed.advance(feed.time_of(80))
    assert {outcome.status for closed in feed.closed[20:] for outcome in closed.outcomes} == {ABSENT}
    assert len(feed.closed) > 60


def test_a_pulse_that_the_source_did_not_fire_is_kept_and_told() -> None:
    feed = _trained()
    assert _codes(feed) == []
    feed.all_cameras(20, [21] * 3)  # the source stands still, but says so
    feed.pairer.fired_until(feed.time_of(25))
    assert len(feed.closed) == 21
    assert _codes(feed) == ["pairing_unfired"]


def test_a_single_pulse_of_uncertain_time_is_not_one_that_the_source_did_not_fire() -> None:
    feed = _trained()
    for pulse in range(20, 25):
        feed.pairer.fired(pulse, feed.time_of(pulse), PERIOD if pulse == 21 else 100_000)
        feed.pairer.fired_until(feed.time_of(pulse))
        feed.all_cameras(pulse, [pulse + 1] * 3)
    source = feed.pairer.health().source
    assert source is not None
    assert (source.fired, source.unseen, source.untagged, source.unfired) == (25, 0, 0, 0)


def test_a_first_time_that_is_wrong_does_not_shift_the_pulses_that_no_camera_saw() -> None:
    """A busy computer was interrupted between setting the line and reading its clock."""
    feed = Feed(reads=True, hold_ns=270 * MS)
    for pulse in range(40):
        late_ns = PERIOD // 5 if pulse == 0 else 0
        feed.pairer.fired(pulse, HostNs(feed.time_of(pulse) + late_ns), late_ns or 100_000)
        feed.pairer.fired_until(feed.time_of(pulse))
        if pulse == 10:
            continue
        feed.all_cameras(pulse, [pulse + 1 - (pulse > 10)] * 3)
    assert {outcome.status for outcome in feed.closed[10].outcomes} == {MISSED}
    assert abs(feed.closed[10].time - feed.time_of(10)) < MS


@pytest.mark.parametrize(("error_ns", "tagged"), [(PERIOD // 5, 1), (PERIOD // 3, 0)])
def test_a_source_whose_times_are_too_uncertain_proves_nothing(error_ns: int, tagged: int) -> None:
    feed = _trained()
    for pulse in range(20, 23):
        feed.pairer.fired(pulse, feed.time_of(pulse), error_ns)
        feed.pairer.fired_until(feed.time_of(pulse))
    feed.all_cameras(20, [21] * 3)
    feed.all_cameras(22, [22] * 3)
    feed.advance(feed.time_of(40))
    assert sum(all(o.status is MISSED for o in closed.outcomes) for closed in feed.closed) == tagged
    assert not any(o.status is ABSENT for closed in feed.closed for o in closed.outcomes)
    assert {o.status for o in feed.closed[-1].outcomes} == {FrameStatus.OK}
