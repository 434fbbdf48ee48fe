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
    """

    network: Network
    kind: Integers
    sigma: Floats
    item: Integers
    part: Integers

    def __len__(self) -> int:
        return len(self.kind)

    def rows(self, kind: Kind) -> Integers:
        """Indices of the observations of one kind."""
        return np.flatnonzero(self.kind == kind)


@dataclass(frozen=True, slots=True, eq=False)
class RelationEquations:
    """Linearised: v (m,) = adjusted - observed, and derivatives `values` by the unknowns `columns`, both (m, 6)."""

    v: Floats
    columns: Integers
    values: Floats


def relations_of(network: Network) -> Relations:
    """Collect the observations of a network that are no image points."""
    found: list[tuple[Kind, int, int, float]] = []
    for i, point in enumerate(network.points):
        if point.role is Role.CONTROL and point.sigma is not None:
            found += [(Kind.CONTROL, i, axis, point.sigma[axis]) for axis in range(3)]
    found += [(Kind.DISTANCE, i, 0, distance.sigma) for i, distance in enumerate(network.distances)]
    found += [(Kind.DIFFERENCE, i, d.axis, d.sigma) for i, d in enumerate(network.differences)]
    for i, camera in enumerate(network.cameras):
        found += [(Kind.CAMERA, i, k, camera.sigma[p]) for k, p in enumerate(INTERIOR) if p in camera.sigma]
    for i, image in enumerate(network.images):
        if image.sigma_position is not None:
            found += [(Kind.POSE, i, axis, image.sigma_position[axis]) for axis in range(3)]
        if image.sigma_angles is not None:
            found += [(Kind.POSE, i, 3 + axis, image.sigma_angles[axis]) for axis in range(3)]
    kinds, items, parts, sigmas = zip(*found, strict=True) if found else ((), (), (), ())
    indices = (np.array(values, dtype=np.intp) for values in (kinds, items, parts))
    kind, item, part = indices
    return Relations(network, kind, np.array(sigmas, dtype=float), item, part)


def relation_residuals(relations: Relations, state: State) -> Floats:
    """Residuals v = adjusted - observed, (m,)."""
    network, v = relations.network, np.empty(len(relations))
    for row, (kind, i, part) in enumerate(zip(relations.kind, relations.item, relations.part, strict=True)):
        match kind:
            case Kind.CONTROL:
                v[row] = state.xyz[i, part] - _given(network.points[i].xyz)[part]
            case Kind.DISTANCE:
                d = network.distances[i]
                v[row] = np.linalg.norm(state.xyz[d.end] - state.xyz[d.start]) - d.value
            case Kind.DIFFERENCE:
                e = network.differences[i]
                v[row] = state.xyz[e.end, e.axis] - state.xyz[e.start, e.axis] - e.value
            case Kind.CAMERA:
                v[row] = state.interior[i, part] - network.cameras[i].interior[part]
            case _:
                image = network.images[i]
                if part < 3:
                    v[row] = state.position[i, part] - _given(image.position)[part]
                else:
                    v[row] = vector_from_rotation(_given(image.rotation).T @ state.rotation[i])[part - 3]
    return v


def relation_equations(relations: Relations, unknowns: Unknowns, state: State) -> RelationEquations:
    """Linearise at a state."""
    m = len(relations)
    columns, values = np.full((m, 6), NONE, dtype=np.intp), np.zeros((m, 6))
    network = relations.network
    for row, (kind, i, part) in enumerate(zip(relations.kind, relations.item, relations.part, strict=True)):
        match kind:
            case Kind.CONTROL:
                columns[row, 0], values[row, 0] = unknowns.point[i, part], 1.0
            case Kind.DISTANCE:
                d = network.distances[i]
                along = state.xyz[d.end] - state.xyz[d.start]
                columns[row] = np.append(unknowns.point[d.start], unknowns.point[d.end])
                values[row] = np.append(-along, along) / (np.linalg.norm(along) or 1.0)  # no direction: no slope
            case Kind.DIFFERENCE:
                e = network.differences[i]
                columns[row, :2] = unknowns.point[e.start, e.axis], unknowns.point[e.end, e.axis]
                values[row, :2] = -1.0, 1.0
            case Kind.CAMERA:
                columns[row, 0] = unknowns.camera[i, np.searchsorted(unknowns.selection, part)]
                values[row, 0] = 1.0
            case _ if part < 3:
                columns[row, 0], values[row, 0] = unknowns.pose[i, part], 1.0
            case _:
                turned = vector_from_rotation(_given(network.images[i].rotation).T @ state.rotation[i])
                columns[row, :3] = unknowns.pose[i, 3:]
                values[row, :3] = increment_jacobian(turned)[part - 3]
    values[columns == NONE] = 0.0
    return RelationEquations(relation_residuals(relations, state), columns, values)


def _given(value: Floats | None) -> Floats:
    if value is None:  # the file reader refuses a sigma without a value
        raise ValueError("a weighted observation without a value; give the value or drop its sigma")
    return value
