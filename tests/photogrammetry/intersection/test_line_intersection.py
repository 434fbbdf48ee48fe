"""Appendix C.2 and C.3: image lines and space lines against truth, Monte Carlo and each other."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.intersection.image_line import ImageLines, fit_image_lines
from photogrammetry.intersection.line_intersection import LineState, SpaceLines, intersect_lines_in_one_step
from photogrammetry.intersection.line_start import start_lines
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.images.viewing import look_at
from tests.photogrammetry.scenes import SIGMA_PX, Ski, hill_cameras, ski
from tests.photogrammetry.two_steps import intersect_lines

seeds = st.integers(0, 2**32 - 1)
POINTS = 12


def _line_points(cameras: list[IdealCamera], skis: list[Ski], rng: np.random.Generator, sigma: float) -> Floats:
    """(n, m, k, 2): each image has its own points along the ski; correspondence along the line is not needed."""
    out = []
    for one in skis:
        along = one.points(400)
        images = [camera.project(along[np.sort(rng.choice(400, POINTS, replace=False))]) for camera in cameras]
        out.append(np.stack(images))
    xy = np.stack(out)
    return np.asarray(xy + rng.normal(0.0, sigma, xy.shape) if sigma else xy)


def _parameters(skis: list[Ski]) -> Floats:
    return np.array([one.parameters for one in skis])


def _nearby(lines: SpaceLines, skis: list[Ski]) -> Floats:
    """Differences of slopes and of (Y, Z) in the middle of the ski: well-conditioned, unlike gamma and delta."""
    x = np.array([one.x for one in skis])
    truth = np.array([one.points(3)[1] for one in skis])
    return np.hstack((lines.parameters[:, :2] - _parameters(skis)[:, :2], (lines.at(x) - truth)[:, 1:]))


@settings(max_examples=20)
@given(seeds)
def test_exact_without_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cameras = hill_cameras(rng)
    skis = [ski(rng) for _ in range(6)]
    xy = _line_points(cameras, skis, rng, 0.0)
    lines = fit_image_lines(xy, SIGMA_PX)
    for result in (intersect_lines(cameras, lines), intersect_lines_in_one_step(cameras, xy, SIGMA_PX)):
        # from one side a level ski lies near the epipolar planes: then that is said
        assert (result.ok | (result.state == LineState.SINGULAR)).all()
        assert result.ok.sum() >= 3
        assert np.nanmax(np.abs(_nearby(result, skis))) < 1e-8
        assert result.vtpv.max() < 1e-10
    start = start_lines(cameras, lines)
    difference = start.parameters[:, :2] - _parameters(skis)[:, :2]
    assert np.abs(difference[~start.coincident]).max() < 1e-7


@settings(max_examples=20)
@given(seeds)
def test_two_steps_and_one_step_agree(seed: int) -> None:
    """Step A neglects second-order terms of the noise only: both agree within a few hundredths of a sigma."""
    rng = np.random.default_rng(seed)
    cameras = hill_cameras(rng)
    skis = [ski(rng) for _ in range(6)]
    xy = _line_points(cameras, skis, rng, SIGMA_PX)
    two = intersect_lines(cameras, fit_image_lines(xy, SIGMA_PX))
    one = intersect_lines_in_one_step(cameras, xy, SIGMA_PX)
    ok = one.ok & two.ok
    assert ok.sum() >= 3
    sigma = np.sqrt(np.diagonal(one.covariance[ok], axis1=1, axis2=2))
    assert np.abs((one.parameters - two.parameters)[ok] / sigma).max() < 0.05
    np.testing.assert_allclose(np.sqrt(np.diagonal(two.covariance[ok], axis1=1, axis2=2)), sigma, rtol=0.1)
    assert (one.redundancy == 3 * POINTS - 4).all()
    assert (two.redundancy == 2).all()


def test_c9_is_the_projection_of_the_line() -> None:
    """A line put through C9 and two of its points put through A1 give the same image line."""
    rng = np.random.default_rng(8)
    cameras = hill_cameras(rng)
    skis = [ski(rng) for _ in range(5)]
    for one in skis:
        alpha, beta, gamma, delta = one.parameters
        for camera in cameras:
            (x0, y0, z0), (r1, r2, r3) = camera.X0, camera.R.T
            u = np.array(
                [alpha * (delta - y0) - beta * (gamma - z0), alpha * x0 + gamma - z0, -(beta * x0 + delta - y0)]
            )
            a, b = -(u @ r1) / (u @ r2), camera.c * (u @ r3) / (u @ r2)
            x, y = camera.project(one.points(2)).T
            np.testing.assert_allclose(y, a * x + b, atol=1e-8)


@pytest.mark.parametrize("images", [2, 3])
@pytest.mark.parametrize("one_step", [False, True])
def test_errors_follow_the_covariance(images: int, one_step: bool) -> None:
    rng = np.random.default_rng(21)
    n = 4000
    cameras = hill_cameras(rng)[:images]
    single = ski(rng)
    sigma = 0.05  # small: beta is weak from one side, and its second order would show beside 1 / sqrt(n)

    def run(xy: Floats) -> SpaceLines:
        if one_step:
            return intersect_lines_in_one_step(cameras, xy, sigma)
        return intersect_lines(cameras, fit_image_lines(xy, sigma))

    exact = _line_points(cameras, [single], rng, 0.0)
    result = run(exact + rng.normal(0.0, sigma, (n, *exact.shape[1:])))
    assert result.ok.all()
    errors = result.parameters - single.parameters
    # mean test value of 4 parameters from n samples: 4 +- sqrt(8 / n); five sigmas
    mean_covariance = run(exact).covariance[0]
    test_values = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(mean_covariance), errors)
    assert abs(test_values.mean() - 4) < 5 * np.sqrt(8 / n)
    empirical = np.cov(errors.T)
    scale = np.sqrt(np.diag(mean_covariance))
    np.testing.assert_allclose(empirical / np.outer(scale, scale), mean_covariance / np.outer(scale, scale), atol=0.12)
    redundancy = result.redundancy[0]
    assert abs(result.vtpv.mean() - redundancy) < 5 * np.sqrt(2 * max(redundancy, 1) / n)
    position = (result.at(single.x) - single.points(3)[1])[:, 1:]
    predicted = result.covariance_at(single.x)[0]
    np.testing.assert_allclose(np.cov(position.T), predicted, atol=0.12 * np.abs(predicted).max())


def _steep_lines_camera(rng: np.random.Generator) -> list[IdealCamera]:
    return [
        IdealCamera(k.c, k.X0, k.R @ rotation_from_vector(np.array((0.0, 0.0, roll))))
        for k, roll in zip(hill_cameras(rng), (np.pi / 2, 1.0, -2.0), strict=True)
    ]


def test_rolled_cameras_make_steep_image_lines_and_change_nothing() -> None:
    rng = np.random.default_rng(4)
    cameras = _steep_lines_camera(rng)
    skis = [ski(rng) for _ in range(20)]
    xy = _line_points(cameras, skis, rng, SIGMA_PX)
    lines = fit_image_lines(xy, SIGMA_PX)
    assert lines.turned[:, 0].all()
    assert np.abs(lines.a).max() <= 1
    two = intersect_lines(cameras, lines)
    one = intersect_lines_in_one_step(cameras, xy, SIGMA_PX)
    sigma = np.sqrt(np.diagonal(one.covariance, axis1=1, axis2=2))
    assert np.abs((one.parameters - two.parameters) / sigma).max() < 0.05
    g = lines.homogeneous()
    on_line = np.einsum("nmc,nmc->nm", g[..., :2], lines.centre) + g[..., 2]
    np.testing.assert_allclose(on_line, 0, atol=1e-9)


def test_missing_lines() -> None:
    rng = np.random.default_rng(14)
    cameras = hill_cameras(rng)
    skis = [ski(rng) for _ in range(3)]
    xy = _line_points(cameras, skis, rng, SIGMA_PX)
    seen = np.ones((3, 3, POINTS), bool)
    seen[0, 2] = False
    seen[1, 0, 1:-1] = False  # two points still make a line
    seen[2, :2] = False
    seen[2, 1, 0] = True  # one does not
    xy[~seen] = np.nan
    for result in (
        intersect_lines(cameras, fit_image_lines(xy, SIGMA_PX, seen=seen)),
        intersect_lines_in_one_step(cameras, xy, SIGMA_PX, seen=seen),
    ):
        assert list(result.state) == [LineState.OK, LineState.OK, LineState.FEW_IMAGES]
        assert np.isnan(result.parameters[2]).all()
        alone = intersect_lines(cameras[:2], fit_image_lines(xy[:1, :2], SIGMA_PX))
        sigma = np.sqrt(np.diagonal(alone.covariance, axis1=1, axis2=2))
        assert np.abs((result.parameters[:1] - alone.parameters) / sigma).max() < 0.05


@pytest.mark.parametrize("sigma", [0.0, SIGMA_PX])
def test_line_parallel_to_the_base_is_singular(sigma: float) -> None:
    """Two cameras whose base runs along the ski; and any line in one epipolar plane."""
    rng = np.random.default_rng(6)
    target = np.array([10.0, 0.0, 0.0])
    cameras = [
        IdealCamera(1420.0, centre, look_at(centre, target))
        for centre in (np.array([0.0, -44.0, 2.0]), np.array([20.0, -44.0, 2.0]))
    ]
    parallel = Ski(np.array([0.0, 0.0, -1.0, 0.5]), 10.0)
    # the epipolar plane through the base (along X) and the point (10, 0, -1): Z = 2 - 3 (Y + 44) / 44
    beta = 0.2
    coplanar = Ski(np.array([-3 / 44 * beta, beta, -1.0 + 3 / 44 * beta * 10.0, -beta * 10.0]), 10.0)
    cases = [parallel, coplanar] * 100
    xy = _line_points(cameras, cases, rng, sigma)
    for result in (
        intersect_lines(cameras, fit_image_lines(xy, SIGMA_PX)),
        intersect_lines_in_one_step(cameras, xy, SIGMA_PX),
    ):
        # planes that differ by chance by three times the accuracy of their angle (0.3 % of the cases) pass
        assert (result.state == LineState.SINGULAR).mean() > 0.98
        assert np.isnan(result.parameters[result.state == LineState.SINGULAR]).all()
    assert "epipolar plane" in LineState.SINGULAR.words
    tilted = Ski(np.array([0.2, 0.1, -3.0, -1.0]), 10.0)
    assert intersect_lines(cameras, fit_image_lines(_line_points(cameras, [tilted], rng, sigma), SIGMA_PX)).ok.all()


def test_line_across_the_x_axis_is_said_to_be_so() -> None:
    rng = np.random.default_rng(3)
    cameras = hill_cameras(rng)
    vertical = np.column_stack((np.full(9, 10.0), np.zeros(9), np.linspace(-2, 0, 9)))
    xy = np.stack([camera.project(vertical) for camera in cameras])[None]
    result = intersect_lines(cameras, fit_image_lines(xy, SIGMA_PX))
    assert result.state[0] == LineState.ACROSS


def test_far_from_the_origin() -> None:
    rng = np.random.default_rng(17)
    shift = np.array([5.7e5, 7.03e6, 150.0])
    near = hill_cameras(rng)
    skis = [ski(rng) for _ in range(4)]
    xy = _line_points(near, skis, rng, SIGMA_PX)
    here = intersect_lines(near, fit_image_lines(xy, SIGMA_PX))
    away = intersect_lines([IdealCamera(k.c, k.X0 + shift, k.R) for k in near], fit_image_lines(xy, SIGMA_PX))
    x = np.array([one.x for one in skis])
    np.testing.assert_allclose(away.at(x + shift[0]) - shift, here.at(x), atol=1e-6)
    np.testing.assert_allclose(away.covariance_at(x + shift[0]), here.covariance_at(x), rtol=1e-3)


def test_step_a_minimises_the_distances() -> None:
    """No other angle of a steep and noisy line gives a smaller square sum; ordinary regression gives a larger one."""
    rng = np.random.default_rng(1)
    x = np.linspace(-20, 20, 15)
    xy = np.column_stack((x, 0.8 * x + 7)) + rng.normal(0, 2.0, (15, 2))
    line = fit_image_lines(xy, 2.0)

    def cost(a: float, b: float) -> float:
        return float(((xy[:, 1] - a * xy[:, 0] - b) ** 2).sum() / (1 + a * a)) / 4

    best = cost(float(line.a), float(line.b))
    assert best == pytest.approx(float(line.vtpv))
    for da, db in ((1e-4, 0), (-1e-4, 0), (0, 1e-3), (0, -1e-3)):
        assert cost(float(line.a) + da, float(line.b) + db) > best
    a, b = np.polyfit(xy[:, 0], xy[:, 1], 1)
    assert cost(a, b) > best
    assert a < line.a


def test_covariance_of_image_lines() -> None:
    rng = np.random.default_rng(7)
    n = 4000
    for slope in (0.1, 0.9, 5.0):
        x = 100.0 + np.linspace(-40, 40, 15) / np.hypot(1, slope)
        exact = np.column_stack((x, slope * (x - 100) + 30))
        line = fit_image_lines(exact + rng.normal(0, 0.33, (n, 15, 2)), 0.33)
        assert isinstance(line, ImageLines)
        errors = np.stack((line.a, line.b), -1) - np.stack((np.median(line.a), np.median(line.b)))
        test_values = np.einsum("ni,nij,nj->n", errors, np.linalg.inv(line.covariance), errors)
        assert abs(test_values.mean() - 2) < 5 * np.sqrt(4 / n)
        assert abs(line.vtpv.mean() - 13) < 5 * np.sqrt(26 / n)


def test_bad_input_is_named() -> None:
    with pytest.raises(BadInputError, match="coincide: measure points that lie apart"):
        fit_image_lines(np.ones((1, 3, 5, 2)), SIGMA_PX)
    with pytest.raises(BadInputError, match="not a number: mark missing"):
        fit_image_lines(np.full((1, 3, 5, 2), np.nan), SIGMA_PX)
    with pytest.raises(BadInputError, match="sigma of line points is not positive"):
        fit_image_lines(np.zeros((1, 3, 5, 2)), 0.0)
    lines = fit_image_lines(np.arange(20.0).reshape(1, 2, 5, 2) ** 2, SIGMA_PX)
    with pytest.raises(BadInputError, match=r"shape \(1, 2\): give \(lines, 3 images\)"):
        intersect_lines(hill_cameras(np.random.default_rng(1)), lines)
