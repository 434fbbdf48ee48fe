"""Predicted sigmas by covariance propagation: step 2, then step 3 with step 2's errors carried along."""

from dataclasses import astuple, dataclass

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.adjustment import Adjustment, adjust_once
from photogrammetry.planning.plan import Flight, Plan, Stick
from photogrammetry.planning.step_three import Intersected, Sights, error_free_sights, intersect_flight
from photogrammetry.planning.stick_features import features, origin_weights, stick_slopes

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
        body: (t, 6) the stick model's alpha, beta, gamma, dphi, phi (rad) and the height of O; (t, 0) without one.
        speed: (t - 1,) speed of O from one pulse to the next, object unit per second; (0,) without a stick model.
    """

    positions: Floats
    interior: Floats
    points: Floats
    angles: Floats
    body: Floats
    speed: Floats

    def flat(self) -> Floats:
        """All of them in one row."""
        return np.concatenate([part.ravel() for part in astuple(self)])


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """Step 3 as a linear function of everything that errs: the unknowns of step 2, and the rays of step 3.

    Attributes:
        values: (t, f) features of each position: points, then slope and heading of the skis.
        by_unknowns: (t, f, u) derivatives by all unknowns of step 2.
        own: (t, f, f) covariance that the rays of step 3 add; no two positions share a ray.
        covariance: (t, f, f) in all.
    """

    values: Floats
    by_unknowns: Floats
    own: Floats
    covariance: Floats


def adjusted_plan(plan: Plan) -> Adjustment:
    """Step 2 of the plan, error-free; its cofactors are the covariance that the given sigmas lead to.

    Raises:
        NotSolvableError: the network does not determine its unknowns; says which and why.
    """
    return adjust_once(plan.network)


def predict(plan: Plan, adjusted: Adjustment) -> Sigmas:
    """Propagate: covariance of what is intersected = that of its rays + that of the orientations."""
    unknowns, flight = adjusted.problem.unknowns, plan.flight
    variance = np.append(np.diagonal(adjusted.cofactors), 0.0)
    positions, interior = np.sqrt(variance[unknowns.pose[:, :3]]), np.sqrt(variance[unknowns.camera])
    if flight is None:
        return Sigmas(positions, interior, *no_flight())
    carried = carry(plan, flight, adjusted)
    sigma, split = np.sqrt(np.diagonal(carried.covariance, axis1=1, axis2=2)), 3 * len(flight.names)
    points = sigma[:, :split].reshape(flight.points.shape)
    angles = sigma[:, split:].reshape(*flight.skis.shape[:2], 2)
    if flight.stick is None:
        return Sigmas(positions, interior, points, angles, *no_flight()[2:])
    slopes = stick_slopes(flight, flight.stick, carried.values)
    body = np.sqrt(np.einsum("tif,tfg,tig->ti", slopes, carried.covariance, slopes, optimize=True))
    return Sigmas(positions, interior, points, angles, body, _speed(flight.stick, carried, adjusted.cofactors))


def no_flight() -> tuple[Floats, Floats, Floats, Floats]:
    """Points, angles, body and speed where nobody jumps."""
    return np.zeros((0, 0, 3)), np.zeros((0, 0, 2)), np.zeros((0, 0)), np.zeros(0)


def carry(plan: Plan, flight: Flight, adjusted: Adjustment) -> Carried:
    """Linearise step 3.

    A jumper point that is a tie point of step 2 comes out of step 3 where step 2 left it (same observations, same
    orientations), so it is an unknown of step 2 itself.
    """
    unknowns = adjusted.problem.unknowns
    sights = error_free_sights(plan, flight)
    alone = intersect_flight(plan.network, adjusted.state, sights)
    values = _features(flight, alone)
    own = _own(flight, alone)
    by_unknowns = np.zeros((*values.shape, unknowns.count))
    by_unknowns[:, :, : unknowns.n_poses_end] = _by_orientations(plan, flight, adjusted, sights)
    for position, name in np.argwhere(flight.tie >= 0):
        rows = 3 * name + np.arange(3)
        by_unknowns[position, rows] = 0.0
        by_unknowns[position, rows, unknowns.point[flight.tie[position, name]]] = 1.0
        own[position, rows] = 0.0
    covariance = own + np.einsum("tfu,uv,tgv->tfg", by_unknowns, adjusted.cofactors, by_unknowns, optimize=True)
    return Carried(values, by_unknowns, own, covariance)


def _features(flight: Flight, intersected: Intersected) -> Floats:
    angles = intersected.angles.reshape(*flight.skis.shape[:2], 2)
    return features(intersected.points.reshape(flight.points.shape), angles)


def _own(flight: Flight, alone: Intersected) -> Floats:
    """(t, f, f): blocks of the points, then of the skis."""
    t, p, s = len(flight.points), len(flight.names), len(flight.ski_names)
    own = np.zeros((t, 3 * p + 2 * s, 3 * p + 2 * s))
    for i, block in enumerate(alone.points_covariance.reshape(t, p, 3, 3).swapaxes(0, 1)):
        own[:, 3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = block
    for i, block in enumerate(alone.angles_covariance.reshape(t, s, 2, 2).swapaxes(0, 1)):
        first = 3 * p + 2 * i
        own[:, first : first + 2, first : first + 2] = block
    return own


def _by_orientations(plan: Plan, flight: Flight, adjusted: Adjustment, sights: Sights) -> Floats:
    """Features (t, f, g) by the g orientation unknowns: central differences through step 3."""
    unknowns = adjusted.problem.unknowns
    sigma = np.sqrt(np.diagonal(adjusted.cofactors))
    slopes = []
    for column in range(unknowns.n_poses_end):
        step = np.zeros(unknowns.count)
        step[column] = _STEP * sigma[column]
        ahead, behind = (
            intersect_flight(plan.network, unknowns.moved(adjusted.state, sign * step), sights) for sign in (1.0, -1.0)
        )
        slopes.append((_features(flight, ahead) - _features(flight, behind)) / (2.0 * step[column]))
    return np.stack(slopes, axis=-1)


def _speed(stick: Stick, carried: Carried, cofactors: Floats) -> Floats:
    """Of O from each pulse to the next: what both places owe to the same orientations cancels in their difference."""
    weights = origin_weights(stick, carried.values.shape[-1])
    along = np.diff(carried.values, axis=0) @ weights.T
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    by_features = along @ weights  # (t - 1, f) for the later position; the earlier one has the other sign
    by_unknowns = np.einsum("tf,tfu->tu", by_features, np.diff(carried.by_unknowns, axis=0))
    own = np.einsum("tf,tfg,tg->t", by_features, carried.own[1:] + carried.own[:-1], by_features, optimize=True)
    variance = own + np.einsum("tu,uv,tv->t", by_unknowns, cofactors, by_unknowns, optimize=True)
    sigma: Floats = stick.rate_hz * np.sqrt(variance)
    return sigma
