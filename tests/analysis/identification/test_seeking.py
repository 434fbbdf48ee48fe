"""A jumper is sought in the candidates of the last moments, as a live stream brings them."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from analysis.candidates.finder import Finder
from analysis.candidates.model import PulseCandidates
from analysis.identification import identify as identification
from analysis.identification import seeking
from analysis.identification.identify import Sighting, find_sightings, identify, sighted
from analysis.identification.over_time.flights import Flight
from analysis.identification.seeking import Seeker
from analysis.identification.ski_bars import MeasuredSkis
from rig.arrays import Flags
from tests.analysis.identification.cluttered import Disturbed, scene
from tests.analysis.simulated import RATE_HZ, true_cameras, true_jump

_EVERY, _LAST = 3, 15  # pulses: from one search to the next, and that are searched


def _found(candidates: Sequence[PulseCandidates], *, afresh: bool = False) -> list[range | None]:
    """The pulses of the jumper who is found in each search; with or without what the last ones told."""
    system = true_cameras()
    found: list[range | None] = []
    seeker = Seeker(system, {})
    for end in range(_EVERY, len(candidates) + 1, _EVERY):
        jump = (Seeker(system, {}) if afresh else seeker).seek(candidates[max(0, end - _LAST) : end], RATE_HZ)
        found.append(None if jump is None else range(jump.pulses[0].pulse, jump.pulses[-1].pulse + 1))
    return found


def test_a_jumper_is_found_as_soon_as_by_a_search_of_everything() -> None:
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(1), range(15, 36), Disturbed(20))
    found = _found(made.candidates)
    assert found == _found(made.candidates, afresh=True)
    first = next(i for i, seen in enumerate(found) if seen is not None)
    assert all(found[first:])
    assert identify(made.candidates[: first * _EVERY], true_cameras(), RATE_HZ) == []


def test_what_was_nobody_is_not_looked_at_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """One spot that moves like a jumper for a moment is none."""
    never = tuple((label, None, 0, 999) for label in ("P2", "P3", "P4"))
    hidden = Disturbed(false_spots=10, hidden=(("P1", None, 32, 999), *never))
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(3), range(20, 50), hidden)
    looks: list[Flight] = []

    def counted(*args: Any, **options: Any) -> Sighting:
        looks.append(args[3])
        return sighted(*args, **options)

    monkeypatch.setattr(seeking, "sighted", counted)
    assert not any(_found(made.candidates, afresh=True))
    assert len(looks) > 4
    looks.clear()
    assert not any(_found(made.candidates))
    assert 0 < len({flight.end_s for flight in looks}) == len(looks)


def test_who_shows_no_more_markers_than_are_known_is_not_found() -> None:
    hidden = Disturbed(hidden=(("P4", None, 0, 999),))
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(1), range(25, 45), hidden)
    assert Seeker(true_cameras(), {}).seek(made.candidates, RATE_HZ, more_than=2) is not None
    assert Seeker(true_cameras(), {}).seek(made.candidates, RATE_HZ, more_than=3) is None


def test_in_a_hurry_skis_are_sought_in_the_last_moments_only(monkeypatch: pytest.MonkeyPatch) -> None:
    made = scene([true_jump(7)], true_cameras(), np.random.default_rng(1), range(25, 45))
    (sighting,) = find_sightings(made.candidates, true_cameras(), RATE_HZ)
    sought: list[Flags] = []

    def noted(*given: Any) -> list[MeasuredSkis]:
        sought.append(given[-1])
        return [{}] * len(made.candidates)

    monkeypatch.setattr(identification, "measure_skis", noted)
    sighting.measured(Finder({}))
    sighting.measured(Finder({}), briefly=True)
    assert sought[0].all()
    assert np.flatnonzero(sought[1]).tolist() == list(range(len(made.candidates)))[-5:]
