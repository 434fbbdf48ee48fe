"""Adjusts many small objects (points, lines in space) together, each from two observations per image.

The weights are those of the full covariance of an object's observations: image measurement and, common to all of them,
the calibration (poses and interior orientation, with their correlations). So estimates and tests are rigorous, and the
influence of the calibration on each object stays known for everything that is computed from several objects.
"""

from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import special

from rig.arrays import Flags, Floats, Integers

_MOST_STEPS = 15
_STEP_SIGMAS = 1e-4  # of a sigma
_STEP_RELATIVE = 1e-11  # of the distance from the cameras: smaller steps are rounding
_MIN_EIGENVALUE = 1e-12  # of the scaled normal matrix
_LARGEST_SIGMA = 1 / 5  # of the reach: with a larger one the rays or planes coincide within their accuracy
_LINEAR_WITHIN = 2.0  # standard deviations
_NOT_LINEAR = 1.0  # standard deviations by which a result may miss its place there
_CONTROLLED = 1e-7  # part of the weight of an observation below which nothing controls it


class Condition(IntEnum):
    """What became of an object."""

    OK = 0
    FEW_IMAGES = 1  #: in sight of fewer than two cameras
    UNDETERMINED = 2  #: the rays or planes coincide within their accuracy
    IMPOSSIBLE = 3  #: behind a camera, the iteration does not converge, or images contradict each other
    UNCONTROLLED = 4  #: too few images control it, and the motion over time contradicts it


@dataclass(frozen=True, slots=True, eq=False)
class Equations:
    """Linearised observations of n objects in m images, px.

    Attributes:
        v: (n, m, 2) computed - observed.
        by_object: (n, m, 2, u) derivatives by the object's local parameters.
        by_calibration: (n, m, 2, p) derivatives by the cameras' uncertain parameters.
        covariance: (n, m, 2, 2) of the image measurement.
        in_front: (n, m) whether the object is before the camera.
    """

    v: Floats
    by_object: Floats
    by_calibration: Floats
    covariance: Floats
    in_front: Flags


class Objects(Protocol):
    """n objects of one kind, measured in m images."""

    @property
    def seen(self) -> Flags:
        """(n, m) where they were measured."""

    def start(self, seen: Flags) -> Floats:
        """Approximate states (n, s), from the images `seen` (n, m)."""

    def equations(self, state: Floats) -> Equations:
        """Observations, linearised at the states (n, s)."""

    def moved(self, state: Floats, step: Floats) -> Floats:
        """States (n, s) changed by steps (n, u) of the local parameters."""

    def reach(self, state: Floats) -> Floats:
        """Sizes (n, u) of the local parameters, of which a standard deviation must be a small part."""

    def subset(self, rows: Integers) -> "Objects":
        """The objects `rows`, which may repeat."""


@dataclass(frozen=True, slots=True, eq=False)
class Adjusted:
    """n adjusted objects.

    Attributes:
        state: (n, s).
        covariance: (n, u, u) of the local parameters, from everything.
        image_covariance: (n, u, u) the part that comes from the image measurement.
        by_calibration: (n, u, p) change of the parameters by errors of the calibration.
        chi_square: (n,) of the residuals; NaN where they have no minimum.
        redundancy: (n,).
        calibration_share: (n,) part of the expected chi-square that comes from errors of the calibration.
        residual: (n, m) length of the residuals of each image, px.
        w: (n, m) test value of each image: standard normal where nothing is wrong, NaN where nothing controls it.
        condition: (n,) values of `Condition`; where it is not OK, the numbers mean nothing.
    """

    state: Floats
    covariance: Floats
    image_covariance: Floats
    by_calibration: Floats
    chi_square: Floats
    redundancy: NDArray[np.int_]
    calibration_share: Floats
    residual: Floats
    w: Floats
    condition: NDArray[np.int8]

    @property
    def ok(self) -> Flags:
        """(n,) whether the object is determined."""
        return np.asarray(self.condition == Condition.OK)


@dataclass(frozen=True, slots=True, eq=False)
class _Solution:
    """One step of all objects."""

    step: Floats
    gain: Floats
    cofactors: Floats
    weight: Floats
    design: Floats
    v: Floats
    regular: Flags


def adjust(objects: Objects, calibration: Floats, seen: Flags | None = None) -> Adjusted:
    """Adjust objects by least squares.

    Args:
        objects: n objects in m images.
        calibration: (p, p) covariance of the cameras' uncertain parameters.
        seen: (n, m) which images to use; all that exist if left out.
    """
    seen = objects.seen if seen is None else objects.seen & seen
    with np.errstate(all="ignore"):  # objects that are not determined are told by their condition
        state = objects.start(seen)
        converged = np.zeros(len(state), bool)
        for _ in range(_MOST_STEPS):
            equations = objects.equations(state)
            solution = _solve(equations, calibration, seen)
            size = np.einsum("nu,nur,nr->n", solution.step, _inverse_of(solution), solution.step)
            tiny = np.abs(solution.step).max(axis=1) < _STEP_RELATIVE * np.abs(state).max(axis=1)
            converged = (size < _STEP_SIGMAS**2) | tiny
            if (converged | ~solution.regular).all():
                break
            state = objects.moved(state, np.where(converged[:, None], 0.0, solution.step))
        condition = np.full(len(state), Condition.OK, np.int8)
        condition[~converged | (~equations.in_front & seen).any(axis=1)] = Condition.IMPOSSIBLE
        condition[~solution.regular | _vague(objects, state, solution, calibration, seen)] = Condition.UNDETERMINED
        condition[seen.sum(axis=1) < 2] = Condition.FEW_IMAGES
        return _result(state, solution, equations, seen, condition, converged & solution.regular)


def _vague(objects: Objects, state: Floats, solution: _Solution, calibration: Floats, seen: Flags) -> Flags:
    """(n,) whether standard deviations mean nothing: too large, or their size depends on the errors themselves.

    The latter is tried where the object is weakest: if the observations change so that the result should move by some
    standard deviations, does it?
    """
    reach = objects.reach(state)
    covariance = np.nan_to_num(solution.cofactors / reach[:, :, None] / reach[:, None, :])
    values, vectors = np.linalg.eigh(covariance)
    sigma = np.sqrt(np.maximum(values[:, -1], 0.0))
    far = np.repeat((-_LINEAR_WITHIN, _LINEAR_WITHIN), len(state))
    twice = np.tile(np.arange(len(state)), 2)
    step = (far * sigma[twice])[:, None] * (vectors[:, :, -1] * reach)[twice]
    there = objects.subset(twice)
    change = (solution.design[twice] @ step[..., None]).reshape(-1, seen.shape[1], 2)
    equations = there.equations(there.moved(state[twice], step))
    rest = _solve(replace(equations, v=equations.v - change), calibration, seen[twice]).step / reach[twice]
    linear = np.linalg.norm(rest, axis=1) < _NOT_LINEAR * sigma[twice]
    steady = (sigma < _LARGEST_SIGMA) & linear.reshape(2, -1).all(axis=0)
    return np.asarray(~steady)


def _inverse_of(solution: _Solution) -> Floats:
    return np.asarray(np.swapaxes(solution.design, 1, 2) @ solution.weight @ solution.design)


def _solve(equations: Equations, calibration: Floats, seen: Flags) -> _Solution:
    n, m = seen.shape
    design = _rows(equations.by_object, seen)
    influence = _rows(equations.by_calibration, seen)
    v = np.where(seen[..., None], equations.v, 0.0).reshape(n, 2 * m)
    covariance = influence @ calibration @ np.swapaxes(influence, 1, 2)
    own = np.where(seen[..., None, None], equations.covariance, np.eye(2))
    for image in range(m):
        covariance[:, 2 * image : 2 * image + 2, 2 * image : 2 * image + 2] += own[:, image]
    everything = np.concatenate((covariance, design, v[..., None]), axis=2)
    usable = np.asarray(np.isfinite(everything).all(axis=(1, 2)))
    design, v = np.where(usable[:, None, None], design, 0.0), np.where(usable[:, None], v, 0.0)
    weight = np.linalg.inv(np.where(usable[:, None, None], covariance, np.eye(2 * m)))
    projected = np.swapaxes(design, 1, 2) @ weight
    cofactors, regular = _invert(projected @ design)
    gain = cofactors @ projected
    step = -np.einsum("nur,nr->nu", gain, v)
    return _Solution(step, gain, cofactors, weight, design, v, regular & usable)


def _rows(derivatives: Floats, seen: Flags) -> Floats:
    """Derivatives (n, m, 2, k) as (n, 2 m, k), zero where nothing was seen."""
    n, m, _, k = derivatives.shape
    return np.where(seen[..., None, None], derivatives, 0.0).reshape(n, 2 * m, k)


def _invert(normal: Floats) -> tuple[Floats, Flags]:
    """Inverses of symmetric matrices (n, u, u) and which of them are regular; the others come as zeros."""
    diagonal = np.diagonal(normal, axis1=1, axis2=2)
    usable = np.asarray((diagonal > 0).all(axis=1))
    scale = np.where(usable[:, None], 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)), 1.0)
    unit = np.eye(normal.shape[1])
    scaled = np.where(usable[:, None, None], normal * scale[:, :, None] * scale[:, None, :], unit)
    values, vectors = np.linalg.eigh(scaled)
    regular = usable & (values[:, 0] > _MIN_EIGENVALUE)
    inverse = (vectors / np.where(regular[:, None], values, 1.0)[:, None, :]) @ np.swapaxes(vectors, 1, 2)
    inverse *= scale[:, :, None] * scale[:, None, :]
    return np.where(regular[:, None, None], inverse, 0.0), regular


def _result(
    state: Floats,
    solution: _Solution,
    equations: Equations,
    seen: Flags,
    condition: NDArray[np.int8],
    minimal: Flags,
) -> Adjusted:
    n, m = seen.shape
    gain, weight, v = solution.gain, solution.weight, solution.v
    own = np.where(seen[..., None, None], equations.covariance, 0.0)
    of_image = gain.reshape(n, gain.shape[1], m, 2)
    image_covariance = np.einsum("numa,nmab,nrmb->nur", of_image, own, of_image)
    influence = -gain @ _rows(equations.by_calibration, seen)
    # weighted residuals and their covariance: W v and W - W A N^-1 A^T W
    force = np.einsum("nrs,ns->nr", weight, v)
    spread = weight - weight @ solution.design @ gain
    redundancy = 2 * seen.sum(axis=1) - gain.shape[1]
    of_images = np.einsum("nmab,nmab->n", _blocks(spread), own)
    residual = np.where(seen, np.linalg.norm(v.reshape(n, m, 2), axis=2), np.nan)
    return Adjusted(
        state,
        solution.cofactors,
        image_covariance,
        influence,
        np.where(minimal, np.einsum("nr,nr->n", force, v), np.nan),
        redundancy,
        1 - of_images / np.maximum(redundancy, 1),
        residual,
        np.where(seen, _tests(force.reshape(n, m, 2), _blocks(spread), _blocks(weight)), np.nan),
        condition,
    )


def _blocks(matrix: Floats) -> Floats:
    """Diagonal blocks (n, m, 2, 2) of (n, 2 m, 2 m)."""
    n, size, _ = matrix.shape
    return np.asarray(np.einsum("nmamb->nmab", matrix.reshape(n, size // 2, 2, size // 2, 2)))


def _tests(force: Floats, spread: Floats, weight: Floats) -> Floats:
    """Test values (n, m) of images, from chi-squares with as many degrees of freedom as there is control (0 to 2).

    A chi-square is given as the normal deviate of the same two-sided probability, so that all can be compared.
    """
    values, vectors = np.linalg.eigh(np.where(np.isfinite(spread), spread, 0.0))
    there = values > _CONTROLLED * np.linalg.norm(weight, axis=(2, 3))[..., None]
    along = np.einsum("nmab,nma->nmb", vectors, force)
    chi_square = np.where(there, along**2 / np.where(there, values, 1.0), 0.0).sum(axis=2)
    two = -special.ndtri_exp(-chi_square / 2 - np.log(2.0))
    return np.asarray(np.select([there.all(axis=2), there.any(axis=2)], [two, np.sqrt(chi_square)], np.nan))
