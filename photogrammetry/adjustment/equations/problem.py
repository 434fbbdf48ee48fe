"""The observation equations of a network in units of their sigmas: image points in blocks, relations in single rows."""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from photogrammetry.adjustment.equations.relations import (
    RelationEquations,
    Relations,
    relation_equations,
    relation_residuals,
    relations_of,
)
from photogrammetry.adjustment.equations.unknowns import NONE, State, Unknowns, number_unknowns
from photogrammetry.geometry.camera_model import Distortion, Lens, camera_coordinates, linearise, residuals
from photogrammetry.network.model import Network
from rig.arrays import Floats, Integers


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """All observation equations at one state, in units of their standard deviations.

    Attributes:
        v: (n, 2) image residuals.
        by_global: (n, 2, k + 6) derivatives by the selected camera parameters and the pose.
        by_point: (n, 2, 3).
        relations: the other observations.
    """

    v: Floats
    by_global: Floats
    by_point: Floats
    relations: RelationEquations

    @property
    def square_sum(self) -> float:
        """Sum of the squared residuals in units of their standard deviations."""
        return float(np.vdot(self.v, self.v) + np.vdot(self.relations.v, self.relations.v))


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A network made ready for adjustment: image observations sorted by image, indices, weights.

    Attributes:
        network: the network, whose values are the observed ones.
        unknowns: its columns.
        order: (n,) index in the network of the image observation at each place here.
        image, point, camera: (n,) indices.
        xy: (n, 2) observed.
        sigma: (n, 2) standard deviations in use.
        start: (images + 1,) where the observations of each image begin.
        by_point: (points, n) selects the observations of a point (a row of ones).
        by_camera_point: (cameras * points, n), likewise.
        relations: the other observations.
        relation_sigma: (m,) standard deviations in use.
        balance, measured: (n,) of the lens of each image observation, see `Lens`.
    """

    network: Network
    unknowns: Unknowns
    order: Integers
    image: Integers
    point: Integers
    camera: Integers
    xy: Floats
    sigma: Floats
    start: Integers
    by_point: sparse.csr_array
    by_camera_point: sparse.csr_array
    relations: Relations
    relation_sigma: Floats
    balance: Floats
    measured: Integers

    @property
    def n_observations(self) -> int:
        """Number of single observations: two per image point, one per other."""
        return 2 * len(self.image) + len(self.relations)

    def global_columns(self) -> Integers:
        """Columns of the camera and pose unknowns of each image: (images, k + 6)."""
        cameras = [image.camera for image in self.network.images]
        return np.hstack([self.unknowns.camera[cameras], self.unknowns.pose])

    def lens(self, state: State) -> Lens:
        """The interior orientation of each observation."""
        return Lens(state.interior[self.camera], self.balance, np.asarray(self.measured, dtype=bool))

    def square_sum(self, state: State) -> float:
        """Sum of squared residuals in units of their standard deviations; not finite where a point has no image."""
        with np.errstate(all="ignore"):
            pose = state.rotation[self.image], state.position[self.image]
            v = residuals(self.lens(state), *pose, state.xyz[self.point], self.xy) / self.sigma
            w = relation_residuals(self.relations, state) / self.relation_sigma
            return float(np.vdot(v, v) + np.vdot(w, w))

    def behind(self, state: State) -> int:
        """How many observed points lie behind their camera."""
        pose = state.rotation[self.image], state.position[self.image]
        return int(np.sum(camera_coordinates(*pose, state.xyz[self.point])[:, 2] >= 0.0))

    def equations(self, state: State) -> Equations:
        """Linearise at a state."""
        pose = state.rotation[self.image], state.position[self.image]
        lines = linearise(self.lens(state), *pose, state.xyz[self.point], self.xy)
        k = len(self.unknowns.selection)
        whitener = 1.0 / self.sigma[:, :, None]
        by_global = np.empty((len(self.image), 2, k + 6))
        by_global[:, :, :k] = lines.by_interior[:, :, self.unknowns.selection]
        by_global[:, :, k:] = lines.by_pose
        by_global *= whitener
        # constants have no column; their derivatives must not be added to another unknown's
        by_global[:, :, :k] *= (self.unknowns.camera != NONE)[self.camera][:, None, :]
        by_global[:, :, k:] *= (self.unknowns.pose != NONE)[self.image][:, None, :]
        by_point = lines.by_point * (whitener * (self.unknowns.point[:, :1] != NONE)[self.point][:, None, :])
        relation = relation_equations(self.relations, self.unknowns, state)
        white = RelationEquations(
            relation.v / self.relation_sigma, relation.columns, relation.values / self.relation_sigma[:, None]
        )
        return Equations(lines.v / self.sigma, by_global, by_point, white)


def build_problem(network: Network) -> Problem:
    """Sort and index a network for adjustment; its values are the observed ones where they have a sigma."""
    observed = network.observations
    order = np.lexsort((observed.point, observed.image))
    image, point = observed.image[order], observed.point[order]
    cameras = np.array([i.camera for i in network.images], dtype=np.intp)
    camera = cameras[image] if len(image) else image
    n, n_points = len(image), len(network.points)
    relations = relations_of(network)
    balance = np.array([c.balance for c in network.cameras])
    measured = np.array([c.distortion is Distortion.MEASURED for c in network.cameras], dtype=np.intp)
    return Problem(
        network=network,
        unknowns=number_unknowns(network),
        order=order,
        image=image,
        point=point,
        camera=camera,
        xy=observed.xy[order],
        sigma=observed.sigma[order],
        start=np.searchsorted(image, np.arange(len(network.images) + 1)),
        by_point=_selector(point, n_points, n),
        by_camera_point=_selector(camera * n_points + point, len(network.cameras) * n_points, n),
        relations=relations,
        relation_sigma=relations.sigma,
        balance=balance[camera],
        measured=measured[camera],
    )


def _selector(rows: Integers, n_rows: int, n: int) -> sparse.csr_array:
    return sparse.csr_array((np.ones(n), (rows, np.arange(n))), shape=(n_rows, n))
