"""Two groups of jumps: what is better than chance, and how often chance is taken for more."""

import numpy as np
import pytest

from analysis.comparison.aligned import MeasuredJump, measured_jump
from analysis.comparison.alignment import align
from analysis.comparison.difference import difference
from analysis.comparison.groups import group_difference
from analysis.result.model import QUANTITIES
from rig.arrays import Floats
from tests.analysis.result.recordings import calibration_error, recording

FEW = 400
ALPHA = QUANTITIES.index("alpha")


def jump(seed: int, leg_deg: float = 0.0, error: Floats | None = None, source: str = "one") -> MeasuredJump:
    given = recording(seed=seed, leg_deg=leg_deg, calibration_error=error, source=source)
    return measured_jump(given, 1, f"jump {seed}")


def group(first: int, *leg_deg: float) -> list[MeasuredJump]:
    """Jumps of an athlete with these changes of the leg angle."""
    return [jump(first + place, angle) for place, angle in enumerate(leg_deg)]


def test_two_single_jumps_are_compared_as_by_the_comparison_of_jumps() -> None:
    aligned = align([jump(1), jump(2, leg_deg=3.0)])
    found, expected = group_difference(aligned, (1, 1), FEW).difference, difference(aligned, FEW)
    assert found.found() == expected.found() == ["alpha"]
    assert found.p_greatest == pytest.approx(expected.p_greatest, nan_ok=True)


def test_a_change_within_the_athletes_own_scatter_is_chance_and_a_greater_one_is_not() -> None:
    """Single jumps 4 degrees apart are found different: not so the means of four each that scatter by 3 degrees."""
    assert "alpha" in difference(align([jump(100, -1.0), jump(200, 3.0)]), FEW).found()
    one, other = group(100, -3, -1, 1, 3), group(200, 1, 3, 5, 7)
    assert group_difference(align([*one, *other]), (4, 4), FEW).difference.found() == []
    one, other = group(100, -1, -1, 1, 1), group(200, 9, 9, 11, 11)
    greater = group_difference(align([*one, *other]), (4, 4), FEW).difference
    assert "alpha" in greater.found()
    at = greater.greatest(ALPHA)
    assert at is not None
    assert greater.value[ALPHA, at] == pytest.approx(10.0, abs=1.5)
    assert greater.sigma[ALPHA, at] == pytest.approx(np.sqrt(4 / 3) * np.sqrt(2 / 4), rel=0.3)


def test_further_jumps_tell_how_the_athlete_scatters() -> None:
    """Two against two leave two degrees of freedom: 10 degrees may be chance. With ten further jumps they are not."""
    few = [*group(100, -1, 1), *group(200, 9, 11)]
    alone = group_difference(align(few), (2, 2), FEW)
    assert alone.difference.found() == []
    further = [*group(300, -1, 1, -1, 1, 1, -1), *group(400, 9, 11, 9, 11)]
    helped = group_difference(align([*few, *further]), (2, 2, 6, 4), FEW)
    assert "alpha" in helped.difference.found()
    assert alone.scatter is not None
    assert helped.scatter is not None
    assert (alone.scatter.freedom, helped.scatter.freedom, helped.scatter.jumps) == (2, 10, 14)
    at = helped.difference.greatest(ALPHA)
    assert at is not None
    assert helped.difference.value[ALPHA, at] == pytest.approx(10.0, abs=1.5)  # of the first two groups


def test_an_error_that_a_whole_group_has_by_its_calibration_is_not_taken_for_a_change() -> None:
    """Without calibrations in common their errors count, however many jumps there are: the mean has them all."""
    errors = [calibration_error(number) for number in (1, 2)]
    same = group_difference(align([jump(seed, error=errors[0]) for seed in range(8)]), (4, 4), FEW).difference
    one = [jump(seed, error=errors[0], source="a") for seed in range(4)]
    other = [jump(seed, error=errors[1], source="b") for seed in range(4, 8)]
    apart = group_difference(align([*one, *other]), (4, 4), FEW).difference
    height = QUANTITIES.index("height")
    middle = len(apart.times) // 2
    assert apart.sigma[height, middle] > 1.5 * same.sigma[height, middle]
    assert apart.found() == []


@pytest.mark.long
def test_chance_is_rarely_taken_for_a_change() -> None:
    """Of 12 comparisons 0.6 are expected at most; more than 3 come with a probability of 0.2 %."""
    false = 0
    for number in range(12):
        angles = (2 * np.random.default_rng(number).normal(size=6)).round() / 2
        one, other = group(1000 + 20 * number, *angles[:3]), group(1010 + 20 * number, *angles[3:])
        false += bool(group_difference(align([*one, *other]), (3, 3), FEW).difference.found())
    assert false <= 3
