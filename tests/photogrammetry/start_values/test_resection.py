"""Direct resection: three points and their ambiguity, planes, noise, geometry that fits no pose."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.start_values.resection import refine_pose, resect
from rig.arrays import Floats
from rig.errors import BadInputError
from tests.photogrammetry.scenes import SIGMA_PX, flight_points, frame_points, hill_cameras, lab_cameras, observe

seeds = st.integers(0, 2**32 - 1)


def _scene(rng: np.random.Generator, n: int, planar: bool) -> tuple[IdealCamera, Floats]:
    if rng.random() < 0.5:
        cameras, points = lab_cameras(rng), frame_points(rng, n)
    else:
        cameras, points = hill_cameras(rng), flight_points(rng, n)
    if planar:
        points[:, 1] = 0.1 * points[:, 0]
    camera = cameras[rng.integers(len(cameras))]
    return IdealCamera(
        camera.c, camera.X0, camera.R @ rotation_from_vector(np.array([0, 0, rng.uniform(-3, 3)]))
    ), points


@settings(max_examples=15)
@given(seeds, st.integers(4, 30), st.booleans())
def test_exact(seed: int, n: int, planar: bool) -> None:
    camera, points = _scene(np.random.default_rng(seed), n, planar)
    result = resect(points, camera.project(points), camera.c)
    poses = (result.camera, *result.alternatives)
    assert min(np.abs(pose.R - camera.R).max() for pose in poses) < 1e-6
    assert np.abs(result.residuals).max() < 1e-5
    assert n < 6 or not result.ambiguous


@settings(max_examples=15)
@given(seeds, st.booleans())
def test_three_points_give_all_poses_and_say_that_they_do(seed: int, planar: bool) -> None:
    camera, points = _scene(np.random.default_rng(seed), 3, planar)
    xy = camera.project(points)
    result = resect(points, xy, camera.c)
    poses = (result.camera, *result.alternatives)
    assert 1 <= len(poses) <= 4
    assert result.ambiguous == (len(poses) > 1)
    assert min(np.abs(pose.R - camera.R).max() for pose in poses) < 1e-4
    for pose in poses:
        np.testing.assert_allclose(pose.project(points), xy, atol=1e-3)
        assert pose.in_front(points).all()


@pytest.mark.parametrize(
    ("seed", "planar"), [(12057, True), (12242, True), (12643, True), (12689, True), (12939, False)]
)
def test_three_points_next_to_a_double_solution(seed: int, planar: bool) -> None:
    """Two poses that differ by 0.3 to 2 degrees fit exactly; both are found, the true one to full precision."""
    camera, points = _scene(np.random.default_rng(seed), 3, planar)
    result = resect(points, camera.project(points), camera.c)
    poses = sorted((result.camera, *result.alternatives), key=lambda pose: float(np.abs(pose.R - camera.R).max()))
    assert np.abs(poses[0].R - camera.R).max() < 1e-6
    assert np.abs(poses[1].R - camera.R).max() < 0.05
    assert result.ambiguous


@settings(max_examples=10)
@given(seeds, st.integers(6, 30), st.booleans())
def test_with_noise_it_is_the_least_squares_pose(seed: int, n: int, planar: bool) -> None:
    rng = np.random.default_rng(seed)
    camera, points = _scene(rng, n, planar)
    xy = observe([camera], points, rng)[:, 0]
    result = resect(points, xy, camera.c)
    from_truth = refine_pose(camera, points, xy).square_sum
    square_sums = [((pose.project(points) - xy) ** 2).sum() for pose in (result.camera, *result.alternatives)]
    assert square_sums[0] <= from_truth * (1 + 1e-6)
    assert square_sums == sorted(square_sums)
    assert (result.residuals**2).sum() == pytest.approx(square_sums[0])
    assert square_sums[0] < (SIGMA_PX * 2) ** 2 * 2 * n


def test_wrong_principal_distance_still_gives_a_pose_in_front() -> None:
    rng = np.random.default_rng(6)
    for factor in (0.5, 2.0):
        for camera in lab_cameras(rng):
            points = frame_points(rng, 20)
            result = resect(points, camera.project(points), factor * camera.c)
            assert result.camera.in_front(points).all()
            # the distance follows the principal distance
            assert np.linalg.norm(result.camera.X0) == pytest.approx(factor * np.linalg.norm(camera.X0), rel=0.3)


def test_bad_input_is_named() -> None:
    camera, points = _scene(np.random.default_rng(1), 6, False)
    with pytest.raises(BadInputError, match="2 known points: give at least three"):
        resect(points[:2], camera.project(points[:2]), camera.c)
    line = points[0] + np.outer(np.linspace(0, 1, 5), points[1] - points[0])
    with pytest.raises(BadInputError, match="lie on a line: add one beside it"):
        resect(line, camera.project(line), camera.c)


def test_equal_input_gives_equal_output() -> None:
    rng = np.random.default_rng(8)
    camera, points = _scene(rng, 12, False)
    xy = observe([camera], points, rng)[:, 0]
    first, second = resect(points, xy, camera.c), resect(points, xy, camera.c)
    assert (first.camera.R == second.camera.R).all()
    assert (first.camera.X0 == second.camera.X0).all()
