"""The difference of the means of two groups of jumps: better than chance, or not.

Two jumps differ by more than errors of measurement as soon as the athlete is a human being. So the means of two groups
are judged by how jumps scatter about the mean of their own group, errors of measurement included, with the t
distribution (further groups of the athlete tell of that scatter, too); errors of calibration and take-off that all
jumps of a group have in common come on top. The greatest of all differences is judged as in
`analysis.comparison.difference`, as that of as many independent differences: their number is that of two measurements
of one jump, which scatter more freely over time than jumps do: chance is rather given too much than too little.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
from scipy.special import stdtrit

from analysis.comparison.aligned import MeasuredJump, Series, common_times, series
from analysis.comparison.alignment import Alignment
from analysis.comparison.difference import (
    DRAWS,
    LEVEL,
    Difference,
    as_greatest,
    difference,
    shared_covariance,
)
from analysis.comparison.scatter import Scatter, scatter_within
from analysis.comparison.shared_calibration import SharedCalibration, shared_calibration
from analysis.result.model import QUANTITIES
from rig.arrays import Floats


@dataclass(frozen=True, slots=True, eq=False)
class GroupDifference:
    """What was found.

    Attributes:
        difference: mean of the second group minus mean of the first.
        scatter: how the jumps scatter about the means of their groups; None: there are two single jumps and no others,
            which are compared as such.
    """

    difference: Difference
    scatter: Scatter | None


def group_difference(alignment: Alignment, sizes: Sequence[int], draws: int = DRAWS) -> GroupDifference:
    """Compare two groups of jumps.

    Args:
        alignment: of all jumps, group by group.
        sizes: of the groups. The first two are compared; further ones tell how the athlete's jumps scatter, as far as
            they are measured at the same times.
        draws: of the distribution of the greatest difference.

    Raises:
        BadInputError: the jumps of the first two groups are not all measured at the same times since the take-off.
    """
    jumps = iter(alignment.jumps)
    groups = [list(islice(jumps, size)) for size in sizes]
    pair = difference(replace(alignment, jumps=[groups[0][0], groups[1][0]]), draws)
    times = common_times([*groups[0], *groups[1]])
    found = [[series(jump, times) for jump in group] for group in groups[:2]]
    others = [[series(jump, times) for jump in group if _covers(jump, times)] for group in groups[2:]]
    within = scatter_within([[each.values for each in group] for group in (*found, *others)])
    if within is None:
        return GroupDifference(pair, None)
    one, other = (_mean(group) for group in found)
    shared = shared_covariance(one, other, _calibration(groups[:2]), alignment.shared_sigma_s)
    parts = sum(1 / len(group) for group in groups[:2])
    sigma = np.sqrt(within.deviation**2 * parts + shared.diagonal().reshape(one.values.shape))
    p = within.p(other.values - one.values, sigma)
    alone = -np.expm1(np.log1p(-LEVEL) / pair.independent)
    compared = Difference(
        times=times,
        a=one.values,
        b=other.values,
        sigma=sigma,
        repeat=sigma,
        p=p,
        p_greatest=as_greatest(p, pair.independent),
        independent=pair.independent,
        limit=float(-stdtrit(within.freedom, alone / 2)),
        common=pair.common,
        power=dict.fromkeys(QUANTITIES),
    )
    return GroupDifference(compared, within)


def greatest_differences(found: Difference) -> list[dict[str, Any]]:
    """By quantity, where it differs most, as far as it is known: for programs, degrees, m, m/s and s."""
    places = [(row, name, found.greatest(row)) for row, name in enumerate(QUANTITIES)]
    return [
        {
            "quantity": name,
            "different": name in found.found(),
            "since_takeoff_s": float(found.times[at]),
            "difference": float(found.value[row, at]),
            "sigma": float(found.sigma[row, at]),
            "p": float(found.p_greatest[row, at]),
            "needed": float(found.limit * found.repeat[row, at]),
        }
        for row, name, at in places
        if at is not None
    ]


def _covers(jump: MeasuredJump, times: Floats) -> bool:
    known = jump.since_takeoff()
    return bool(known[0] <= times[0] and times[-1] <= known[-1])


def _mean(group: Sequence[Series]) -> Series:
    """What the jumps of a group have in common; what scatters from jump to jump is not in it."""
    values, change, by = (
        np.mean([getattr(each, name) for each in group], axis=0) for name in ("values", "change", "by_calibration")
    )
    return replace(group[0], values=values, change=change, by_calibration=by, takeoff_sigma_s=0.0)


def _calibration(groups: Sequence[Sequence[MeasuredJump]]) -> SharedCalibration:
    """Errors of the calibrations of two groups; jumps of one calibration have the same."""
    everything = shared_calibration([jump.recording for group in groups for jump in group])
    owned = iter(everything.own)
    return replace(everything, own=tuple(_own(group, [next(owned) for _ in group]) for group in groups))


def _own(group: Sequence[MeasuredJump], own: list[Floats]) -> Floats:
    """Covariance (p, p) of the mean of a group's own errors."""
    counts = Counter(jump.recording.orientation.source for jump in group)
    by_source = {jump.recording.orientation.source: each for jump, each in zip(group, own, strict=True)}
    return np.asarray(sum((count / len(group)) ** 2 * by_source[source] for source, count in counts.items()))
