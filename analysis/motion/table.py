"""The table as the motion before the take-off shows it, and the velocity across it."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.motion.adjustment.bundle import Adjusted
from analysis.motion.model.channels import CHANNELS
from analysis.motion.takeoff import Break
from analysis.result.model import EDGE_S, Quantity, Vector
from rig.arrays import Floats

GRAVITY: Final = 9.81  # m/s^2
_PULSES_LEAST = 3  # pulses on the table
_STEP = 1e-6  # m/s, for derivatives by central differences


@dataclass(frozen=True, slots=True, eq=False)
class TableMotion:
    """Table and take-off.

    Attributes:
        direction: (3,) unit vector along the table, in the direction of the motion.
        slope: of the table above the horizontal, degrees (negative: downwards).
        perpendicular: m/s, mean velocity of O perpendicular to the table from half of `EDGE_S` to three halves of it
            after the take-off, when the skis begin to move with the body, without what gravity has taken until then:
            about that of the body at the take-off.
    """

    direction: Vector
    slope: Quantity
    perpendicular: Quantity


def table_motion(adjusted: Adjusted, edge: Break) -> TableMotion | None:
    """Table and take-off; None where fewer than three pulses lie on the table, or the sight ends at the edge."""
    times, unit = adjusted.model.observed.times, adjusted.model.prior.unit
    on_table = np.flatnonzero(times < edge.seconds)
    begin, end = edge.seconds + EDGE_S / 2, edge.seconds + 3 * EDGE_S / 2
    if len(on_table) < _PULSES_LEAST or end > times[-1]:
        return None
    by_states = np.zeros((*adjusted.states.shape, 9))
    centred = times[on_table] - times[on_table].mean()
    for axis in range(3):
        by_states[on_table, axis, axis] = centred / (centred @ centred)
    for sign, at in ((-1, begin), (1, end)):
        for k, share in _around(times, at):
            value, speed = (sign * share / EDGE_S * row for row in _rows((at - times[k]) / unit))
            for axis in range(3):
                by_states[k, axis::CHANNELS, 3 + axis] += value
                by_states[k, axis::CHANNELS, 6 + axis] += speed / unit
    values = np.einsum("nsf,ns->f", by_states, adjusted.states)
    covariance = adjusted.solution.covariance_of(by_states)
    whole = np.kron(np.eye(3), adjusted.model.frame.rotation)
    values, covariance = whole @ values, whole @ covariance @ whole.T
    steps = _STEP * np.eye(9)
    by = np.stack([(_results(values + s) - _results(values - s)) / (2 * _STEP) for s in steps], axis=1)
    out, spread = _results(values), by @ covariance @ by.T
    spread[4, 4] += (out[5] * edge.sigma) ** 2
    return TableMotion(
        Vector(out[:3], spread[:3, :3]),
        Quantity(float(np.degrees(out[3])), float(np.degrees(np.sqrt(spread[3, 3])))),
        Quantity(float(out[4]), float(np.sqrt(spread[4, 4]))),
    )


def _around(times: Floats, at: float) -> tuple[tuple[int, float], tuple[int, float]]:
    """The pulses before and after a time, with the share of each in what is between them."""
    k = min(int(np.searchsorted(times, at, side="right")), len(times) - 1) - 1
    share = (at - times[k]) / (times[k + 1] - times[k])
    return (k, 1 - share), (k + 1, share)


def _rows(steps: float) -> tuple[Floats, Floats]:
    """Value and speed (per unit) of a channel after some steps, by its state (3,)."""
    return np.array((1.0, steps, steps**2)), np.array((0.0, 1.0, 2 * steps))


def _results(values: Floats) -> Floats:
    """Direction, slope, perpendicular velocity and its growth with the take-off time.

    From the mean velocities on the table and behind the edge, and the mean acceleration there.
    """
    along = values[:3] / np.linalg.norm(values[:3])
    normal = np.array((0.0, 0.0, 1.0)) - along[2] * along
    normal /= np.linalg.norm(normal)
    perpendicular = values[3:6] @ normal + GRAVITY * EDGE_S * normal[2]
    growth = values[6:9] @ normal
    return np.concatenate((along, (np.arcsin(along[2]), perpendicular, growth)))
