"""The camera model: inverses, and derivatives against complex steps."""

import numpy as np
import pytest

from photogrammetry.geometry.camera_model import INTERIOR, Lens, distort, image_point, linearise, residuals, undistort
from photogrammetry.geometry.rotation import rotation_from_vector, skew
from rig.arrays import Numbers

_STEP = 1e-30
_N = 40
_INTERIOR = np.array([1400.0, 3.0, -4.0, 1e-8, 1e-14, 1e-20, 1e-6, -1e-6, 1e-4, 2e-4])


class Scene:
    """Forty points, each with a camera of its own, half of them with the distortion on the measured side."""

    def __init__(self) -> None:
        rng = np.random.default_rng(7)
        interior = _INTERIOR * rng.normal(1.0, 0.2, (_N, 10))
        self.lens = Lens(interior, np.full(_N, 200.0), np.arange(_N) % 2 == 0)
        self.rotation = rotation_from_vector(rng.normal(0.0, 1.0, (_N, 3)))
        self.position = rng.normal(0.0, 10.0, (_N, 3))
        in_camera = np.column_stack([rng.uniform(-12.0, 12.0, (_N, 2)), rng.uniform(-60.0, -45.0, _N)])
        self.xyz = self.position + np.einsum("nij,nj->ni", self.rotation, in_camera)
        self.exact = image_point(self.lens, self.rotation, self.position, self.xyz)
        self.xy = self.exact + rng.normal(0.0, 0.5, (_N, 2))

    def by_complex_step(self, part: str, direction: Numbers) -> Numbers:
        """Derivative of the residuals along `direction` of one argument."""
        step = 1j * _STEP * direction
        lens = self.lens
        rotation: Numbers = self.rotation
        position: Numbers = self.position
        xyz: Numbers = self.xyz
        match part:
            case "interior":
                lens = Lens(lens.interior + step, lens.balance, lens.measured)
            case "position":
                position = position + step
            case "angles":
                rotation = rotation @ (np.eye(3) + skew(step))
            case _:
                xyz = xyz + step
        derivative: Numbers = np.imag(residuals(lens, rotation, position, xyz, self.xy)) / _STEP
        return derivative


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene()


def test_exact_points_have_no_residual(scene: Scene) -> None:
    v = residuals(scene.lens, scene.rotation, scene.position, scene.xyz, scene.exact)
    assert np.abs(v).max() < 1e-9


def test_distortion_and_its_inverse_agree(scene: Scene) -> None:
    assert np.abs(distort(scene.lens, undistort(scene.lens, scene.xy)) - scene.xy).max() < 1e-9


def test_a_point_beyond_the_reach_of_the_distortion_is_not_invented() -> None:
    lens = Lens(np.array([1000.0, 0, 0, -1e-6, 0, 0, 0, 0, 0, 0]), np.array(0.0), np.array(False))
    assert np.isnan(undistort(lens, np.array([[900.0, 0.0]]))).all()


@pytest.mark.parametrize("index", range(len(INTERIOR)), ids=INTERIOR)
def test_derivatives_by_the_interior_orientation(scene: Scene, index: int) -> None:
    scale = abs(_INTERIOR[index])
    numeric = scene.by_complex_step("interior", np.eye(10)[index] * scale)
    analytic = (
        linearise(scene.lens, scene.rotation, scene.position, scene.xyz, scene.xy).by_interior[..., index] * scale
    )
    assert np.abs(numeric - analytic).max() < 1e-8 * max(1.0, float(np.abs(numeric).max()))


@pytest.mark.parametrize("part", ["position", "angles", "point"])
@pytest.mark.parametrize("axis", range(3))
def test_derivatives_by_pose_and_point(scene: Scene, part: str, axis: int) -> None:
    numeric = scene.by_complex_step(part, np.eye(3)[axis])
    equations = linearise(scene.lens, scene.rotation, scene.position, scene.xyz, scene.xy)
    column = {
        "position": equations.by_pose[..., axis],
        "angles": equations.by_pose[..., 3 + axis],
        "point": equations.by_point[..., axis],
    }[part]
    assert np.abs(numeric - column).max() < 1e-8 * max(1.0, float(np.abs(numeric).max()))
