"""Lines in space (skis) from points measured on their images: appendix C.2 in one step (C15), many lines at a time.

The space line is C8: Z = alpha X + gamma, Y = beta X + delta. Its direction is (1, beta, alpha) (C.3 prints another
one), and its parameters stay well-conditioned while the direction is near X, as that of a ski is.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.image_line import fit_image_lines
from photogrammetry.intersection.line_start import LineStart, start_lines
from rig.arrays import Flags, Floats

_MAX_STEPS = 25
_STEP_SIGMAS = 1e-6  # of a sigma
_STEP_RELATIVE = 1e-12  # of the distance: steps below it are rounding
_MAX_POSITION_SIGMA = 1 / 3  # of the distance: with a larger sigma the planes do not determine the line
_MIN_EIGENVALUE = 1e-13  # of the scaled normal matrix

Equations = Callable[[Floats], tuple[Floats, Floats]]


class LineState(IntEnum):
    """Result of one line."""

    OK = 0
    FEW_IMAGES = 1  #: measured in none or one image
    SINGULAR = 2  #: the planes of the images coincide within their accuracy
    ACROSS = 3  #: the line runs across the X axis; C8 cannot represent it
    NOT_CONVERGED = 4

    @property
    def words(self) -> str:
        """The state for people."""
        return _WORDS[self]


_WORDS = {
    LineState.OK: "determined",
    LineState.FEW_IMAGES: "measured in fewer than two images: measure it in another image",
    LineState.SINGULAR: "not determined: it lies in the epipolar plane of its images, or is parallel to their base; "
    "measure it in an image from elsewhere",
    LineState.ACROSS: "at right angles to the X axis: turn the object system so that X runs along the line",
    LineState.NOT_CONVERGED: "iteration did not converge: check the image lines",
}


@dataclass(frozen=True, slots=True)
class SpaceLines:
    """n lines Z = alpha X + gamma, Y = beta X + delta.

    Attributes:
        parameters: (n, 4) alpha, beta, gamma, delta; NaN where the state is FEW_IMAGES, SINGULAR or ACROSS.
        covariance: (n, 4, 4) of the parameters, from the a-priori sigmas.
        residuals: (n, m, k) distances of the line points from the adjusted image lines over sigma, adjusted - observed;
            NaN where nothing was measured.
        redundancy: (n,) number of residuals - 4.
        state: (n,) values of `LineState`.
    """

    parameters: Floats
    covariance: Floats
    residuals: Floats
    redundancy: NDArray[np.int_]
    state: NDArray[np.int8]

    @property
    def ok(self) -> Flags:
        """(n,) whether the line is determined."""
        return np.asarray(self.state == LineState.OK)

    @property
    def direction(self) -> Floats:
        """(n, 3) unit vectors along (1, beta, alpha)."""
        alpha, beta = self.parameters[:, 0], self.parameters[:, 1]
        vector = np.stack((np.ones_like(alpha), beta, alpha), axis=1)
        return np.asarray(vector / np.linalg.norm(vector, axis=1, keepdims=True))

    @property
    def vtpv(self) -> Floats:
        """(n,) weighted square sum of the residuals."""
        return np.asarray(np.nansum(self.residuals**2, axis=tuple(range(1, self.residuals.ndim))))

    def at(self, x: ArrayLike) -> Floats:
        """Points (n, 3) of the lines at X = x, one for all or (n,)."""
        alpha, beta, gamma, delta = self.parameters.T
        x = np.broadcast_to(np.asarray(x, float), alpha.shape)
        return np.stack((x, beta * x + delta, alpha * x + gamma), axis=1)

    def covariance_at(self, x: ArrayLike) -> Floats:
        """Covariance (n, 2, 2) of (Y, Z) at X = x, one for all or (n,)."""
        return _covariance_at(self.covariance, np.asarray(x, float))


def intersect_lines_in_one_step(
    cameras: Sequence[IdealCamera], xy: ArrayLike, sigma: float, *, seen: Flags | None = None
) -> SpaceLines:
    """Intersect n lines from line points in m images by one error equation C15 per point.

    C15 divided by the root of U^2 + W^2 is the distance of the point from the projected line; its square sum over all
    points is C3.

    Args:
        cameras: the m cameras, constant.
        xy: (n, m, k, 2) reduced image coordinates of k line points per image.
        sigma: standard deviation of x and y alike (C2), image unit.
        seen: (n, m, k) which points exist; all if left out.

    Returns:
        The lines, with covariance and state; start values from step A and appendix C.3.
    """
    xy = np.asarray(xy, float)
    there = np.ones(xy.shape[:-1], bool) if seen is None else np.asarray(seen, bool)
    start = start_lines(cameras, fit_image_lines(xy, sigma, seen=there))
    x, y = np.moveaxis(np.where(there[..., None], xy, 0.0), -1, 0)
    axes = np.array([camera.R for camera in cameras]).transpose(2, 0, 1)
    c = np.array([camera.c for camera in cameras])[:, None]

    def equations(parameters: Floats) -> tuple[Floats, Floats]:
        u, du = _plane_normals(parameters, start.centres)
        (big_u, d_u), (w, d_w), (v, d_v) = (
            (p[..., None], d[..., None, :]) for p, d in (_along(u, du, r) for r in axes)
        )
        w, d_w = -w, -d_w
        root = np.sqrt(big_u**2 + w**2) * sigma
        distance = (big_u * x - w * y - c * v) / root
        d_root = (big_u[..., None] * d_u + w[..., None] * d_w) * (sigma**2 / root)[..., None]
        d_closure = d_u * x[..., None] - d_w * y[..., None] - c[..., None] * d_v
        jacobian = (d_closure - distance[..., None] * d_root) / root[..., None]
        return np.where(there, -distance, 0.0), np.where(there[..., None], jacobian, 0.0)

    return _adjust(start, equations, there)


def _plane_normals(parameters: Floats, centres: Floats) -> tuple[Floats, Floats]:
    """Vectors u of C9 (n, m, 3), normals of the planes through line and centre, and derivatives (n, m, 3, 4)."""
    alpha, beta, gamma, delta = (parameters[:, i, None] for i in range(4))
    x0, y0, z0 = np.moveaxis(centres, -1, 0)
    zero, one = np.zeros_like(x0), np.ones_like(x0)
    dy, dz = delta - y0, gamma - z0
    u = np.stack((alpha * dy - beta * dz, alpha * x0 + dz, -(beta * x0 + dy)), axis=-1)
    rows = ((dy, -dz, -beta * one, alpha * one), (x0, zero, one, zero), (zero, -x0, zero, -one))
    return u, np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def _along(u: Floats, du: Floats, axis: Floats) -> tuple[Floats, Floats]:
    """Product of u and of its derivatives with axes (n, m, 3) or (m, 3)."""
    return (u * axis).sum(axis=-1), (du * axis[..., None]).sum(axis=-2)


def _adjust(start: LineStart, equations: Equations, there: Flags) -> SpaceLines:
    """Gauss-Newton of all lines together, each relative to its own origin; the result is in the object system."""
    parameters = start.parameters.copy()
    n = len(parameters)
    converged = np.zeros(n, bool)
    with np.errstate(all="ignore"):  # lines that diverge are flagged below
        for _ in range(_MAX_STEPS):
            residuals, jacobian = equations(parameters)
            flat = jacobian.reshape(n, -1, 4)
            cofactors, regular = _invert(flat.transpose(0, 2, 1) @ flat)
            gradient = np.einsum("nrp,nr->np", flat, residuals.reshape(n, -1))
            step = np.einsum("npq,nq->np", cofactors, gradient)
            parameters = parameters + step
            tiny = np.abs(step).max(axis=1) < _STEP_RELATIVE * start.distance
            converged = (np.einsum("np,np->n", step, gradient) < _STEP_SIGMAS**2) | tiny
            if (converged | ~regular).all():
                break
    state = _states(start, parameters, cofactors, converged, regular)
    lost = (state != LineState.OK) & (state != LineState.NOT_CONVERGED)
    shift = np.tile(np.eye(4), (n, 1, 1))
    shift[:, 2, 0] = shift[:, 3, 1] = -start.origins[:, 0]
    parameters = np.einsum("npq,nq->np", shift, parameters)
    parameters[:, 2] += start.origins[:, 2]
    parameters[:, 3] += start.origins[:, 1]
    parameters[lost] = np.nan
    covariance = shift @ cofactors @ shift.transpose(0, 2, 1)
    covariance[lost] = np.nan
    residuals = np.where(there, -residuals, np.nan)
    redundancy = there.reshape(n, -1).sum(axis=1) - 4
    return SpaceLines(parameters, covariance, residuals, redundancy, state)


def _invert(normal: Floats) -> tuple[Floats, Flags]:
    """Inverses of symmetric matrices (n, 4, 4) and which of them are regular; the others come as zeros."""
    diagonal = np.diagonal(normal, axis1=1, axis2=2)
    usable = np.asarray(np.isfinite(normal).all(axis=(1, 2)) & (diagonal > 0).all(axis=1))
    scale = np.where(usable[:, None], 1 / np.sqrt(np.where(usable[:, None], diagonal, 1.0)), 1.0)
    scaled = np.where(usable[:, None, None], normal * scale[:, :, None] * scale[:, None, :], np.eye(4))
    values, vectors = np.linalg.eigh(scaled)
    regular = usable & (values[:, 0] > _MIN_EIGENVALUE)
    inverse = (vectors / np.where(regular[:, None], values, 1.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    inverse *= scale[:, :, None] * scale[:, None, :]
    return np.where(regular[:, None, None], inverse, 0.0), regular


def _covariance_at(covariance: Floats, x: Floats) -> Floats:
    x = np.broadcast_to(x, covariance.shape[:1])
    zero, one = np.zeros_like(x), np.ones_like(x)
    rows = np.stack((np.stack((zero, x, zero, one), -1), np.stack((x, zero, one, zero), -1)), axis=1)
    return rows @ covariance @ rows.transpose(0, 2, 1)


def _states(
    start: LineStart, parameters: Floats, cofactors: Floats, converged: Flags, regular: Flags
) -> NDArray[np.int8]:
    position = np.linalg.eigvalsh(_covariance_at(cofactors, np.zeros(1)))[:, -1]
    slopes = (parameters[:, :2] ** 2).sum(axis=1)
    turning = cofactors[:, 0, 0] + cofactors[:, 1, 1]
    vague = position > (_MAX_POSITION_SIGMA * start.distance) ** 2
    vague |= turning > _MAX_POSITION_SIGMA**2 * (1 + slopes)
    state = np.full(len(parameters), LineState.OK, np.int8)
    state[~converged] = LineState.NOT_CONVERGED
    state[vague | ~regular] = LineState.SINGULAR
    state[start.across] = LineState.ACROSS
    state[start.coincident] = LineState.SINGULAR
    state[start.images < 2] = LineState.FEW_IMAGES
    return state
