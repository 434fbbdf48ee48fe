"""Appendix B: principal distance from vanishing points and from homographies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.start_values.principal_distances import plane_directions, principal_distance
from photogrammetry.start_values.projective import plane_homography
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.images.viewing import look_at

seeds = st.integers(0, 2**32 - 1)
SQUARE = np.array([[-0.25, -0.25], [0.25, -0.25], [0.25, 0.25], [-0.25, 0.25]])


def _oblique(rng: np.random.Generator) -> IdealCamera:
    """A camera that sees the XZ plane from the side and from above, so that both directions vanish."""
    signs = rng.choice((-1.0, 1.0), 2)
    centre = np.array([signs[0] * rng.uniform(0.7, 1.5), -1.5, signs[1] * rng.uniform(0.7, 1.5)])
    return IdealCamera(rng.uniform(800, 3000), centre, look_at(centre, np.zeros(3), -np.degrees(rng.uniform(-3, 3))))


def _side(corners: Floats) -> Floats:
    """Square of the frame in space: in the XZ plane."""
    return np.column_stack((corners[:, 0], np.zeros(len(corners)), corners[:, 1]))


def _by_planes(homographies: list[Floats]) -> float:
    return principal_distance(pair for matrix in homographies for pair in plane_directions(matrix))


@settings(max_examples=30)
@given(seeds)
def test_square_by_its_sides(seed: int) -> None:
    """Fig. B2: two pairs of parallel sides of a square give c; the paper's formula needs a minus sign."""
    camera = _oblique(np.random.default_rng(seed))
    corners = camera.project(_side(SQUARE))
    corners_1 = np.column_stack((corners, np.ones(4)))
    sides = np.cross(corners_1, np.roll(corners_1, -1, axis=0))
    u, v = np.cross(sides[0], sides[2]), np.cross(sides[1], sides[3])
    assert principal_distance([(u, v)]) == pytest.approx(camera.c, rel=1e-6)
    direction = camera.project(camera.X0 + 1e9 * np.array([1.0, 0.0, 0.0]) + 1e-3)
    np.testing.assert_allclose(u[:2] / u[2], direction, rtol=1e-4, atol=1e-2)
    assert (u[0] * v[0] + u[1] * v[1]) / (u[2] * v[2]) < 0


@settings(max_examples=20)
@given(seeds)
def test_homographies(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first = _oblique(rng)
    cameras = [first] + [IdealCamera(first.c, k.X0, k.R) for k in (_oblique(rng) for _ in range(4))]
    plane = rng.uniform(-0.25, 0.25, (12, 2))
    exact = [plane_homography(plane, camera.project(_side(plane))) for camera in cameras]
    assert _by_planes(exact) == pytest.approx(first.c, rel=1e-7)
    noisy = [plane_homography(plane, camera.project(_side(plane)) + rng.normal(0, 0.1, (12, 2))) for camera in cameras]
    assert _by_planes(noisy) == pytest.approx(first.c, rel=0.1)


@settings(max_examples=20)
@given(seeds, st.integers(4, 20))
def test_homography_maps_the_points(seed: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    camera = _oblique(rng)
    plane = np.vstack((SQUARE, rng.uniform(-0.25, 0.25, (n - 4, 2))))
    matrix = plane_homography(plane, camera.project(_side(plane)))
    image = np.column_stack((plane, np.ones(n))) @ matrix.T
    np.testing.assert_allclose(image[:, :2] / image[:, 2:], camera.project(_side(plane)), atol=1e-7)


def test_frontal_image_says_nothing() -> None:
    centre = np.array([0.0, -2.0, 0.0])
    camera = IdealCamera(1000.0, centre, look_at(centre, np.zeros(3)))
    matrix = plane_homography(SQUARE, camera.project(_side(SQUARE)))
    with pytest.raises(BadInputError, match="oblique image"):
        _by_planes([matrix])
    with pytest.raises(BadInputError, match="oblique image"):
        principal_distance([])


def test_contradicting_vanishing_points_are_refused() -> None:
    with pytest.raises(BadInputError, match="fit no principal distance"):
        principal_distance([(np.array([500.0, 10.0, 1.0]), np.array([600.0, 20.0, 1.0]))])


def test_bad_input_is_named() -> None:
    with pytest.raises(BadInputError, match="3 points: give at least four"):
        plane_homography(SQUARE[:3], SQUARE[:3])
    with pytest.raises(BadInputError, match="lie on a line"):
        plane_homography(np.column_stack((np.arange(4.0), np.zeros(4))), SQUARE)
