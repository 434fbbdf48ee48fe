"""Lines in space in two steps, as appendix C.2 prints it: an independent check of the one-step solution."""

from collections.abc import Sequence

import numpy as np

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.image_line import ImageLines
from photogrammetry.intersection.line_intersection import SpaceLines, _adjust, _along, _plane_normals
from photogrammetry.intersection.line_start import start_lines
from rig.arrays import Floats


def intersect_lines(cameras: Sequence[IdealCamera], lines: ImageLines) -> SpaceLines:
    """Intersect n lines from m images (step B): least squares C14 on C13, correlation of (a, b) respected.

    Args:
        cameras: the m cameras, constant.
        lines: (n, m) image lines of step A.

    Returns:
        The lines, with covariance and state; start values are found by appendix C.3. Residuals (n, m, 2) are those of
        the decorrelated (a, b).
    """
    start = start_lines(cameras, lines)
    with np.errstate(all="ignore"):
        weights = np.where(lines.present[..., None, None], _inverse_root(lines.covariance), 0.0)
    turned = lines.turned[..., None]
    r1, r2, r3 = np.array([camera.R for camera in cameras]).transpose(2, 0, 1)
    axes = (np.where(turned, r2, r1), np.where(turned, -r1, r2), np.broadcast_to(r3, (*lines.a.shape, 3)))
    observed = np.nan_to_num(np.stack((lines.a, lines.b), axis=-1))
    c = np.array([camera.c for camera in cameras])

    def equations(parameters: Floats) -> tuple[Floats, Floats]:
        u, du = _plane_normals(parameters, start.centres)
        (big_u, d_u), (w, d_w), (v, d_v) = (_along(u, du, axis) for axis in axes)
        w, d_w = -w, -d_w
        a, b = big_u / w, -c * v / w
        d_a = (d_u - a[..., None] * d_w) / w[..., None]
        d_b = (-c[:, None] * d_v - b[..., None] * d_w) / w[..., None]
        misclosure = observed - np.stack((a, b), axis=-1)
        jacobian = np.stack((d_a, d_b), axis=-2)
        return np.einsum("nmij,nmj->nmi", weights, misclosure), weights @ jacobian

    return _adjust(start, equations, np.repeat(lines.present[..., None], 2, axis=-1))


def _inverse_root(covariance: Floats) -> Floats:
    """Lower triangular L (..., 2, 2) with L K L^T = I."""
    p, q, r = covariance[..., 0, 0], covariance[..., 0, 1], covariance[..., 1, 1]
    first = 1 / np.sqrt(p)
    second = 1 / np.sqrt(r - q * q / p)
    out = np.zeros_like(covariance)
    out[..., 0, 0], out[..., 1, 0], out[..., 1, 1] = first, -second * q / p, second
    return out
