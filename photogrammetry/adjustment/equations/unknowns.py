"""The values that an adjustment may change, and the unknown (column of the observation equations) of each.

Order of the columns: camera parameters, poses, points. The points come last and in two parts: those that distances and
differences tie together (`kept`), then those that are eliminated one by one (`eliminated`, Schur complement).
"""

from dataclasses import dataclass

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.model import Network, Role
from rig.arrays import Flags, Floats, Integers
from rig.errors import BadInputError

NONE = -1  # the column of constants


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Values of everything that an adjustment may change, in the network's order.

    Attributes:
        interior: (cameras, 10).
        position: (images, 3).
        rotation: (images, 3, 3).
        xyz: (points, 3).
    """

    interior: Floats
    position: Floats
    rotation: Floats
    xyz: Floats


def state_of(network: Network) -> State:
    """The values that a network gives.

    Raises:
        BadInputError: a pose or point has no values; the message names it.
    """
    for image in network.images:
        if image.position is None or image.rotation is None:
            raise BadInputError(f'images.{image.name}: no start values; give "X0" and "R"')
    for point in network.points:
        if point.xyz is None:
            raise BadInputError(f'points.{point.name}: no start values; give "X"')
    return State(
        np.array([camera.interior for camera in network.cameras], dtype=float).reshape(-1, 10),
        np.array([image.position for image in network.images], dtype=float).reshape(-1, 3),
        np.array([image.rotation for image in network.images], dtype=float).reshape(-1, 3, 3),
        np.array([point.xyz for point in network.points], dtype=float).reshape(-1, 3),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Columns; -1 where the value is constant.

    Attributes:
        selection: (k,) indices into `INTERIOR` of the parameters that any camera estimates.
        camera: (cameras, k).
        pose: (images, 6).
        point: (points, 3).
        n_poses_end: number of columns before the points.
        kept: (pk,) indices of the unknown points that are not eliminated.
        eliminated: (pe,) indices of those that are.
        count: number of unknowns.
    """

    selection: Integers
    camera: Integers
    pose: Integers
    point: Integers
    n_poses_end: int
    kept: Integers
    eliminated: Integers
    count: int

    @property
    def n_kept_end(self) -> int:
        """Number of columns that stay after the elimination."""
        return self.n_poses_end + 3 * len(self.kept)

    def moved(self, state: State, step: Floats) -> State:
        """The state after a step of all unknowns (count,); rotations turn about the camera's own axes."""
        padded = np.append(step, 0.0)  # column -1: constants do not move
        interior = state.interior.copy()
        interior[:, self.selection] += padded[self.camera]
        pose = padded[self.pose]
        return State(
            interior,
            state.position + pose[:, :3],
            state.rotation @ rotation_from_vector(pose[:, 3:]),
            state.xyz + padded[self.point],
        )


def number_unknowns(network: Network) -> Unknowns:
    """Give every unknown its column."""
    estimates = [camera.estimate for camera in network.cameras]
    selection = [i for i, name in enumerate(INTERIOR) if any(name in chosen for chosen in estimates)]
    asked = np.array([[INTERIOR[i] in chosen for i in selection] for chosen in estimates], dtype=bool)
    camera, end = _columns(asked.reshape(len(estimates), len(selection)), 0)
    poses = np.array([[image.estimate] * 6 for image in network.images], dtype=bool).reshape(-1, 6)
    pose, end = _columns(poses, end)

    unknown = np.array([point.role is not Role.FIXED for point in network.points], dtype=bool)
    tied = np.zeros(len(unknown), dtype=bool)
    tied[tied_points(network).ravel()] = True
    kept, eliminated = np.flatnonzero(unknown & tied), np.flatnonzero(unknown & ~tied)
    point = np.full((len(unknown), 3), NONE, dtype=np.intp)
    ordered = np.concatenate([kept, eliminated])
    count = end + 3 * len(ordered)
    point[ordered] = np.arange(end, count).reshape(-1, 3)
    return Unknowns(np.array(selection, dtype=np.intp), camera, pose, point, end, kept, eliminated, count)


def tied_points(network: Network) -> Integers:
    """The two points (indices) of each distance and each difference: (m, 2)."""
    ends = [(d.start, d.end) for d in network.distances] + [(d.start, d.end) for d in network.differences]
    return np.array(ends, dtype=np.intp).reshape(-1, 2)


def _columns(wanted: Flags, first: int) -> tuple[Integers, int]:
    """Numbers for the True places, row by row, and the next free one."""
    columns = np.full(wanted.shape, NONE, dtype=np.intp)
    columns[wanted] = np.arange(first, first + int(wanted.sum()))
    return columns, first + int(wanted.sum())
