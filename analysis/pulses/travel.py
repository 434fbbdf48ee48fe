"""How the jumper travels from pulse to pulse: differences of positions, and nothing smoother."""

from typing import Final

import numpy as np

from rig.arrays import Floats, Integers

#: Pulses whose differences tell the velocity: in 0.1 s no jumper changes it by more than some 1 m/s, which shifts a
#: point by 1 mm between exposures whose middles are 1 ms apart. At least three before and after, so that wrong places
#: in two neighbouring pulses, which spoil the differences of four, are outvoted.
_AROUND_S: Final = 0.1
_LEAST_AROUND: Final = 3


def velocities(points: Floats, times: Floats) -> Floats:
    """Approximate velocities (k, 3) of the jumper at k pulses, m/s, for the small shifts between exposures.

    Each is the median of the central differences of all points in the pulses around: where few rays or a wrong one
    intersect, at the borders of the images above all, a single difference can be wrong by hundreds of m/s.

    Args:
        points: (k, q, 3) points that move about alike, NaN where not measured.
        times: (k,) s, ascending.

    Returns:
        Medians, interpolated where nothing was measured; zero if there is nothing.
    """
    result = np.zeros((len(times), 3))
    if len(times) < 2:
        return result
    before, after = np.maximum(np.arange(len(times)) - 1, 0), np.minimum(np.arange(len(times)) + 1, len(times) - 1)
    step = (points[after] - points[before]) / (times[after] - times[before])[:, None, None]
    there = np.asarray(np.isfinite(step).all(axis=2))
    known = np.flatnonzero(there.any(axis=1))
    if not len(known):
        return result
    middle = np.zeros((len(known), 3))
    for i, k in enumerate(known):
        near = np.abs(times - times[k]) <= _AROUND_S
        near[max(0, k - _LEAST_AROUND) : k + _LEAST_AROUND + 1] = True
        middle[i] = np.median(step[near][there[near]], axis=0)
    for axis in range(3):
        result[:, axis] = np.interp(times, times[known], middle[:, axis])
    return result


def way_ahead(points: Floats, times: Floats) -> Floats:
    """The direction (3,) in which the jumper travels, to tell the tip of a ski from its tail.

    Args:
        points: (k, 4, 3) P1 to P4, NaN where not measured.
        times: (k,) s.

    Returns:
        The median velocity; without one the lean of the body from the bindings to the helmet; else the X axis.
    """
    moving = velocities(points, times)
    moving = moving[np.linalg.norm(moving, axis=1) > 0]
    if len(moving):
        return np.asarray(np.median(moving, axis=0))
    lean = (points[:, 0] - points[:, 2:].mean(axis=1))[:, :2]
    lean = lean[np.isfinite(lean).all(axis=1)]
    return np.append(lean.mean(axis=0), 0.0) if len(lean) else np.array((1.0, 0.0, 0.0))


def speeds(
    origin: Floats, own: Floats, by_calibration: Floats, calibration: Floats, pulses: Integers, times: Floats
) -> Floats:
    """Speed of O from the pulses before and after, with standard deviation, (k, 2), m/s.

    The errors of the calibration are the same in both pulses and largely cancel.

    Args:
        origin: (k, 3) O; NaN where not measured.
        own: (k, 3, 3) its covariance from the image measurement alone.
        by_calibration: (k, 3, p) its change by errors of the calibration.
        calibration: (p, p) covariance of the calibration.
        pulses: (k,) numbers.
        times: (k,) s.

    Returns:
        NaN where O is missing in one of the three pulses, and at the ends.
    """
    result = np.full((len(origin), 2), np.nan)
    if len(origin) < 3:
        return result
    period = times[2:] - times[:-2]
    way = origin[2:] - origin[:-2]
    length = np.linalg.norm(way, axis=1)
    unit = way / length[:, None]
    change = np.einsum("ka,kap->kp", unit, by_calibration[2:] - by_calibration[:-2])
    variance = np.einsum("ka,kab,kb->k", unit, own[2:] + own[:-2], unit)
    variance += np.einsum("kp,pq,kq->k", change, calibration, change)
    complete = (pulses[2:] - pulses[:-2] == 2) & np.isfinite(origin[1:-1]).all(axis=1)
    values = np.stack((length, np.sqrt(variance)), axis=1) / period[:, None]
    result[1:-1] = np.where(complete[:, None], values, np.nan)
    return result
