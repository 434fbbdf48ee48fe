"""Direct linear transformation: exact, with interior orientation, noise, and planes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photogrammetry.start_values.projective import resect_dlt
from rig.errors import BadInputError
from tests.photogrammetry.scenes import SIGMA_PX, frame_points, lab_cameras, observe

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=20)
@given(seeds, st.integers(6, 40), st.floats(-1e4, 1e4))
def test_exact_with_principal_point_aspect_and_shear(seed: int, n: int, away: float) -> None:
    rng = np.random.default_rng(seed)
    camera = lab_cameras(rng)[rng.integers(9)]
    points = frame_points(rng, n)
    xs, ys = camera.project(points).T
    shear, aspect, x0, y0 = 0.002, 1.01, 12.0, -7.0
    xy = np.column_stack((aspect * xs + shear * ys + x0, ys + y0))
    shift = np.array([away, 0.0, -away])
    result = resect_dlt(points + shift, xy)
    # digits are lost with the distance from the origin, and with few points near a plane
    slack = (1 + abs(away)) * (1e3 if n < 10 else 1.0)
    np.testing.assert_allclose(result.residuals, 0, atol=1e-8 * slack)
    assert result.aspect == pytest.approx(aspect, abs=1e-8 * slack)
    assert result.shear == pytest.approx(shear, abs=1e-8 * slack)
    np.testing.assert_allclose(result.principal_point, (x0, y0), atol=1e-5 * slack)
    assert result.camera.c == pytest.approx(camera.c * np.sqrt(aspect), rel=1e-8 * slack)
    np.testing.assert_allclose(result.camera.R, camera.R, atol=1e-8 * slack)
    np.testing.assert_allclose(result.camera.X0 - shift, camera.X0, atol=1e-8 * slack)


def test_noise() -> None:
    rng = np.random.default_rng(2)
    for camera in lab_cameras(rng):
        points = frame_points(rng, 60)
        result = resect_dlt(points, observe([camera], points, rng)[:, 0])
        assert np.sqrt((result.residuals**2).mean()) < 1.2 * SIGMA_PX
        assert result.camera.c == pytest.approx(camera.c, rel=0.15)
        assert result.camera.in_front(points).all()


def test_points_that_leave_it_open_are_refused() -> None:
    rng = np.random.default_rng(4)
    camera = lab_cameras(rng)[0]
    points = frame_points(rng, 20)
    with pytest.raises(BadInputError, match="5 points: give at least six"):
        resect_dlt(points[:5], camera.project(points[:5]))
    points[:, 1] = 0.2 * points[:, 0] + 0.01
    with pytest.raises(BadInputError, match="lie in a plane: add points beside it"):
        resect_dlt(points, camera.project(points))


def test_a_mirror_image_is_named() -> None:
    rng = np.random.default_rng(5)
    camera = lab_cameras(rng)[0]
    points = frame_points(rng, 20)
    with pytest.raises(BadInputError, match="mirror image: check the sense of the image coordinates"):
        resect_dlt(points, camera.project(points) * (1.0, -1.0))
