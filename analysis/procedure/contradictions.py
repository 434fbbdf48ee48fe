"""Tells which raw points the motion of the whole jump contradicts.

Two rays control nothing: where one of them is wrong by some pixels, as a marker half behind a leg is, the raw point is
off by decimetres and its sigma does not know it. Points of which the motion left out a ray that nothing controls are
given up (decision 0063); what else differs keeps its raw values (decision 0029), and whoever reads them is told.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from analysis.motion.adjustment.gross_errors import FALSE_REMOVAL_P
from analysis.result.model import PointState, PulseState
from rig.phrase import Phrase, phrase


def with_contradictions(pulses: Sequence[PulseState]) -> tuple[PulseState, ...]:
    """The pulses of a jump with those raw points marked that are too far from the smoothed ones.

    Raw and smoothed point share the measurements of the pulse. Where these took part in both, the difference varies
    less than the sum of both covariances says; where the motion left them out as gross errors, just as much. So the
    sum makes a careful test, and a jump without gross errors gets any mark with a probability below `FALSE_REMOVAL_P`.
    """
    count = sum(point is not None for pulse in pulses for point in pulse.raw.points.values())
    limit = float(chdtri(3, FALSE_REMOVAL_P / max(count, 1)))
    return tuple(_marked(pulse, limit) for pulse in pulses)


def told(pulses: Sequence[PulseState]) -> Phrase | None:
    """A sentence about the marked points, with the one that is the farthest off; None if there is none."""
    found = [
        (_distance(point, smoothed), name, pulse.pulse)
        for pulse in pulses
        for name, point, smoothed in _pairs(pulse)
        if point.contradicted
    ]
    if not found:
        return None
    distance, name, worst = max(found)
    text = (
        "raw points that the motion contradicts: {count}, {point} at pulse {pulse} the most ({distance:.2f} m); take "
        "the smoothed values there"
    )
    return phrase("jump_contradicted", text, count=len(found), point=name, pulse=worst, distance=distance)


def _marked(pulse: PulseState, limit: float) -> PulseState:
    points = dict(pulse.raw.points)
    for name, point, smoothed in _pairs(pulse):
        off = point.xyz - smoothed.xyz
        far = float(off @ np.linalg.solve(point.covariance + smoothed.covariance, off))
        points[name] = replace(point, contradicted=far > limit)
    return replace(pulse, raw=replace(pulse.raw, points=points))


def _pairs(pulse: PulseState) -> list[tuple[str, PointState, PointState]]:
    """Name, raw and smoothed point of those that have both."""
    smoothed = {} if pulse.smoothed is None else pulse.smoothed.points
    both = [(name, point, smoothed.get(name)) for name, point in pulse.raw.points.items()]
    return [(name, raw, other) for name, raw, other in both if raw is not None and other is not None]


def _distance(a: PointState, b: PointState) -> float:
    return float(np.linalg.norm(a.xyz - b.xyz))
