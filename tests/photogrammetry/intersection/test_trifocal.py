"""Which image has left and right ski interchanged: transfer of lines, test values, proposals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.image_line import ImageLines, fit_image_lines
from photogrammetry.intersection.trifocal import check_sides, transfer_lines, trifocal_tensor
from rig.arrays import Floats
from rig.errors import BadInputError
from tests.photogrammetry.scenes import SIGMA_PX, Ski, hill_cameras, ski


def _measured(cameras: list[IdealCamera], pairs: list[tuple[Ski, Ski]], rng: np.random.Generator) -> Floats:
    """(2, n, 3, k, 2) line points of left and right skis."""
    xy = np.array(
        [[[camera.project(pair[side].points(15)) for camera in cameras] for pair in pairs] for side in (0, 1)]
    )
    return np.asarray(xy + rng.normal(0.0, SIGMA_PX, xy.shape))


def _swap(xy: Floats, image: int) -> Floats:
    xy = xy.copy()
    if image >= 0:
        xy[:, :, image] = xy[::-1, :, image]
    return xy


def _pair(rng: np.random.Generator) -> tuple[Ski, Ski]:
    """Two skis side by side in a V, with a little roll."""
    left = ski(rng, 1.0)
    alpha, beta, _, _ = left.parameters
    at = left.points(3)[1]
    alpha, beta = alpha + rng.uniform(-0.1, 0.1), beta - 0.4
    y, z = at[1] - 0.5, at[2] + rng.uniform(-0.1, 0.1)
    return left, Ski(np.array([alpha, beta, z - alpha * left.x, y - beta * left.x]), left.x)


def _lines(xy: Floats) -> tuple[ImageLines, ImageLines]:
    return fit_image_lines(xy[0], SIGMA_PX), fit_image_lines(xy[1], SIGMA_PX)


@settings(max_examples=20)
@given(st.integers(0, 2**32 - 1), st.permutations(range(3)))
def test_transfer_is_exact(seed: int, order: list[int]) -> None:
    rng = np.random.default_rng(seed)
    cameras = [hill_cameras(rng)[i] for i in order]
    one = ski(rng)
    g = [fit_image_lines(camera.project(one.points(5)), 1.0).homogeneous() for camera in cameras]
    found = transfer_lines(trifocal_tensor(cameras), g[1], g[2])
    x = cameras[0].project(one.points(5))
    distance = (x @ found[:2] + found[2]) / np.linalg.norm(found[:2])
    # the transfer loses as many digits as the two planes' angle is small
    normals = [k.R @ (line * (-k.c, -k.c, 1)) for k, line in zip(cameras[1:], g[1:], strict=True)]
    sine = np.linalg.norm(np.cross(normals[0], normals[1])) / np.prod(np.linalg.norm(normals, axis=1))
    assert np.abs(distance).max() < 1e-9 / sine


@pytest.mark.parametrize("image", [-1, 0, 1, 2])
def test_the_interchanged_image_is_proposed(image: int) -> None:
    rng = np.random.default_rng(9)
    right = sure = 0
    for _ in range(5):
        cameras = hill_cameras(rng)
        xy = _measured(cameras, [_pair(rng) for _ in range(60)], rng)
        result = check_sides(cameras, *_lines(_swap(xy, image)))
        convinced = result.confidence > 0.99
        sure += int(convinced.sum())
        right += int((result.proposal[convinced] == image).sum())
    assert sure > 230  # of 300: from one side a level ski is near the epipolar planes, and says little
    assert right >= sure - 3  # 1 % may be wrong


def test_test_value_of_the_true_naming_is_chi_square() -> None:
    rng = np.random.default_rng(10)
    cameras = hill_cameras(rng)
    xy = _measured(cameras, [_pair(rng)] * 1500, rng)
    result = check_sides(cameras, *_lines(xy))
    assert abs(np.median(result.tests[:, 0]) - 3.36) < 0.5  # median of chi-square with 4 degrees of freedom
    assert result.fits.mean() > 0.99


def test_skis_that_coincide_in_the_images_leave_the_question_open() -> None:
    rng = np.random.default_rng(12)
    cameras = hill_cameras(rng)
    one = ski(rng)
    result = check_sides(cameras, *_lines(_measured(cameras, [(one, one)] * 5, rng)))
    assert (result.confidence < 0.99).all()


def test_agreement_interchange_lines_of_other_skis_and_missing_lines_are_told() -> None:
    rng = np.random.default_rng(13)
    cameras = hill_cameras(rng)
    pairs = [(Ski(np.array([0.2, 0.2, -3.0, -1.5]), 8.0), Ski(np.array([0.15, -0.2, -2.6, 1.2]), 8.0))]
    xy = _measured(cameras, pairs, rng)
    for image in (-1, 2):
        result = check_sides(cameras, *_lines(xy if image < 0 else _swap(xy, image)))
        assert (result.proposal[0], result.fits[0]) == (image, True)
        assert result.confidence[0] > 0.99
    other = xy.copy()
    other[:, :, 0, :, 1] += np.linspace(-60, 60, 15)
    assert not check_sides(cameras, *_lines(other)).fits[0]
    seen = np.ones(xy.shape[1:-1], bool)
    seen[0, 1] = False
    left, right = fit_image_lines(xy[0], SIGMA_PX, seen=seen), fit_image_lines(xy[1], SIGMA_PX)
    missing = check_sides(cameras, left, right)
    assert np.isnan(missing.tests[0]).all()
    assert missing.confidence[0] == 0.25


def test_takes_three_images() -> None:
    cameras = hill_cameras(np.random.default_rng(1))
    xy = _measured(cameras, [_pair(np.random.default_rng(1))], np.random.default_rng(1))
    with pytest.raises(BadInputError, match="takes three images"):
        check_sides(cameras[:2], *_lines(xy[:, :, :2]))
