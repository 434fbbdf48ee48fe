"""The oriented cameras: projection, derivatives, draws."""

import numpy as np

from analysis.scene.camera_system import PlacedCamera
from rig.arrays import Floats
from tests.analysis.simulated import SIGMA_PX, drawn, simulated_measurements, true_cameras, true_jump


def _residual(placed: PlacedCamera, xyz: Floats, xy: Floats) -> Floats:
    return np.asarray(placed.linearised(xyz[None], xy[None])[0][0])


def test_residual_is_computed_minus_observed() -> None:
    placed = true_cameras()["K2"]
    xyz = np.array((10.0, 0.0, -2.0))
    xy = placed.project(xyz) + np.array((0.5, -0.25))
    assert np.allclose(_residual(placed, xyz, xy), (-0.5, 0.25), atol=1e-9)


def test_a_frame_that_is_off_shows_everything_beside() -> None:
    placed, xyz, px = true_cameras()["K2"], np.array(((10.0, 0.0, -2.0), (2.0, 1.0, 0.5))), np.array((0.5, -0.25))
    assert np.allclose(placed.shifted(px).project(xyz), placed.project(xyz) + px, atol=1e-9)


def test_derivatives_agree_with_differences() -> None:
    system = true_cameras()
    xyz = np.array((10.0, 0.3, -2.0))
    for name in system.names:
        placed = system[name]
        xy = placed.project(xyz) + 0.3
        _, by_point, by_parameters = placed.linearised(xyz[None], xy[None])
        for i in range(3):
            step = np.eye(3)[i] * 1e-5
            difference = (_residual(placed, xyz + step, xy) - _residual(placed, xyz - step, xy)) / 2e-5
            assert np.allclose(difference, by_point[0, :, i], rtol=1e-5, atol=1e-5)
        for i, column in enumerate(placed.columns):
            move = np.zeros(len(system.covariance))
            move[column] = 1e-6
            up, down = system.moved(move)[name], system.moved(-move)[name]
            difference = (_residual(up, xyz, xy) - _residual(down, xyz, xy)) / 2e-6
            assert np.allclose(difference, by_parameters[0, :, i], rtol=1e-4, atol=1e-4)


def test_draws_scatter_as_the_covariance_says() -> None:
    system, rng = true_cameras(), np.random.default_rng(1)
    offs = np.array([drawn(system, rng)["K1"].position - system["K1"].position for _ in range(500)])
    expected = system.covariance[np.ix_(system["K1"].columns[:3], system["K1"].columns[:3])]
    ratio = np.sqrt(np.diagonal(np.cov(offs.T)) / np.diagonal(expected))
    assert (np.abs(ratio - 1) < 0.15).all()  # 500 draws: 3.2 % each


def test_simulated_measurements_have_their_noise() -> None:
    system, truth = true_cameras(), true_jump(7)
    measured = simulated_measurements(truth, system, np.random.default_rng(2))
    offs = [
        point.xy - system[camera].project(truth.pose(pulse.pulse).markers[i])
        for pulse in measured.jumps[0].pulses
        for camera, image in pulse.images.items()
        for i, label in enumerate(("P1", "P2", "P3", "P4"))
        if (point := image.points.get(label)) is not None
    ]
    assert len(offs) > 200
    assert abs(np.std(offs) / SIGMA_PX - 1) < 0.1


def test_the_part_of_the_survey_is_what_a_better_survey_would_take_away() -> None:
    """With errors of the images alone nothing is left; with those of the survey alone all of it."""
    for survey, image, part in ((1e-6, 0.5, 0.0), (0.05, 1e-4, 1.0)):
        system = true_cameras(survey, image)
        assert system.given is not None
        sigma = np.sqrt(np.diagonal(system.covariance))
        off = (system.given - part * system.covariance) / np.outer(sigma, sigma)
        assert np.abs(off).max() < 1e-3
    both = true_cameras(0.012, 0.1)
    assert both.given is not None
    values = np.linalg.eigvals(np.linalg.solve(both.covariance, both.given)).real
    assert values.min() > -1e-6
    assert values.max() < 1 + 1e-6
