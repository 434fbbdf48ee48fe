"""Both skis are found from about where the feet are, without any binding."""

import numpy as np
import pytest

from analysis.identification.space.body import BINDINGS, usual_difference
from analysis.ski_bars.pairs import Feet, Pairs, seek_pairs
from tests.analysis.digitizing.following.tracked_hill import RATE_HZ, TrackedHill, hill
from tests.analysis.ski_bars.hill_views import views_of
from tests.support.repeats import repeats

AXES = np.eye(3)  # the hill's X axis leads forward
FEET_M = np.array((0.25, 0.15, 0.15))  #: standard deviations of where helmet and hip tell the feet


def _true(of: TrackedHill, pulses: list[int], label: str) -> np.ndarray:
    return np.array([of.truth[pulse]["points"][label] for pulse in pulses])


def _sought(of: TrackedHill, pulses: list[int], off_m: np.ndarray, *, empty: bool = False) -> Pairs:
    feet = (_true(of, pulses, "P3") + _true(of, pulses, "P4")) / 2 + off_m
    apart, sigma = usual_difference(*BINDINGS)
    covariance = np.tile(np.diag(FEET_M**2), (len(pulses), 1, 1))
    views = views_of(of, [30] * len(pulses) if empty else pulses)
    return seek_pairs(views, Feet(feet, covariance, apart, sigma), np.array(pulses) / RATE_HZ, AXES)


@pytest.mark.parametrize(
    ("seed", "off_m"), repeats([(21, (0.2, -0.1, 0.2)), (24, (-0.3, 0.1, 0.1)), (27, (0.1, 0.2, -0.25))])
)
def test_both_skis_are_found_from_about_where_the_feet_are(seed: int, off_m: tuple[float, float, float]) -> None:
    of = hill(seed)
    pulses = of.in_sight("P3")[::3]
    found = _sought(of, pulses, np.array(off_m))
    for k, (side, label) in enumerate((("right", "P3"), ("left", "P4"))):
        true = np.array([of.truth[pulse]["skis"][side]["direction"] for pulse in pulses])
        turned = np.degrees(np.arccos(np.clip((true * found.direction[:, k]).sum(axis=1), -1, 1)))
        off = found.point[:, k] - _true(of, pulses, label)
        assert np.median(turned) < 15.0, "a fit begins there"
        assert np.median(np.abs(off[:, 2])) < 0.2
        assert np.median(np.abs(off[:, 1])) < 0.4, "cameras beside the hill tell this least"


def test_where_nobody_jumps_less_speaks_for_skis() -> None:
    of = hill(21)
    pulses = of.in_sight("P3")[::8]
    there, empty = (_sought(of, pulses, np.zeros(3), empty=nobody).gain.sum(axis=1) for nobody in (False, True))
    assert np.median(there) > 2 * np.median(empty)
