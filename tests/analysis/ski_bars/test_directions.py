"""The directions of skis are found from their bindings alone, through the pulses."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.identification.markers.markers import ANYWHERE_M
from analysis.identification.ski_bars import Bindings
from analysis.ski_bars.directions import Directions, seek_directions
from analysis.ski_bars.pixels import Legs
from rig.arrays import Floats
from tests.analysis.digitizing.following.tracked_hill import RATE_HZ, TrackedHill, hill
from tests.analysis.ski_bars.hill_views import views_of, with_bars
from tests.support.repeats import repeats

BINDING_M = 0.01
AXES = np.diag((1.0, 1.0, 1.0))  # the hill's X axis leads forward


@pytest.fixture(scope="module", params=repeats([21, 24, 27, 30]))
def of(request: pytest.FixtureRequest) -> TrackedHill:
    return hill(request.param)


def _sought(of: TrackedHill, pulses: list[int], *, empty: bool = False, bare: bool = False) -> Directions:
    """Of some pulses; `empty`: in images without a jumper, `bare`: the left binding wears no marker."""
    views = views_of(of, [30] * len(pulses) if empty else pulses)
    rng = np.random.default_rng(5)
    bindings = np.array([[of.truth[p]["points"][label] for label in ("P3", "P4")] for p in pulses])
    bindings = bindings + rng.normal(0, BINDING_M, bindings.shape)
    known = np.ones((len(pulses), 2), bool)
    covariance = np.tile(BINDING_M**2 * np.eye(3), (len(pulses), 2, 1, 1))
    if bare:
        bindings[:, 1], covariance[:, 1] = np.nan, ANYWHERE_M**2 * np.eye(3)
    places = Bindings(bindings, covariance).side_by_side(AXES)
    return seek_directions(views, places.xyz, places.covariance, known, np.array(pulses) / RATE_HZ, AXES)


def _off_deg(of: TrackedHill, pulses: list[int], found: Directions) -> Floats:
    true = np.array([[of.truth[p]["skis"][side]["direction"] for side in ("right", "left")] for p in pulses])
    cosine = np.clip((true * found.direction).sum(axis=-1), -1, 1)
    return np.asarray(np.degrees(np.arccos(cosine)))


def test_directions_are_found_to_some_degrees(of: TrackedHill) -> None:
    pulses = of.in_sight("P3")[::2]
    off = _off_deg(of, pulses, _sought(of, pulses))
    assert off.size >= 16
    assert np.median(off) < 2.5
    assert np.quantile(off, 0.9) < 8.0, "a fit finds most skis from there"
    assert off.max() < 16.0


def test_where_there_is_no_ski_less_speaks_for_one(of: TrackedHill) -> None:
    pulses = of.in_sight("P3")[::4]
    assert _sought(of, pulses).gain.mean() > 2 * _sought(of, pulses, empty=True).gain.mean()


def test_a_ski_without_a_marker_is_found_beside_the_other_one(of: TrackedHill) -> None:
    pulses = of.in_sight("P3")[::2]
    found = _sought(of, pulses, bare=True)
    off = _off_deg(of, pulses, found)
    assert np.median(off[:, 1]) < 6.0
    assert np.quantile(off[:, 1], 0.9) < 12.0, "twice as far as with its marker; a fit finds most from there"


def test_what_may_be_a_leg_is_no_ski(of: TrackedHill) -> None:
    """Dark bars are drawn into images without a jumper; where legs are known to lie there, they say nothing."""
    pulses = of.in_sight("P3")[::4]
    bindings = np.array([[of.truth[p]["points"][label] for label in ("P3", "P4")] for p in pulses])
    along = 1.3 * np.array((np.cos(0.3), 0.0, np.sin(0.3)))
    drawn = [
        [with_bars(view, [(foot - along, foot + along) for foot in feet]) for view in views]
        for views, feet in zip(views_of(of, [30] * len(pulses)), bindings, strict=True)
    ]
    legs = [np.array([(foot, foot + way) for foot in feet for way in (along, -along)]) for feet in bindings]
    told = [
        [replace(view, legs=Legs(ends, np.full((len(ends), 2), 0.05))) for view in views]
        for views, ends in zip(drawn, legs, strict=True)
    ]
    known, covariance = np.ones((len(pulses), 2), bool), np.tile(BINDING_M**2 * np.eye(3), (len(pulses), 2, 1, 1))
    like_skis, like_legs = (
        seek_directions(views, bindings, covariance, known, np.array(pulses) / RATE_HZ, AXES).gain
        for views in (drawn, told)
    )
    assert np.median(like_skis) > 20.0
    assert np.median(like_legs) < 5.0
