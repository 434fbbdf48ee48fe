"""Benchmark of the intersection of points and lines against scipy, one by one, and against numpy's batched solver."""

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.line_intersection import intersect_lines_in_one_step
from photogrammetry.intersection.point_intersection import intersect_points
from rig.arrays import Floats
from rig.images.viewing import look_at

_POINTS = 100_000
_LINES = 200
_LINE_POINTS = 12
_SIGMA_PX = 0.33
_STEPS = 4  # of the batched solver: as many as ours takes, for the same accuracy


def run_intersection(seconds: float) -> list[dict[str, Any]]:
    """Points from three rays and lines from three images of the hill, with covariance and residuals, on one core.

    Args:
        seconds: about how long in all.

    Returns:
        Cases with name, value, baseline and what the baseline is; values are intersections per second.
    """
    cameras = _hill()
    rng = np.random.default_rng(1)
    points = rng.uniform((0.0, -1.5, -5.0), (20.0, 1.5, 2.0), (_POINTS, 3))
    xy = np.stack([camera.project(points) for camera in cameras], axis=1)
    xy += rng.normal(0.0, _SIGMA_PX, xy.shape)
    line_xy = _line_points(cameras, rng)
    budget = seconds / 3
    with _one_core():
        return [
            _case(
                "points, 1/s",
                lambda: _ours(cameras, xy),
                lambda: _scipy_points(cameras, xy[:100], points),
                "scipy least_squares, one by one",
                budget,
            ),
            _case(
                "points, 1/s",
                lambda: _ours(cameras, xy),
                lambda: _batched(cameras, xy[:10_000]),
                f"numpy.linalg, batched, {_STEPS} steps from the middle of the scene",
                budget,
            ),
            _case(
                "lines, 1/s",
                lambda: len(intersect_lines_in_one_step(cameras, line_xy, _SIGMA_PX).state),
                lambda: _scipy_lines(cameras, line_xy[:20]),
                "scipy least_squares, one by one",
                budget,
            ),
        ]


def _ours(cameras: list[IdealCamera], xy: Floats) -> int:
    return len(intersect_points(cameras, xy, sigma=_SIGMA_PX).state)


def _scipy_points(cameras: list[IdealCamera], xy: Floats, start: Floats) -> int:
    for measured, first in zip(xy, start, strict=False):

        def residuals(point: Floats, measured: Floats = measured) -> Floats:
            return np.concatenate([k.project(point) - m for k, m in zip(cameras, measured, strict=True)])

        least_squares(residuals, first, method="lm", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return len(xy)


def _batched(cameras: list[IdealCamera], xy: Floats) -> int:
    """Gauss-Newton with numpy's batched solver and inverse, all points together."""
    point = np.tile((10.0, 0.0, -1.5), (len(xy), 1))
    for _ in range(_STEPS):
        rows, misclosures = [], []
        for i, camera in enumerate(cameras):
            k = (point - camera.X0) @ camera.R
            image = -camera.c * k[:, :2] / k[:, 2:]
            by_k = np.zeros((len(k), 2, 3))
            by_k[:, 0, 0] = by_k[:, 1, 1] = -camera.c / k[:, 2]
            by_k[:, :, 2] = -image / k[:, 2:]
            rows.append(by_k @ camera.R.T)
            misclosures.append(xy[:, i] - image)
        jacobian, closure = np.concatenate(rows, axis=1), np.concatenate(misclosures, axis=1)
        normal = jacobian.transpose(0, 2, 1) @ jacobian
        gradient = jacobian.transpose(0, 2, 1) @ closure[..., None]
        point = point + np.linalg.solve(normal, gradient)[..., 0]
    np.linalg.inv(normal)
    return len(xy)


def _scipy_lines(cameras: list[IdealCamera], xy: Floats) -> int:
    for measured in xy:

        def residuals(line: Floats, measured: Floats = measured) -> Floats:
            ends = np.array([(x, line[1] * x + line[3], line[0] * x + line[2]) for x in (0.0, 20.0)])
            values = []
            for camera, m in zip(cameras, measured, strict=True):
                p, q = camera.project(ends)
                across = np.array((p[1] - q[1], q[0] - p[0])) / np.linalg.norm(q - p)
                values.append((m - p) @ across)
            return np.concatenate(values)

        least_squares(residuals, (0.0, 0.0, -1.5, 0.0), method="lm", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return len(xy)


def _hill() -> list[IdealCamera]:
    """Three cameras on one side, at 44, 44 and 78 m, that look at the first 20 m of flight."""
    cameras = []
    for c, centre in ((1420.0, (-5.0, -41.0, 3.0)), (1420.0, (25.0, -41.0, -2.0)), (2493.0, (-2.0, -77.0, 9.0))):
        cameras.append(IdealCamera(c, np.array(centre), look_at(centre, (10.0, 0.0, -1.0))))
    return cameras


def _line_points(cameras: list[IdealCamera], rng: np.random.Generator) -> Floats:
    """(lines, images, points, 2) of skis, 2.6 m long."""
    middle = rng.uniform((1.0, -1.0, -4.0), (19.0, 1.0, 1.0), (_LINES, 3))
    slope = rng.uniform((1.0, -0.3, -0.3), (1.0, 0.3, 0.3), (_LINES, 3))
    along = np.linspace(-1.3, 1.3, _LINE_POINTS)
    points = middle[:, None] + along[:, None] * slope[:, None]
    xy = np.stack([camera.project(points) for camera in cameras], axis=1)
    return np.asarray(xy + rng.normal(0.0, _SIGMA_PX, xy.shape))


@contextmanager
def _one_core() -> Iterator[None]:
    """Confine this process, the threads of numpy's linear algebra included, to one core."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(allowed)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)


def _case(name: str, ours: Callable[[], int], theirs: Callable[[], int], what: str, budget: float) -> dict[str, Any]:
    """Amounts per second of both; alternating, so that other load on the machine affects both."""
    rates: tuple[list[float], list[float]] = ([], [])
    end = time.perf_counter() + budget
    while time.perf_counter() < end or not rates[0]:
        for kept, work in zip(rates, (ours, theirs), strict=True):
            before = time.perf_counter()
            amount = work()
            kept.append(amount / (time.perf_counter() - before))
    value, baseline = (float(np.median(kept)) for kept in rates)
    return {"name": name, "value": round(value), "baseline": round(baseline), "baseline_is": what}
