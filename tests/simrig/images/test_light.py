"""Light that changes, and the noise of light."""

import math

import numpy as np
import pytest

from simrig.world.conditions.daylight import Daylight
from simrig.world.conditions.effects import Light
from simrig.world.scenario import Scenario
from tests.simrig.images.scenes import Renderer, with_keys


def test_clouds_dim_the_whole_image_alike(calm: Scenario) -> None:
    cloudy = with_keys(calm, light={"cloud_depth": 0.5, "cloud_period_s": 4.0})
    image, full = Renderer(cloudy, rate_hz=30.0), Renderer(calm, rate_hz=30.0)(90).astype(float) - 8
    daylight, seen = Daylight(cloudy.light, cloudy.seed), []
    for pulse in (80, 90, 100, 110):
        ratio = (image(pulse).astype(float) - 8)[full > 100] / full[full > 100]
        assert np.median(ratio) == pytest.approx(daylight.at(pulse / 30, 0.0), abs=0.01)
        assert ratio.std() < 0.02
        seen.append(float(np.median(ratio)))
    assert max(seen) - min(seen) > 0.1
    assert min(seen) >= 0.5 - 0.01


def test_floodlights_flicker_less_the_longer_the_exposure() -> None:
    daylight = Daylight(Light(flicker=0.4, flicker_hz=100.0), seed=5)

    def swing(exposure_s: float) -> float:
        light = [daylight.at(k / 1700, exposure_s) for k in range(1700)]
        assert max(light) <= 1.0
        return max(light) - min(light)

    assert swing(0.0) == pytest.approx(0.4, abs=0.01)
    assert swing(5e-3) == pytest.approx(0.4 * 2 / math.pi, abs=0.01), "half a period"
    assert swing(10e-3) == pytest.approx(0.0, abs=1e-9), "a whole period"


def test_cameras_of_one_hill_see_the_same_light(calm: Scenario) -> None:
    flickering = with_keys(calm, light={"flicker": 0.5})
    ratios = []
    for camera in (0, 2):
        bright, plain = Renderer(flickering, camera, rate_hz=30.1)(100), Renderer(calm, camera, rate_hz=30.1)(100)
        ratios.append(float(np.median((bright.astype(float) - 8) / (plain.astype(float) - 8))))
    assert ratios[0] == pytest.approx(ratios[1], abs=0.01)
    assert ratios[0] < 0.99


def test_brighter_places_are_noisier_by_their_electrons(calm: Scenario) -> None:
    noisy = with_keys(calm, image={"noise_sigma": 1.0, "electrons_per_grey": 12.0}, light={"cloud_depth": 1e-9})
    clean = Renderer(with_keys(calm, light={"cloud_depth": 1e-9}), rate_hz=30.0)(100).astype(float)
    image = Renderer(noisy, rate_hz=30.0)
    errors = np.stack([image(pulse) - clean for pulse in range(90, 110)])
    for low, high in ((20, 60), (100, 120), (160, 190)):
        where = (clean >= low) & (clean < high)
        grey = float(clean[where].mean())
        expected = math.sqrt(noisy.image.noise_at(grey) ** 2 + 1 / 12)
        assert float(errors[:, where].std()) == pytest.approx(expected, rel=0.06)
    assert abs(float(np.corrcoef(errors[0].ravel(), errors[1].ravel())[0, 1])) < 0.02


def test_glare_stays_and_reflections_come_and_go(calm: Scenario) -> None:
    plain = Renderer(with_keys(calm, light={"cloud_depth": 1e-9}), rate_hz=30.0)(90).astype(float)
    glare = Renderer(with_keys(calm, light={"glare_spots": 4}), rate_hz=30.0)
    assert np.array_equal(glare(90), glare(100))
    assert (glare(90) - plain).min() > -1.5
    assert ((glare(90) - plain) > 15).mean() > 0.001
    sparkle = Renderer(with_keys(calm, light={"reflections": 40}), rate_hz=30.0)
    spots = [sparkle(pulse) - plain > 30 for pulse in (90, 100, 110)]
    assert all(0 < spot.sum() < 1000 for spot in spots)
    assert not np.array_equal(spots[0], spots[1])
