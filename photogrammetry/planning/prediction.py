"""Predicted sigmas by covariance propagation: step 2, then step 3 with step 2's errors carried along."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.adjustment import Adjustment, adjust_once
from photogrammetry.planning.plan import Plan
from photogrammetry.planning.step_three import Sights, error_free_sights, intersect_flight

Floats = NDArray[np.float64]

_STEP = 0.1  # sigmas: the differences are of third order in it


@dataclass(frozen=True, slots=True, eq=False)
class Sigmas:
    """Standard deviations, by covariance or by Monte Carlo.

    Attributes:
        positions: (images, 3) projection centres, object unit.
        interior: (cameras, k) the parameters that any camera estimates, in the order of `INTERIOR`; 0: constant.
        points: (t, p, 3) jumper points, object unit.
        angles: (t, s, 2) slope and heading of the skis (rad).
    """

    positions: Floats
    interior: Floats
    points: Floats
    angles: Floats

    def flat(self) -> Floats:
        """All of them in one row."""
        return np.concatenate([part.ravel() for part in (self.positions, self.interior, self.points, self.angles)])


def adjusted_plan(plan: Plan) -> Adjustment:
    """Step 2 of the plan, error-free; its cofactors are the covariance that the given sigmas lead to.

    Raises:
        NotSolvableError: the network does not determine its unknowns; says which and why.
    """
    return adjust_once(plan.network)


def predict(plan: Plan, adjusted: Adjustment) -> Sigmas:
    """Propagate: covariance of an intersected point = that of its rays + that of the orientations.

    A jumper point that is a tie point of step 2 comes out of step 3 where step 2 left it (same observations, same
    orientations), so its covariance is the one of step 2.
    """
    unknowns = adjusted.problem.unknowns
    variance = np.append(np.diagonal(adjusted.cofactors), 0.0)
    positions, interior = np.sqrt(variance[unknowns.pose[:, :3]]), np.sqrt(variance[unknowns.camera])
    flight = plan.flight
    if flight is None:
        return Sigmas(positions, interior, np.zeros((0, 0, 3)), np.zeros((0, 0, 2)))
    sights = error_free_sights(plan, flight)
    alone = intersect_flight(plan.network, adjusted.state, sights)
    of_points, of_angles = _derivatives(plan, adjusted, sights)
    orientations = adjusted.cofactors[: unknowns.n_poses_end, : unknowns.n_poses_end]
    points = _diagonal(alone.points_covariance) + _carried(of_points, orientations)
    angles = _diagonal(alone.angles_covariance) + _carried(of_angles, orientations)
    points = points.reshape(flight.points.shape)
    tied = flight.tie >= 0
    points[tied] = variance[unknowns.point[flight.tie[tied]]]
    return Sigmas(positions, interior, np.sqrt(points), np.sqrt(angles).reshape(*flight.skis.shape[:2], 2))


def _derivatives(plan: Plan, adjusted: Adjustment, sights: Sights) -> tuple[Floats, Floats]:
    """Points (n, 3, g) and angles (n, 2, g) by the g orientation unknowns: central differences through step 3."""
    unknowns = adjusted.problem.unknowns
    sigma = np.sqrt(np.diagonal(adjusted.cofactors))
    by_point, by_angle = [], []
    for column in range(unknowns.n_poses_end):
        step = np.zeros(unknowns.count)
        step[column] = _STEP * sigma[column]
        ahead, behind = (
            intersect_flight(plan.network, unknowns.moved(adjusted.state, sign * step), sights) for sign in (1.0, -1.0)
        )
        by_point.append((ahead.points - behind.points) / (2.0 * step[column]))
        by_angle.append((ahead.angles - behind.angles) / (2.0 * step[column]))
    return np.stack(by_point, axis=-1), np.stack(by_angle, axis=-1)


def _carried(derivatives: Floats, covariance: Floats) -> Floats:
    carried: Floats = np.einsum("nig,gh,nih->ni", derivatives, covariance, derivatives, optimize=True)
    return carried


def _diagonal(covariance: Floats) -> Floats:
    return np.diagonal(covariance, axis1=1, axis2=2)
