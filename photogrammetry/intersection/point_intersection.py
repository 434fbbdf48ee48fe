"""Intersects points from two or more rays: appendix C.1, for many points at a time.

Repeated least squares on the error equations C5: first with P = 1, then with P = depth^-2. Where these two steps end is
not yet the minimum of C3: they neglect the residual in the derivative, an error of about epsilon / c of a sigma. So the
last steps are Gauss-Newton on Eq. A1: the adjusted image coordinates take the place of the measured ones in C5.

The normal matrix of one image is linear in (1, x, y, x^2 + y^2), with coefficients that depend on the camera alone.
So a matrix product builds the normal equations of all points at once, and a closed 3 x 3 solution solves them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from photogrammetry.geometry.ideal_camera import IdealCamera
from rig.arrays import Flags, Floats
from rig.errors import BadInputError

CHUNK = 4096  # points at a time: all intermediate arrays stay in the cache
_MAX_STEPS = 12
_STEP_SIGMAS = 1e-6  # of a sigma; a shorter step ends the iteration
_STEP_DEPTHS = 1e-13  # of the depth; a shorter step is rounding and ends it too
_MAX_DEPTH_SIGMA = 1 / 3  # of the distance: with a larger sigma the point may as well be at infinity
_PAIRS = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
_ROWS, _COLUMNS = (np.array(index) for index in zip(*_PAIRS, strict=True))


class PointState(IntEnum):
    """Result of one intersection."""

    OK = 0
    FEW_RAYS = 1  #: none or one ray
    PARALLEL = 2  #: the rays are parallel within their accuracy: the distance is not determined
    BEHIND = 3  #: the rays meet behind a camera: a wrong correspondence, or a wrong pose
    NOT_CONVERGED = 4

    @property
    def words(self) -> str:
        """The state for people."""
        return _WORDS[self]


_WORDS = {
    PointState.OK: "determined",
    PointState.FEW_RAYS: "fewer than two rays: measure the point in another image",
    PointState.PARALLEL: "rays parallel within their accuracy: add an image from another direction",
    PointState.BEHIND: "rays meet behind a camera: check the correspondence of the image points",
    PointState.NOT_CONVERGED: "iteration did not converge: check the image points",
}


@dataclass(frozen=True, slots=True)
class IntersectedPoints:
    """Result of n intersections in m images.

    Attributes:
        X: (n, 3) coordinates; NaN where the state is FEW_RAYS or PARALLEL.
        covariance: (n, 3, 3) from the a-priori sigmas; NaN like X.
        residuals: (n, m, 2) adjusted - observed, image unit; NaN for missing rays.
        state: (n,) values of `PointState`.
    """

    X: Floats
    covariance: Floats
    residuals: Floats
    state: NDArray[np.int8]

    @property
    def ok(self) -> Flags:
        """(n,) whether the point is determined and in front of its cameras."""
        return np.asarray(self.state == PointState.OK)

    @property
    def sigma(self) -> Floats:
        """(n, 3) standard deviations of X, Y, Z."""
        return np.sqrt(np.diagonal(self.covariance, axis1=1, axis2=2))


def intersect_points(
    cameras: Sequence[IdealCamera],
    xy: ArrayLike,
    *,
    seen: Flags | None = None,
    sigma: ArrayLike = 1.0,
) -> IntersectedPoints:
    """Intersect n points from m images with constant orientations (appendix C.1).

    Args:
        cameras: the m cameras.
        xy: (n, m, 2) reduced image coordinates; values where `seen` is false do not matter.
        seen: (n, m) which rays exist; all if left out.
        sigma: standard deviation of x and y alike (C2), image unit: one, one per image, or (n, m).

    Returns:
        The points: least-squares solution of C3 to 1e-6 of a sigma.

    Raises:
        BadInputError: shapes do not fit, a sigma is not positive, or a measured coordinate is not finite.
    """
    xy, weight = _checked(len(cameras), np.asarray(xy, float), seen, np.asarray(sigma, float))
    n, m = weight.shape
    system = _System(cameras)
    out = IntersectedPoints(np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, m, 2)), np.empty(n, np.int8))
    with np.errstate(all="ignore"):  # singular systems are flagged below
        for first in range(0, n, CHUNK):
            part = slice(first, first + CHUNK)
            system.intersect(xy[part], weight[part], out, part)
    if seen is not None:
        out.residuals[~seen] = np.nan
    return out


def _checked(m: int, xy: Floats, seen: Flags | None, sigma: Floats) -> tuple[Floats, Floats]:
    """Image coordinates without NaN and weights (n, m), 0 for missing rays."""
    if xy.ndim != 3 or xy.shape[1:] != (m, 2):
        raise BadInputError(f"image coordinates have shape {xy.shape}: give (points, {m} images, 2)")
    if not (sigma > 0).all():
        raise BadInputError("sigma of an image point is not positive: give the standard deviation in the image unit")
    try:
        weight = np.broadcast_to(sigma**-2, xy.shape[:2])
    except ValueError:
        raise BadInputError(f"sigma has shape {sigma.shape}: give one, {m}, or {xy.shape[:2]} of them") from None
    if seen is not None:
        weight = np.where(seen, weight, 0.0)
        xy = np.where(seen[..., None], xy, 0.0)
    if not np.isfinite(xy).all():
        point, image = np.argwhere(~np.isfinite(xy).all(axis=2))[0]
        raise BadInputError(f"ray {image} of point {point} is not a number: mark missing rays in `seen`")
    return xy, weight


class _System:
    """Constant coefficients of m cameras; coordinates relative to the centroid of the projection centres."""

    def __init__(self, cameras: Sequence[IdealCamera]) -> None:
        centres = np.array([camera.X0 for camera in cameras])
        self.origin = centres.mean(axis=0)
        centres = centres - self.origin
        self.c = np.array([camera.c for camera in cameras])[:, None]
        r1, r2, r3 = np.array([camera.R for camera in cameras]).transpose(2, 0, 1)
        c = self.c[:, :, None]
        outer = np.einsum("fmi,mj->fmij", np.array([r1, r2, r3]), r3)
        plane = np.einsum("mi,mj->mij", r1, r1) + np.einsum("mi,mj->mij", r2, r2)
        #: (4, m, 3, 3): of the normal matrix, for the features w, w x, w y, w (x^2 + y^2)
        parts = np.array([c**2 * plane, *(c * (outer[:2] + outer[:2].swapaxes(2, 3))), outer[2]])
        right = np.einsum("fmij,mj->fmi", parts, centres)
        upper = parts[:, :, _ROWS, _COLUMNS]
        #: (9, 4 m): six elements of the normal matrix and three of the right-hand side
        self.direct = np.concatenate((upper, right), axis=2).reshape(-1, 9).T.copy()
        self.normal = self.direct[:6].copy()
        #: (3 m, 3) and (3 m, 1): depth and the two other coordinates in the camera systems
        self.axes = np.concatenate((r1, r2, r3))
        self.offset = np.einsum("fmi,mi->fm", np.array([r1, r2, r3]), centres).reshape(-1, 1)
        #: (3, 3 m): gradient for the features e_x / depth, e_y / depth, (x e_x + y e_y) / depth
        self.gradient = -np.concatenate((self.c * r1, self.c * r2, r3)).T.copy()

    def intersect(self, xy: Floats, weight: Floats, out: IntersectedPoints, part: slice) -> None:
        """Solve for one chunk of points and put the results in place."""
        n, m = weight.shape
        x, y = np.ascontiguousarray(xy.transpose(2, 1, 0))
        w = np.ascontiguousarray(weight.T)
        point = self._linear(x, y, w)
        point = self._linear(x, y, w / ((self.axes[2 * m :] @ point - self.offset[2 * m :]) ** 2))
        converged = np.zeros(n, bool)
        for _ in range(_MAX_STEPS):
            point, step, cofactors, residuals, depth = self._gauss_newton(point, x, y, w)
            converged = step < _STEP_SIGMAS**2
            if converged.all() or not (np.isfinite(step) & ~converged).any():
                break
        out.X[part] = point.T + self.origin
        out.covariance[part][:, _ROWS, _COLUMNS] = cofactors.T
        out.covariance[part][:, _COLUMNS, _ROWS] = cofactors.T
        out.residuals[part] = residuals.transpose(2, 1, 0)
        state = self._state(point, cofactors, depth, w, converged)
        out.state[part] = state
        lost = (state == PointState.FEW_RAYS) | (state == PointState.PARALLEL)
        if lost.any():
            for result in (out.X, out.covariance, out.residuals):
                result[part][lost] = np.nan

    def _linear(self, x: Floats, y: Floats, w: Floats) -> Floats:
        """Error equations C5 with weights w (m, n): points (3, n)."""
        system = self.direct @ np.concatenate((w, w * x, w * y, w * (x * x + y * y)))
        return _solve(_invert(system[:6]), system[6:])

    def _gauss_newton(self, point: Floats, x: Floats, y: Floats, w: Floats) -> tuple[Floats, ...]:
        """One step with the adjusted coordinates: points, squared step in sigmas, cofactors, residuals, depths."""
        m = len(self.c)
        local = (self.axes @ point - self.offset).reshape(3, m, -1)
        inverse = 1.0 / local[2]
        scaled = -self.c * inverse
        xa, ya = local[0] * scaled, local[1] * scaled
        ex, ey = x - xa, y - ya
        wi = w * inverse
        wii = wi * inverse
        normal = self.normal @ np.concatenate((wii, wii * xa, wii * ya, wii * (xa * xa + ya * ya)))
        gradient = self.gradient @ np.concatenate((wi * ex, wi * ey, wi * (xa * ex + ya * ey)))
        cofactors = _invert(normal)
        delta = _solve(cofactors, gradient)
        sigmas = np.einsum("in,in->n", delta, gradient)
        sigmas[np.abs(delta).max(axis=0) < _STEP_DEPTHS * np.abs(local[2]).min(axis=0)] = 0.0
        return point + delta, sigmas, cofactors, -np.stack((ex, ey)), local[2]

    def _state(self, point: Floats, cofactors: Floats, depth: Floats, w: Floats, converged: Flags) -> NDArray[np.int8]:
        present = w > 0
        variance = np.abs(cofactors[0]) + np.abs(cofactors[3]) + np.abs(cofactors[5])
        nearest = np.where(present, np.abs(depth), np.inf).min(axis=0)
        state = np.full(point.shape[1], PointState.OK, np.int8)
        state[~converged] = PointState.NOT_CONVERGED
        state[((depth > 0) & present).any(axis=0)] = PointState.BEHIND
        state[~(variance < (_MAX_DEPTH_SIGMA * nearest) ** 2)] = PointState.PARALLEL
        state[np.count_nonzero(present, axis=0) < 2] = PointState.FEW_RAYS
        return state


def _invert(normal: Floats) -> Floats:
    """Inverses (6, n) of symmetric matrices given by their upper triangles (6, n)."""
    a, b, c, d, e, f = normal
    out = np.empty_like(normal)
    out[0] = d * f - e * e
    out[1] = c * e - b * f
    out[2] = b * e - c * d
    out[3] = a * f - c * c
    out[4] = b * c - a * e
    out[5] = a * d - b * b
    out /= a * out[0] + b * out[1] + c * out[2]
    return out


def _solve(inverse: Floats, right: Floats) -> Floats:
    a, b, c, d, e, f = inverse
    x, y, z = right
    return np.stack((a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z))
