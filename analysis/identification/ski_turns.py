"""How the skis of a jump turn from pulse to pulse: fits that contradict those of other pulses, and predictions."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.prediction import Part, predict
from analysis.identification.space.views import gate
from analysis.ski_bars.bars import OF_POSE, SKIS, Poses
from analysis.ski_bars.directions import OPENING
from analysis.ski_bars.fitting import FittedBars
from photogrammetry.jumper.stick_model import by_slope_and_heading, direction_of, slope_and_heading
from rig.arrays import Flags, Floats

SOUGHT_RAD: Final = np.radians((6.0, 2.0))  #: standard deviations of a direction that was sought: to the side, up
FEWEST_TELLING: Final = 3  #: least pulses that show a ski
#: Slope and heading (rad) of both skis as sums of their mean and of half their difference: (mean, velocity,
#: acceleration), and the change of the acceleration within 0.1 s.
_MIXING: Final = np.array([(1.0, -1.0), (1.0, 1.0)])
_PARTS: Final = (
    Part(np.zeros((2, 2)), (0.4, 1.0, 10.0), 15.0),
    Part(np.array(((0.0, OPENING / 2), (0.0, 0.0))), (0.2, 0.5, 5.0), 8.0),
)


def by_turns(poses: Poses, axes: Floats) -> Floats:
    """Derivatives (2, 2, 2) of slope and heading of both skis by their turns (`Poses.axes`).

    Args:
        poses: of the skis.
        axes: (3, 3) of the frame of slope and heading, as rows.
    """
    turns = np.stack(poses.axes(), axis=-1)
    return np.asarray(np.linalg.pinv(by_slope_and_heading(poses.direction @ axes.T)) @ axes @ turns)


def _turns(found: Sequence[FittedBars | None], seen: Flags, flight: Flight) -> tuple[Floats, Floats]:
    """Slope and heading (t, 2, 2) of the seen skis and covariances (t, 2, 2, 2), rad; else not a number."""
    angles, spread = np.full((len(found), SKIS, 2), np.nan), np.full((len(found), SKIS, 2, 2), np.nan)
    for t, k in np.argwhere(seen).tolist():
        if (fit := found[t]) is None:
            continue
        own, turned = slice(OF_POSE * k + 3, OF_POSE * (k + 1)), by_turns(fit.poses, flight.axes)[k]
        angles[t, k] = slope_and_heading(fit.poses.direction[k] @ flight.axes.T)
        spread[t, k] = turned @ fit.covariance[own, own] @ turned.T
    return angles, spread


def smooth(found: Sequence[FittedBars | None], time_s: Floats, flight: Flight) -> Flags:
    """Which of the fitted skis (t, 2) are seen and do not contradict those of the other pulses."""
    kept = np.array([(False, False) if fit is None else fit.seen for fit in found])
    angles, spread = _turns(found, kept, flight)
    while kept.any():
        values = np.where(kept[..., None], angles, np.nan), np.where(kept[..., None, None], spread, np.nan)
        others = predict(time_s, *values, _PARTS, _MIXING)
        off = np.where(kept[..., None], angles - others.xyz, 0.0)
        total = others.covariance + np.where(kept[..., None, None], spread, np.eye(2))
        misfit = (off * np.linalg.solve(total, off[..., None])[..., 0]).sum(axis=-1)
        if misfit.max() < gate(2):
            break
        kept[np.unravel_index(int(misfit.argmax()), misfit.shape)] = False
    kept &= kept.sum(axis=0) >= FEWEST_TELLING
    return kept


def led(found: Sequence[FittedBars | None], seen: Flags, time_s: Floats, flight: Flight) -> tuple[Floats, Flags]:
    """Directions (t, 2, 3) predicted from the seen skis of the other pulses.

    Returns:
        The directions, and whether they are known better than those that are sought (t, 2).
    """
    if not seen.any():
        return np.zeros((*seen.shape, 3)), np.zeros_like(seen)
    others = predict(time_s, *_turns(found, seen, flight), _PARTS, _MIXING)
    sigma = np.sqrt(np.linalg.eigvalsh(others.covariance)[..., -1])
    return direction_of(others.xyz) @ flight.axes, np.asarray((sigma < SOUGHT_RAD[0]) & seen.any(axis=0))
