"""Space resection by iteration: the least-squares pose of one image with known interior orientation and points."""

from dataclasses import dataclass

import numpy as np

from photogrammetry.ideal_camera import Array, IdealCamera
from photogrammetry.rotation import rotation_from_vector

_MAX_STEPS = 30
_DAMPING = 1e-3
_TOO_DAMPED = 1e12
_ENOUGH = 1e-9  # relative decrease of the square sum
_ROUNDING = 1e-12  # of c: residuals that small are none


@dataclass(frozen=True, slots=True)
class RefinedPose:
    """Pose with its square sum of residuals.

    Attributes:
        camera: the image's camera.
        square_sum: of the residuals, image unit squared; infinite if a point lies behind the camera.
    """

    camera: IdealCamera
    square_sum: float


def refine_pose(camera: IdealCamera, points: Array, xy: Array, steps: int = _MAX_STEPS) -> RefinedPose:
    """Damped Gauss-Newton on Eq. A1.

    Args:
        camera: start values; all points should lie in front of it.
        points: (n, 3) object coordinates.
        xy: (n, 2) reduced image coordinates.
        steps: at most so many.

    Returns:
        The pose at the minimum reached; the start values themselves if a point lies behind the camera there.
    """
    best = RefinedPose(camera, _square_sum(camera, points, xy))
    damping = _DAMPING
    nothing = len(points) * (_ROUNDING * camera.c) ** 2
    for _ in range(steps):
        if best.square_sum < nothing or not np.isfinite(best.square_sum):
            break
        residuals, jacobian = _linearised(best.camera, points, xy)
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ residuals
        damped = normal + damping * np.diag(np.diag(normal))
        step = np.asarray(np.linalg.lstsq(damped, gradient, rcond=None)[0], float)
        turned: Array = best.camera.R @ rotation_from_vector(step[3:])
        candidate = IdealCamera(camera.c, best.camera.X0 + step[:3], turned)
        square_sum = _square_sum(candidate, points, xy)
        if square_sum < best.square_sum:
            settled = square_sum > (1 - _ENOUGH) * best.square_sum
            best, damping = RefinedPose(candidate, square_sum), damping / 10
            if settled:
                break
        else:
            damping *= 10
            if damping > _TOO_DAMPED:
                break
    return best


def _square_sum(camera: IdealCamera, points: Array, xy: Array) -> float:
    if not camera.in_front(points).all():
        return np.inf
    return float(((camera.project(points) - xy) ** 2).sum())


def _linearised(camera: IdealCamera, points: Array, xy: Array) -> tuple[Array, Array]:
    """Residuals observed - computed (2 n,) and derivatives (2 n, 6) by X0 and by turns about the camera's axes."""
    k = (points - camera.X0) @ camera.R
    image = -camera.c * k[:, :2] / k[:, 2:]
    by_k = np.zeros((len(k), 2, 3))
    by_k[:, 0, 0] = by_k[:, 1, 1] = -camera.c / k[:, 2]
    by_k[:, :, 2] = -image / k[:, 2:]
    by_turn = np.cross(by_k, k[:, None, :])
    jacobian = np.concatenate((-by_k @ camera.R.T, by_turn), axis=2)
    return (xy - image).ravel(), jacobian.reshape(-1, 6)
