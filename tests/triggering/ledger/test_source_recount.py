"""What a log says by itself of the pulses that the source told of agrees with what the pairing counted live."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from rig.clocks import DecimalNs, UtcNs
from rig.health import DiskHealth, Health, Latency, PrerollHealth, SourcePairing, ToldPulses
from rig.tag import TripletTag
from rig.transport.recorder_commands import PulsesFired
from tests.triggering.feed import Feed
from tests.triggering.simulation import MS, US
from tests.triggering.tags import tags_of
from triggering.ledger.recount import Recount
from triggering.ledger.recounted import Recounted

PULSES = 300
#: Cameras expose so long after the edge of a pulse.
LATE = 2 * MS


@dataclass
class Log:
    """Tags and health records of a run, as the recorder writes them."""

    tags: list[TripletTag] = field(default_factory=list)
    healths: list[Health] = field(default_factory=list)

    @property
    def live(self) -> SourcePairing:
        source = self.healths[-1].pairing.source
        assert source is not None
        return source

    def recounted(self) -> Recounted:
        account = Recount()
        for tag in self.tags:
            account.add(tag)
        for health in self.healths:
            assert health.host_time_ns is not None
            account.reported(health, UtcNs(health.host_time_ns + 300 * US))
        return account.finish()


def run(told: Iterable[float], unseen: Iterable[int] = (), error_ns: int = 100 * US) -> Log:
    """Cameras see all pulses but those `unseen`; the source tells of `told` three times between two health records."""
    log, feed = Log(), Feed(reads=True, hold_ns=270 * MS)
    left, words, number, frame = sorted(told), [], 1, 1
    for pulse in range(PULSES):
        if pulse not in unseen:
            feed.all_cameras(pulse, [frame] * 3)
            frame += 1
        if pulse % 3 == 0:
            fired = [each for each in left if each <= pulse]
            left = left[len(fired) :]
            times = tuple(feed.time_of(each - LATE / (feed.time_of(1) - feed.time_of(0))) for each in fired)
            words.append(PulsesFired(first=number, times=times, uncertainty_ns=error_ns, until=feed.time_of(pulse)))
            for each, time in enumerate(times, number):
                feed.pairer.fired(each, time, error_ns)
            number += len(times)
            feed.pairer.fired_until(words[-1].until)
            feed.advance(feed.time_of(pulse) + 8 * MS)
        if pulse % 30 == 29:
            log.healths.append(_health(feed, pulse, words))
            words.clear()
    log.tags = tags_of(feed.closed)
    return log


def _health(feed: Feed, pulse: int, words: list[PulsesFired]) -> Health:
    return Health(
        cameras=(), pairing=feed.pairer.health(), free_triplets=0, unpublished=0,
        preroll=PrerollHealth(0, 0, 0, 0), recording=None, disk=DiskHealth(None), latency=Latency({}, 0, 0),
        host_time_ns=DecimalNs(feed.time_of(pulse) + 20 * MS), fired=tuple(word.told() for word in words),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("told", "unseen", "counts", "named"),
    [
        (range(PULSES), (), (0, 0, 0), []),
        (range(PULSES), (100, 101, 180), (3, 0, 0), []),
        ([n for n in range(PULSES) if n != 150], (), (0, 0, 1), ["pulse 151: the source did not fire it"]),
        (
            sorted([*range(PULSES), 150.4]), (), (0, 1, 0),
            ["the source fired a pulse about 13.3 ms after pulse 151 that has no tag"],
        ),
        (
            [n for n in range(PULSES) if n not in {120, 121}], (200,), (1, 0, 2),
            ["pulse 121: the source did not fire it", "pulse 122: the source did not fire it"],
        ),
    ],
    ids=["all is well", "the cable was out", "a pulse dropped", "a pulse doubled", "dropped and out"],
)  # fmt: skip
def test_the_recomputed_account_of_the_source_agrees_with_the_live_one(
    told: Iterable[float], unseen: tuple[int, ...], counts: tuple[int, int, int], named: list[str]
) -> None:
    log = run(told, unseen)
    assert (log.live.unseen, log.live.untagged, log.live.unfired) == counts
    found = log.recounted()
    assert found.source is not None
    assert found.source.fired > PULSES - 20
    assert (found.source.unseen, found.source.untagged, found.source.unfired) == counts
    assert list(found.in_words()) == named
    assert found.agrees == (not named)


def _without_a_tag(log: Log) -> None:
    del log.tags[150]


def _with_another_live_count(log: Log) -> None:
    last = log.healths[-1]
    log.healths[-1] = replace(last, pairing=replace(last.pairing, source=replace(log.live, unfired=4)))


@pytest.mark.parametrize(
    ("lie", "said"),
    [
        (_without_a_tag, ["the source fired a pulse about 33.3 ms after pulse 150 that has no tag",
                          "live, 0 pulses were counted as untagged, and by the log it is 1 to 1"]),
        (_with_another_live_count, ["live, 4 pulses were counted as unfired, and by the log it is 0 to 0"]),
    ],
)  # fmt: skip
def test_a_log_that_says_something_else_than_the_live_account_is_named(
    lie: Callable[[Log], None], said: list[str]
) -> None:
    log = run(range(PULSES))
    assert log.recounted().agrees
    lie(log)
    found = log.recounted()
    assert not found.agrees
    assert list(found.in_words()) == said


def test_times_that_are_too_uncertain_and_logs_without_them_prove_nothing() -> None:
    log = run(range(PULSES), error_ns=9 * MS)
    found = log.recounted()
    assert found.agrees
    assert found.source is not None
    assert found.source.fired == 0
    log.healths = [replace(health, host_time_ns=None, fired=None) for health in log.healths]
    old = Recount()
    for tag in log.tags:
        old.add(tag)
    for health in log.healths:
        old.reported(health, UtcNs(1))
    assert old.finish().source is None


_TIMES = st.one_of(st.integers(0, 10**10), st.integers(-(10**20) + 1, 10**20 - 1))


@settings(max_examples=60)
@example([(1, [5, 10**19, 6], 10**19)], 10**19)
@given(st.lists(st.tuples(st.integers(-(10**20), 10**20), st.lists(_TIMES, max_size=6), _TIMES), max_size=6), _TIMES)
def test_whatever_a_log_says_of_the_source_is_judged(words: list[tuple[int, list[int], int]], now: int) -> None:
    """Damaged and hostile logs hold words that no recorder wrote."""
    log = run([], error_ns=0)
    told = tuple(
        ToldPulses(first, tuple(DecimalNs(time) for time in times), 1.0, DecimalNs(until))
        for first, times, until in words
    )
    log.healths = [replace(health, fired=told, host_time_ns=DecimalNs(now)) for health in log.healths]
    assert all(log.recounted().in_words())
