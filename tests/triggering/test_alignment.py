"""Two computers' pulses: joined only where the right offset is certain, and never at a wrong one."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from rig.errors import BadInputError
from triggering.alignment import Alignment, Train, align

START, PERIOD = 1_795_216_434_399_239_000, 1e9 / 30
EVEN = np.arange(600) * PERIOD
Pulses = NDArray[np.floating[Any]]


class Log:
    """What one computer records of pulses: its clock, its errors, from when to when it records."""

    def __init__(
        self, pulses: Pulses, offset_ms: float = 0.0, ppm: float = 0.0, *, unseen: float = 0.0, known_ms: float = -1.0,
        during_s: tuple[float, float] = (-1.0, 1e6), seed: int = 1,
    ) -> None:  # fmt: skip
        rng = np.random.default_rng(seed)
        begin, end = (max(pulses[0] - 1e9, during_s[0] * 1e9), min(pulses[-1] + 1e9, during_s[1] * 1e9))
        there = (pulses >= begin) & (pulses <= end) & (rng.random(len(pulses)) >= unseen)
        self.pulses = np.flatnonzero(there)
        shown = [round(self._shown(time, offset_ms, ppm)) for time in (*pulses[there], begin, end)]
        noise = rng.normal(0, 20e3, len(self.pulses)).round().astype(np.int64)
        self.train = Train(
            START + np.array(shown[:-2], np.int64) + noise, np.full(len(self.pulses), True), START + shown[-2],
            START + shown[-1], None if known_ms < 0 else known_ms * 1e6,
        )  # fmt: skip

    @staticmethod
    def _shown(time: float, offset_ms: float, ppm: float) -> float:
        return float(time * (1 + ppm * 1e-6) + offset_ms * 1e6)


def joined(one: Log, two: Log) -> Alignment:
    """The alignment; every pulse that both have must be joined with itself, but for one in a hundred."""
    found = align(one.train, two.train)
    both = found.pairs[(found.pairs >= 0).all(axis=1)]
    assert np.array_equal(one.pulses[both[:, 0]], two.pulses[both[:, 1]]), "never mixed"
    common = len(np.intersect1d(one.pulses, two.pulses))
    assert 0.99 * common <= found.common <= common
    assert sorted(found.pairs[found.pairs[:, 0] >= 0, 0]) == list(range(len(one.pulses)))
    assert sorted(found.pairs[found.pairs[:, 1] >= 0, 1]) == list(range(len(two.pulses)))
    return found


def by_hand(seed: int = 4, least: float = 0.3, most: float = 1.5, count: int = 80) -> Pulses:
    return np.asarray(np.cumsum(np.random.default_rng(seed).uniform(least, most, count)) * 1e9)


def without(*pauses: tuple[int, int]) -> Pulses:
    return np.array([time for pulse, time in enumerate(EVEN) if not any(a <= pulse < b for a, b in pauses)])


def test_even_pulses_are_joined_where_both_know_utc_to_less_than_half_a_period() -> None:
    one = Log(EVEN, known_ms=5.0, during_s=(-1, 14), unseen=0.01)
    two = Log(EVEN, offset_ms=-3.0, ppm=20.0, known_ms=5.0, during_s=(6, 30), unseen=0.01, seed=2)
    found = joined(one, two)
    assert abs(found.offset_ns - (3e6 - 20e-6 * 10e9)) < 20e3
    assert abs(found.drift_ppm + 20) < 3
    assert 5e3 < found.residual_ns < 60e3
    assert found.sigma_ns < 10e3


@pytest.mark.parametrize(
    ("first_ms", "second_ms"), [(-1.0, -1.0), (0.1, -1.0), (30.0, 10.0)], ids=["free", "one free", "too coarse"]
)
def test_even_pulses_are_refused_where_another_period_fits_as_well(first_ms: float, second_ms: float) -> None:
    one, two = Log(EVEN[:200], known_ms=first_ms), Log(EVEN[:200], offset_ms=4.0, known_ms=second_ms, seed=2)
    with pytest.raises(
        BadInputError, match=r"fit at more than one offset, .* NTP or PTP, or let the pulses pause twice"
    ):
        align(one.train, two.train)


@pytest.mark.parametrize(
    ("pulses", "unseen"),
    [
        (by_hand(), 0.05),
        (by_hand(5, 0.01, 0.05, 500), 0.005),
        (EVEN + np.random.default_rng(3).normal(0, 0.3e6, len(EVEN)), 0.0),
        (without((100, 130), (300, 360)), 0.005),
    ],
    ids=["hand", "random", "jitter", "two pauses"],
)
def test_uneven_pulses_tell_the_offset_by_themselves(pulses: Pulses, unseen: float) -> None:
    found = joined(Log(pulses), Log(pulses, offset_ms=-7e6, ppm=40.0, unseen=unseen, seed=2))
    assert abs(found.offset_ns - 7e12) < 2e6


@pytest.mark.parametrize(
    "during_s", [(1.0, 18.0), (-1.0, 21.0)], ids=["recorded meanwhile", "recorded before and after"]
)
def test_a_single_pause_is_proof_only_with_the_beginning_and_the_end_of_the_pulses(
    during_s: tuple[float, float],
) -> None:
    pulses = without((300, 330))
    one, two = Log(pulses, during_s=during_s), Log(pulses, offset_ms=1000.0, during_s=during_s, seed=2)
    if during_s[0] < 0:
        joined(one, two)
        return
    with pytest.raises(BadInputError, match="fit at more than one offset"):
        align(one.train, two.train)


@pytest.mark.parametrize(
    ("other", "text"),
    [
        (Log(EVEN, offset_ms=1e5, known_ms=5.0, seed=2), "fit at no offset within the 10 ms"),
        (Log(np.arange(600) * 1e9 / 50, known_ms=5.0, seed=2), "are not in the other, which was recording"),
        (Log(EVEN[:2], known_ms=5.0), "fewer than 3 pulses"),
    ],
    ids=["another day", "another rate", "no pulses"],
)
def test_other_pulses_are_refused(other: Log, text: str) -> None:
    with pytest.raises(BadInputError, match=text):
        align(Log(EVEN, known_ms=5.0).train, other.train)


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_mixed_whatever_the_pulses(seed: int) -> None:
    """Rates, jitter, pauses, overlaps, clocks and failures by lot: joined rightly or refused in words."""
    rng = np.random.default_rng(seed)
    uneven = 1 + rng.choice([0, 1e-4, 0.01, 0.3]) * rng.random(240)
    pulses = np.cumsum(1e9 / rng.choice([15, 30, 100]) * uneven)
    for _ in range(rng.integers(0, 4)):
        pulses[rng.integers(20, 220) :] += rng.uniform(0.05, 2) * 1e9
    length = pulses[-1] / 1e9
    known = float(rng.choice([-1.0, 2.0, 200.0]))
    offset = float(rng.uniform(-2, 2) if known > 0 else rng.uniform(-1e4, 1e4))
    one = Log(pulses, known_ms=known, unseen=0.01, during_s=(rng.uniform(-1, 0.5 * length), 1e6), seed=seed)
    two = Log(
        pulses, offset, float(rng.uniform(-50, 50)), known_ms=known, unseen=0.01,
        during_s=(-1, rng.uniform(0.6, 1.1) * length), seed=seed + 1000,
    )  # fmt: skip
    try:
        found = align(one.train, two.train)
    except BadInputError:
        return
    both = found.pairs[(found.pairs >= 0).all(axis=1)]
    assert np.array_equal(one.pulses[both[:, 0]], two.pulses[both[:, 1]])


def test_more_offsets_than_can_be_tried_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("triggering.alignment._OFFSETS_MOST", 10)
    with pytest.raises(BadInputError, match=r"could be the same at more than 10 offsets .* by NTP or PTP"):
        align(Log(EVEN[:100]).train, Log(EVEN[:100], seed=2).train)
