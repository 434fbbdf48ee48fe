"""Observations that are no image points, called relations, with their residuals and derivatives.

Control points (paper D3b), distances and coordinate differences (equation 3), weighted camera parameters, weighted
poses (D.2).
"""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from photogrammetry.adjustment.equations.unknowns import NONE, State, Unknowns
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.geometry.rotation import increment_jacobian, vector_from_rotation
from photogrammetry.network.model import Network, Role
from rig.arrays import Floats, Integers


class Kind(IntEnum):
    """Kind of an observation; the names are those of the variance components' groups."""

    CONTROL = 0
    DISTANCE = 1
    DIFFERENCE = 2
    CAMERA = 3
    POSE = 4


@dataclass(frozen=True, slots=True, eq=False)
class Relations:
    """m single observations, in the order of `Kind`, within it in that of the network.

    Attributes:
        network: has the observed values.
        kind: (m,).
        sigma: (m,) a priori.
        item: (m,) index of the point, distance, difference, camera or image.
        part: (m,) axis 0..2; index into `INTERIOR` for a camera; 0..5 for a pose.
        observed: (m,) the value; 0 for angles of a pose, whose residuals are those of a rotation.
        start, end: (m,) indices of the points between which a distance or difference is; 0 for others.
        by_kind: indices of the observations of each kind.
        positions, angles: indices of those of poses, apart.
    """

    network: Network
    kind: Integers
    sigma: Floats
    item: Integers
    part: Integers
    observed: Floats
    start: Integers
    end: Integers
    by_kind: tuple[Integers, ...]
    positions: Integers
    angles: Integers

    def __len__(self) -> int:
        return len(self.kind)

    def rows(self, kind: Kind) -> Integers:
        """Indices of the observations of one kind."""
        return self.by_kind[kind]


@dataclass(frozen=True, slots=True, eq=False)
class RelationEquations:
    """Linearised: v (m,) = adjusted - observed, and derivatives `values` by the unknowns `columns`, both (m, 6)."""

    v: Floats
    columns: Integers
    values: Floats


def relations_of(network: Network) -> Relations:
    """Collect the observations of a network that are no image points."""
    found: list[tuple[Kind, int, int, float, float, int, int]] = []
    for i, point in enumerate(network.points):
        if point.role is Role.CONTROL and point.sigma is not None:
            xyz = _given(point.xyz)
            found += [(Kind.CONTROL, i, axis, point.sigma[axis], xyz[axis], 0, 0) for axis in range(3)]
    found += [(Kind.DISTANCE, i, 0, d.sigma, d.value, d.start, d.end) for i, d in enumerate(network.distances)]
    found += [(Kind.DIFFERENCE, i, d.axis, d.sigma, d.value, d.start, d.end) for i, d in enumerate(network.differences)]
    for i, camera in enumerate(network.cameras):
        weighted = [(k, camera.sigma[p]) for k, p in enumerate(INTERIOR) if p in camera.sigma]
        found += [(Kind.CAMERA, i, k, sigma, camera.interior[k], 0, 0) for k, sigma in weighted]
    for i, image in enumerate(network.images):
        if image.sigma_position is not None:
            place = _given(image.position)
            found += [(Kind.POSE, i, axis, image.sigma_position[axis], place[axis], 0, 0) for axis in range(3)]
        if image.sigma_angles is not None:
            _given(image.rotation)
            found += [(Kind.POSE, i, 3 + axis, image.sigma_angles[axis], 0.0, 0, 0) for axis in range(3)]
    kind, item, part, sigma, observed, start, end = zip(*found, strict=True) if found else ((),) * 7
    whole = (np.array(values, dtype=np.intp) for values in (kind, item, part, start, end))
    kinds, items, parts, starts, ends = whole
    sigmas, values = (np.array(each, dtype=float) for each in (sigma, observed))
    by_kind = tuple(np.flatnonzero(kinds == each) for each in Kind)
    poses = by_kind[Kind.POSE]
    positions, angles = poses[parts[poses] < 3], poses[parts[poses] >= 3]
    return Relations(network, kinds, sigmas, items, parts, values, starts, ends, by_kind, positions, angles)


def relation_residuals(relations: Relations, state: State) -> Floats:
    """Residuals v = adjusted - observed, (m,)."""
    adjusted, item, part = np.empty(len(relations)), relations.item, relations.part
    for rows, of_item in (
        (relations.rows(Kind.CONTROL), state.xyz),
        (relations.rows(Kind.CAMERA), state.interior),
        (relations.positions, state.position),
    ):
        adjusted[rows] = of_item[item[rows], part[rows]]
    if len(rows := relations.rows(Kind.DISTANCE)):
        adjusted[rows] = np.linalg.norm(_along(relations, rows, state), axis=1)
    if len(rows := relations.rows(Kind.DIFFERENCE)):
        adjusted[rows] = _along(relations, rows, state)[np.arange(len(rows)), part[rows]]
    if len(rows := relations.angles):
        adjusted[rows] = _turned(relations, rows, state)[np.arange(len(rows)), part[rows] - 3]
    return np.asarray(adjusted - relations.observed)


def relation_equations(relations: Relations, unknowns: Unknowns, state: State) -> RelationEquations:
    """Linearise at a state."""
    m = len(relations)
    columns, values = np.full((m, 6), NONE, dtype=np.intp), np.zeros((m, 6))
    item, part, start, end = relations.item, relations.part, relations.start, relations.end
    rows = relations.rows(Kind.CONTROL)
    columns[rows, 0], values[rows, 0] = unknowns.point[item[rows], part[rows]], 1.0
    if len(rows := relations.rows(Kind.DISTANCE)):
        along = _along(relations, rows, state)
        length = np.linalg.norm(along, axis=1, keepdims=True)
        along = along / np.where(length == 0.0, 1.0, length)  # no direction: no slope
        columns[rows] = np.concatenate([unknowns.point[start[rows]], unknowns.point[end[rows]]], axis=1)
        values[rows] = np.concatenate([-along, along], axis=1)
    if len(rows := relations.rows(Kind.DIFFERENCE)):
        columns[rows, 0], values[rows, 0] = unknowns.point[start[rows], part[rows]], -1.0
        columns[rows, 1], values[rows, 1] = unknowns.point[end[rows], part[rows]], 1.0
    if len(rows := relations.rows(Kind.CAMERA)):
        columns[rows, 0] = unknowns.camera[item[rows], np.searchsorted(unknowns.selection, part[rows])]
        values[rows, 0] = 1.0
    rows = relations.positions
    columns[rows, 0], values[rows, 0] = unknowns.pose[item[rows], part[rows]], 1.0
    if len(rows := relations.angles):
        columns[rows, :3] = unknowns.pose[item[rows], 3:]
        for row, turned in zip(rows, _turned(relations, rows, state), strict=True):
            values[row, :3] = increment_jacobian(turned)[part[row] - 3]
    values[columns == NONE] = 0.0
    return RelationEquations(relation_residuals(relations, state), columns, values)


def _along(relations: Relations, rows: Integers, state: State) -> Floats:
    """(k, 3) from the first to the second point of each distance or difference."""
    return np.asarray(state.xyz[relations.end[rows]] - state.xyz[relations.start[rows]])


def _turned(relations: Relations, rows: Integers, state: State) -> Floats:
    """(k, 3) rotation vectors from the given to the adjusted rotation, for observed angles."""
    images = relations.item[rows]
    given = np.array([_given(relations.network.images[i].rotation) for i in images])
    return vector_from_rotation(given.transpose(0, 2, 1) @ state.rotation[images])


def _given(value: Floats | None) -> Floats:
    if value is None:  # the file reader refuses a sigma without a value
        raise ValueError("a weighted observation without a value; give the value or drop its sigma")
    return value
