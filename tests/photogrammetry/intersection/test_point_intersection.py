"""Appendix C.1 against truth, full least squares, Monte Carlo, and geometry that does not determine a point."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.point_intersection import CHUNK, PointState, intersect_points
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.images.viewing import look_at
from tests.photogrammetry.scenes import SIGMA_PX, flight_points, hill_cameras, observe

seeds = st.integers(0, 2**32 - 1)


def _full_least_squares(cameras: list[IdealCamera], xy: Floats, start: Floats, sigma: Floats) -> Floats:
    """C3 minimised by Gauss-Newton steps of Eq. A1 with complex-step derivatives, to working precision."""

    def residuals(point: Floats) -> Floats:
        values = []
        for camera, measured, s in zip(cameras, xy, sigma, strict=True):
            d = (point - camera.X0) @ camera.R
            values.append((-camera.c * d[:2] / d[2] - measured) / s)
        return np.concatenate(values)

    point = start
    for _ in range(30):
        jacobian = np.column_stack([residuals(point + 1e-30j * axis).imag / 1e-30 for axis in np.eye(3)])
        point = point - np.linalg.lstsq(jacobian, residuals(point), rcond=None)[0]
    return point


@settings(max_examples=25)
@given(seeds)
def test_equals_full_least_squares_to_a_millionth_of_a_sigma(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cameras = hill_cameras(rng)
    truth = flight_points(rng, 4)
    sigma = rng.uniform(0.1, 1.0, (4, 3))
    xy = observe(cameras, truth, rng, 0.0) + rng.normal(0.0, sigma[..., None], (4, 3, 2))
    seen = np.ones((4, 3), bool)
    seen[3, rng.integers(3)] = False
    result = intersect_points(cameras, xy, seen=seen, sigma=sigma)
    assert result.ok.all()
    for i in range(4):
        used = [camera for camera, there in zip(cameras, seen[i], strict=True) if there]
        exact = _full_least_squares(used, xy[i, seen[i]], truth[i], sigma[i, seen[i]])
        assert np.abs((result.X[i] - exact) / result.sigma[i]).max() < 1e-6
        residuals = np.stack([camera.project(exact) for camera in used]) - xy[i, seen[i]]
        np.testing.assert_allclose(result.residuals[i, seen[i]], residuals, atol=1e-5)
        assert np.isnan(result.residuals[i, ~seen[i]]).all()


def test_covariance_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(5)
    cameras = hill_cameras(rng)
    xy = observe(cameras, flight_points(rng, 3), rng)
    result = intersect_points(cameras, xy, sigma=SIGMA_PX)
    for i in range(3):
        fit = least_squares(
            lambda p, i=i: np.concatenate([k.project(p) - xy[i, j] for j, k in enumerate(cameras)]) / SIGMA_PX,
            result.X[i],
            jac="3-point",
        )
        np.testing.assert_allclose(result.covariance[i], np.linalg.inv(fit.jac.T @ fit.jac), rtol=1e-5)


@settings(max_examples=25)
@given(seeds, st.floats(0.0, 1e7))
def test_exact_without_noise_also_far_from_the_origin(seed: int, away: float) -> None:
    rng = np.random.default_rng(seed)
    shift = np.array([away, -away, 0.0])
    cameras = [replace(camera, X0=camera.X0 + shift) for camera in hill_cameras(rng)]
    truth = flight_points(rng, 10) + shift
    result = intersect_points(cameras, observe(cameras, truth, rng, 0.0))
    assert result.ok.all()
    # double precision resolves 1e-16 of the coordinates; distances and the image add a few digits
    np.testing.assert_allclose(result.X, truth, rtol=0, atol=1e-10 + 1e-14 * away)
    assert np.abs(result.residuals).max() < 1e-8 + 1e-11 * away


def test_errors_follow_the_covariance() -> None:
    rng = np.random.default_rng(11)
    cameras = hill_cameras(rng)
    truth = np.tile(flight_points(rng, 1), (2 * CHUNK + 17, 1))  # also: more than one chunk, the last one short
    result = intersect_points(cameras, observe(cameras, truth, rng), sigma=SIGMA_PX)
    empirical = np.cov((result.X - truth).T)
    # relative standard deviation of a variance from n samples: sqrt(2 / n) = 1.6 %; five of them
    np.testing.assert_allclose(empirical, result.covariance[0], atol=0.08 * np.abs(result.covariance[0]).max())
    test_values = np.einsum("ni,nij,nj->n", result.X - truth, np.linalg.inv(result.covariance), result.X - truth)
    assert abs(test_values.mean() - 3) < 5 * np.sqrt(6 / len(truth))
    redundancy = 3.0  # six coordinates, three unknowns
    vtpv = (result.residuals**2).sum(axis=(1, 2)) / SIGMA_PX**2
    assert abs(vtpv.mean() - redundancy) < 5 * np.sqrt(2 * redundancy / len(truth))


def test_many_images_and_missing_rays() -> None:
    rng = np.random.default_rng(2)
    cameras = [*hill_cameras(rng), *hill_cameras(rng), *hill_cameras(rng)]
    truth = flight_points(rng, 200)
    xy = observe(cameras, truth, rng)
    seen = rng.random((200, 9)) < 0.5
    xy[~seen] = np.nan
    result = intersect_points(cameras, xy, seen=seen, sigma=SIGMA_PX)
    enough = seen.sum(axis=1) >= 2
    assert (result.state[~enough] == PointState.FEW_RAYS).all()
    assert np.isnan(result.X[~enough]).all()
    assert np.abs((result.X - truth) / result.sigma)[result.ok].max() < 6
    assert result.ok.sum() > 0.9 * enough.sum()


def test_parallel_rays_are_said_to_be_parallel() -> None:
    """Two cameras side by side that look at infinity; and at a point a little nearer than that."""
    eye = look_at(np.array([0.0, -1.0, 0.0]), np.zeros(3))
    cameras = [IdealCamera(1000.0, np.array([x, 0.0, 0.0]), eye) for x in (0.0, 1.0)]
    centre = np.zeros(2)
    xy = np.array([[centre, centre], [centre, (-1.0, 0.0)], [centre, (-20.0, 0.0)], [centre, (20.0, 0.0)]])
    result = intersect_points(cameras, xy, sigma=SIGMA_PX)
    assert list(result.state) == [PointState.PARALLEL, PointState.PARALLEL, PointState.OK, PointState.BEHIND]
    assert np.isnan(result.X[:2]).all()
    np.testing.assert_allclose(result.X[2], (0.0, 50.0, 0.0), atol=1e-9)


def test_point_on_the_base_and_coinciding_cameras_do_not_crash() -> None:
    cameras = hill_cameras(np.random.default_rng(1))
    twice = [cameras[0], cameras[0]]
    result = intersect_points(twice, np.zeros((1, 2, 2)), sigma=SIGMA_PX)
    assert result.state[0] == PointState.PARALLEL
    toward = [
        IdealCamera(1000.0, np.array([x, 0.0, 0.0]), look_at(np.array([x, 0.0, 0.0]), np.zeros(3))) for x in (-5.0, 5.0)
    ]
    assert intersect_points(toward, np.zeros((1, 2, 2)), sigma=SIGMA_PX).state[0] == PointState.PARALLEL


def test_every_state_has_words_that_end_in_what_to_do() -> None:
    assert all(": " in state.words for state in PointState if state is not PointState.OK)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"xy": np.zeros((4, 2, 2))}, r"shape \(4, 2, 2\): give \(points, 3 images, 2\)"),
        ({"xy": np.full((4, 3, 2), np.nan)}, "ray 0 of point 0 is not a number: mark missing rays"),
        ({"sigma": np.zeros(1)}, "sigma of an image point is not positive"),
        ({"sigma": np.ones(5)}, r"sigma has shape \(5,\): give one, 3, or"),
    ],
)
def test_bad_input_is_named(change: dict[str, Floats], message: str) -> None:
    cameras = hill_cameras(np.random.default_rng(3))
    with pytest.raises(BadInputError, match=message):
        intersect_points(cameras, change.get("xy", np.zeros((4, 3, 2))), sigma=change.get("sigma", np.ones(3)))
