"""Predicts sigmas by covariance propagation: step 2, then step 3 with the covariance of step 2."""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.planning.plan import Flight, Plan, Stick
from photogrammetry.planning.step_three import (
    Intersected,
    Sights,
    error_free_sights,
    features,
    intersect_flight,
    origin_weights,
    stick_slopes,
)
from rig.arrays import Floats

_STEP = 0.1  # sigmas, of central differences; their errors are of third order in it


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


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """Step 3 linearised: a function of the unknowns of step 2 and of the rays of step 3.

    Attributes:
        values: (t, f) features of each position: points, then slope and heading of the skis.
        by_unknowns: (t, f, u) derivatives by all unknowns of step 2.
        own: (t, f, f) covariance from the rays of step 3; no two positions share a ray.
        covariance: (t, f, f) from both.
    """

    values: Floats
    by_unknowns: Floats
    own: Floats
    covariance: Floats


def adjusted_plan(plan: Plan) -> Adjustment:
    """Step 2 of the plan with error-free observations; its cofactors are the covariance that follows from the sigmas.

    Raises:
        NotSolvableError: the network does not determine its unknowns; names them and the causes.
    """
    return adjust_once(plan.network)


def predict(plan: Plan, adjusted: Adjustment) -> Sigmas:
    """Predicted sigmas. The covariance of intersected points is that of their rays plus that of the orientations."""
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
    """Empty points, angles, body and speed, of a plan without a jumper."""
    return np.zeros((0, 0, 3)), np.zeros((0, 0, 2)), np.zeros((0, 0)), np.zeros(0)


def carry(plan: Plan, flight: Flight, adjusted: Adjustment) -> Carried:
    """Linearise step 3.

    For a jumper point that is a tie point of step 2, step 3 gives the result of step 2 (same observations, same
    orientations), so it is taken as an unknown of step 2.
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
    """Covariance (t, f, f) from the rays of step 3: blocks of the points, then of the skis."""
    t, p, s = len(flight.points), len(flight.names), len(flight.ski_names)
    points = alone.points_covariance.reshape(t, p, 3, 3)
    skis = alone.angles_covariance.reshape(t, s, 2, 2)
    return np.array([block_diag(*points[i], *skis[i]) for i in range(t)])


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
    """Sigma of the speed of O between pulses; errors that both places have from the same orientations cancel."""
    weights = origin_weights(stick, carried.values.shape[-1])
    along = np.diff(carried.values, axis=0) @ weights.T
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    by_features = along @ weights  # (t - 1, f) for the later position; the earlier one has the other sign
    by_unknowns = np.einsum("tf,tfu->tu", by_features, np.diff(carried.by_unknowns, axis=0))
    own = np.einsum("tf,tfg,tg->t", by_features, carried.own[1:] + carried.own[:-1], by_features, optimize=True)
    variance = own + np.einsum("tu,uv,tv->t", by_unknowns, cofactors, by_unknowns, optimize=True)
    sigma: Floats = stick.rate_hz * np.sqrt(variance)
    return sigma
