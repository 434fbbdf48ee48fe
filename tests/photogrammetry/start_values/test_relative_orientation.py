"""Relative orientation from nothing: five points and more, planes, noise, ambiguity."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.intersection.point_intersection import intersect_points
from photogrammetry.start_values import relative_orientation
from photogrammetry.start_values.relative_orientation import RelativeOrientation, orient_relatively
from rig.arrays import Floats
from rig.errors import BadInputError
from tests.photogrammetry.scenes import SIGMA_PX, flight_points, frame_points, hill_cameras, lab_cameras, observe

seeds = st.integers(0, 2**32 - 1)


def _pair(rng: np.random.Generator, n: int, planar: bool) -> tuple[list[IdealCamera], Floats]:
    if rng.random() < 0.5:
        cameras, points = lab_cameras(rng), frame_points(rng, n)
    else:
        cameras, points = hill_cameras(rng), flight_points(rng, n)
    if planar:
        points[:, 1] = 0.1 * points[:, 0]
    i, j = rng.choice(len(cameras), 2, replace=False)
    rolled = cameras[j].R @ rotation_from_vector(np.array([0.0, 0.0, rng.uniform(-3, 3)]))
    return [cameras[i], IdealCamera(cameras[j].c, cameras[j].X0, rolled)], points


def _true(cameras: list[IdealCamera]) -> tuple[Floats, Floats]:
    first, second = cameras
    base = first.R.T @ (second.X0 - first.X0)
    return first.R.T @ second.R, base / np.linalg.norm(base)


def _error(solution: RelativeOrientation, truth: tuple[Floats, Floats]) -> float:
    return float(np.abs(solution.rotation - truth[0]).max() + np.abs(solution.base - truth[1]).max())


@settings(max_examples=12)
@given(seeds, st.integers(5, 40), st.booleans())
def test_exact(seed: int, n: int, planar: bool) -> None:
    cameras, points = _pair(np.random.default_rng(seed), n, planar)
    xy = observe(cameras, points, np.random.default_rng(0), 0.0)
    result = orient_relatively(xy[:, 0], xy[:, 1], cameras[0].c, cameras[1].c)
    assert np.abs(result.residuals).max() < 1e-4
    assert result.in_front == 1
    if not planar:  # a plane in a narrow field of view leaves the pose open to many digits more than the residuals
        assert min(_error(s, _true(cameras)) for s in (result, *result.alternatives)) < 1e-4
    assert result.ambiguous == bool(result.alternatives)
    if n >= 8 and not planar:
        assert not result.ambiguous


@pytest.mark.long
@settings(max_examples=120)
@given(seeds, st.integers(8, 60), st.booleans())
def test_with_noise_nothing_lies_below(seed: int, n: int, planar: bool) -> None:
    rng = np.random.default_rng(seed)
    cameras, points = _pair(rng, n, planar)
    xy = observe(cameras, points, rng)
    result = orient_relatively(xy[:, 0], xy[:, 1], cameras[0].c, cameras[1].c)
    rotation, base = _true(cameras)
    u, v = (np.column_stack((xy[:, i], np.full(n, -cameras[i].c))) for i in (0, 1))
    from_truth = relative_orientation._iterate(rotation[None], base[None], u, v, 50)[2][0]
    assert result.square_sum <= from_truth * 1.001 or result.in_front > 0.99
    assert result.square_sum < 4 * SIGMA_PX**2 * n
    assert result.square_sum == pytest.approx((result.residuals**2).sum())


def test_residuals_are_those_of_the_image() -> None:
    """The square sum equals that of the four image coordinates after intersection of the points."""
    rng = np.random.default_rng(4)
    cameras = lab_cameras(rng)[:2]
    xy = observe(cameras, frame_points(rng, 30), rng)
    result = orient_relatively(xy[:, 0], xy[:, 1], cameras[0].c, cameras[1].c)
    points = intersect_points(result.cameras(cameras[0].c, cameras[1].c), xy, sigma=SIGMA_PX)
    assert points.ok.all()
    assert (points.residuals**2).sum() == pytest.approx(result.square_sum, rel=1e-3)


def test_errors_are_those_of_the_noise() -> None:
    """The vTPv over many networks has the redundancy n - 5 as mean."""
    rng = np.random.default_rng(7)
    values = []
    for _ in range(30):
        cameras = lab_cameras(rng)[:2]
        xy = observe(cameras, frame_points(rng, 30), rng)
        values.append(orient_relatively(xy[:, 0], xy[:, 1], cameras[0].c, cameras[1].c).square_sum / SIGMA_PX**2)
    assert abs(np.mean(values) - 25) < 5 * np.sqrt(2 * 25 / 30)


def test_blunders_are_left_out() -> None:
    rng = np.random.default_rng(9)
    for _ in range(8):
        cameras = lab_cameras(rng)[:2]
        xy = observe(cameras, frame_points(rng, 40), rng)
        clean = orient_relatively(xy[4:, 0], xy[4:, 1], cameras[0].c, cameras[1].c)
        xy[:4, 1] = rng.uniform(-200, 200, (4, 2))
        result = orient_relatively(xy[:, 0], xy[:, 1], cameras[0].c, cameras[1].c)
        assert _error(result, (clean.rotation, clean.base)) < 0.02
        assert result.square_sum < 40 * (3 * SIGMA_PX) ** 2
        assert np.abs(result.residuals[:4]).max() > 10


def test_bad_input_is_named() -> None:
    with pytest.raises(BadInputError, match="4 homologous points: give at least five"):
        orient_relatively(np.zeros((4, 2)), np.zeros((4, 2)), 1000.0, 1000.0)


@pytest.mark.parametrize("seed", [268, 2900])
def test_five_points_whose_closed_solutions_are_all_complex_are_refused(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = rng.uniform(-300.0, 300.0, (5, 2))
    second = first + rng.normal(0.0, 20.0, (5, 2))
    with pytest.raises(BadInputError, match="homologous points allow no relative orientation"):
        orient_relatively(first, second, 1000.0, 1000.0)


def test_equal_input_gives_equal_output() -> None:
    rng = np.random.default_rng(8)
    cameras, points = _pair(rng, 20, False)
    xy = observe(cameras, points, rng)
    first, second = (orient_relatively(xy[:, 0], xy[:, 1], cameras[0].c, cameras[1].c) for _ in range(2))
    assert (first.rotation == second.rotation).all()
    assert (first.base == second.base).all()
