import numpy as np
import pytest

from simrig.images.scene.drawing import Image
from simrig.images.scene.weather import DenseSnow, lens_snow
from simrig.world.scenario import Scenario
from tests.simrig.images.scenes import Renderer, with_keys


def fallen(density: float, scene_s: float, size: tuple[int, int] = (640, 480)) -> Image:
    image = np.full(size[::-1], 90, np.float32)
    DenseSnow(density, *size, np.random.default_rng(3)).draw(image, scene_s)
    return image


def test_denser_snow_changes_more_pixels() -> None:
    shares = [float((fallen(density, 1.0) > 95).mean()) for density in (0.1, 0.3, 1.0)]
    assert shares[0] > 0.005
    assert shares[1] == pytest.approx(3 * shares[0], rel=0.2)
    assert shares[2] > 2 * shares[1]
    assert fallen(1.0, 1.0).max() <= 205


def test_snow_falls_and_comes_again_at_the_same_time() -> None:
    assert not np.array_equal(fallen(0.5, 1.0), fallen(0.5, 1.03))
    assert np.array_equal(fallen(0.5, 77.7), fallen(0.5, 77.7))
    before, after = fallen(0.5, 1.0), fallen(0.5, 9.0)
    assert abs(float(np.corrcoef((before > 95).ravel(), (after > 95).ravel())[0, 1])) < 0.05


def test_a_larger_image_shows_larger_flakes() -> None:
    small, large = (float((fallen(0.5, 1.0, size) > 95).mean()) for size in ((640, 480), (1280, 960)))
    assert large == pytest.approx(small, rel=0.3)


def test_snow_on_the_lens_is_soft_and_stays(calm: Scenario) -> None:
    cover = lens_snow(8, 640, 480, np.random.default_rng(2))
    assert 0.0 == cover.min() < 0.1 < cover.max() <= 0.6
    assert np.abs(np.diff(cover, axis=1)).max() < 0.15
    image = Renderer(with_keys(calm, weather={"lens_snow": 8}), rate_hz=30.0)
    assert np.array_equal(image(90), image(100))


def test_another_camera_has_other_snow(calm: Scenario) -> None:
    snowy = with_keys(calm, weather={"snowfall": 0.5})
    flakes = [Renderer(snowy, camera)(100).astype(int) - Renderer(calm, camera)(100) > 10 for camera in (0, 1)]
    assert abs(float(np.corrcoef(flakes[0].ravel(), flakes[1].ravel())[0, 1])) < 0.05
