"""The centre of a disc and its sigma: judged by discs whose pixels were counted, not modelled."""

from dataclasses import dataclass

import numpy as np
import pytest

from analysis.scene.disc import Disc, cover, fit_discs
from rig.arrays import Floats
from tests.analysis.scene.rendering import Spot, clean_image


@dataclass(frozen=True, slots=True)
class Fitted:
    """Discs that were found, and by how much their centres are off."""

    discs: list[Disc]
    errors: Floats
    missed: int

    @property
    def normalized_square(self) -> float:
        """Mean squared normalized error per coordinate."""
        cofactors = np.array([np.linalg.inv(disc.covariance) for disc in self.discs])
        return float(np.einsum("ni,nij,nj->n", self.errors, cofactors, self.errors).mean() / 2)


def _fit_one(grey: Floats, sigma: Floats, x: float, y: float, radius: float) -> Disc | None:
    (disc,) = fit_discs(grey, sigma, np.array([[x, y]]), np.array([radius]))
    return disc


def _fit_many(count: int, seed: int, radii: tuple[float, float], noise: float = 1.0, contrast: float = 1.0) -> Fitted:
    """Discs of random place, size, shape, contrast, blur and background; `noise` scales that of the camera."""
    rng = np.random.default_rng(seed)
    side = 2 * int(radii[1] + 10) + 1
    sheet, spread = np.zeros((count * side, side)), np.full((count * side, side), np.inf)
    places, starts, sizes = np.empty((count, 2)), np.empty((count, 2)), np.empty(count)
    for i in range(count):
        radius = float(np.exp(rng.uniform(*np.log(radii))))
        half = int(radius + 10)
        sign = rng.choice([-1, 1])
        x, y = half + rng.uniform(-0.5, 0.5, 2)
        level = contrast * sign * rng.uniform(40, 140)
        spot = Spot(x, y, radius, level, float(np.exp(rng.uniform(0, 0.2))), rng.uniform(0, np.pi))
        y, x = np.mgrid[: 2 * half + 1, : 2 * half + 1] - half
        slopes = rng.uniform(-0.6, 0.6, 2)
        background = (190 if sign < 0 else 60) + slopes[0] * x + slopes[1] * y
        clean = clean_image((2 * half + 1, 2 * half + 1), [spot], background, rng.uniform(0.45, 1.3))
        sigma = noise * np.sqrt(rng.uniform(0.5, 2.5) ** 2 + 0.03 * clean)
        grey = clean + sigma * rng.standard_normal(clean.shape)
        start = half + rng.uniform(-0.5, 0.5, 2)
        # the scale of the sigmas that are handed in must not matter: they are seven times too large
        own = slice(i * side, i * side + len(grey)), slice(grey.shape[1])
        sheet[own], spread[own] = grey, 7 * sigma
        places[i], starts[i] = (spot.x, spot.y + i * side), (start[0], start[1] + i * side)
        sizes[i] = radius * rng.uniform(0.8, 1.25)
    found = fit_discs(sheet, spread, starts, sizes)
    errors = [disc.xy - place for disc, place in zip(found, places, strict=True) if disc is not None]
    return Fitted([disc for disc in found if disc is not None], np.array(errors), count - len(errors))


@pytest.mark.parametrize("radii", [(1.5, 2.5), (2.5, 5.0), (5.0, 15.0)], ids=["small", "middle", "large"])
def test_the_error_of_a_centre_agrees_with_its_sigma(radii: tuple[float, float]) -> None:
    found = _fit_many(400, 11, radii)
    assert found.missed <= 12
    assert 0.8 < found.normalized_square < 1.2
    bias = found.errors.mean(axis=0) / (found.errors.std(axis=0) / np.sqrt(len(found.errors)))
    assert (np.abs(bias) < 4).all()


def test_twice_the_noise_is_twice_the_sigma_and_twice_the_error() -> None:
    once, twice = (_fit_many(300, 12, (2.0, 5.0), noise) for noise in (1.0, 2.0))
    sigma = [np.median([disc.sigma.mean() for disc in found.discs]) for found in (once, twice)]
    assert sigma[1] / sigma[0] == pytest.approx(2.0, rel=0.1)
    error = [np.median(np.abs(found.errors)) for found in (once, twice)]
    assert error[1] / error[0] == pytest.approx(2.0, rel=0.25)
    assert 0.8 < twice.normalized_square < 1.2


def test_half_the_contrast_is_twice_the_sigma() -> None:
    full, half = (_fit_many(200, 13, (2.0, 5.0), 0.7, contrast) for contrast in (1.0, 0.5))
    sigma = [np.median([disc.sigma.mean() for disc in found.discs]) for found in (full, half)]
    assert sigma[1] / sigma[0] == pytest.approx(2.0, rel=0.15)


def test_radius_and_contrast_are_those_of_the_disc() -> None:
    found = _fit_many(100, 14, (3.0, 12.0), noise=0.2)
    assert {disc.contrast > 0 for disc in found.discs} == {True, False}
    spot = Spot(30.3, 29.8, 4.0, 100.0, 1.3, 0.4)
    clean = clean_image((61, 61), [spot], 50.0, 0.8)
    disc = _fit_one(clean, np.ones_like(clean), 30.0, 30.0, 3.5)
    assert disc is not None
    assert disc.xy == pytest.approx([30.3, 29.8], abs=0.01)
    assert disc.radius == pytest.approx(4.0, rel=0.02)
    assert disc.contrast == pytest.approx(100.0, rel=0.03)
    assert disc.stretch == pytest.approx(np.log(1.3), abs=0.03)


def test_the_model_is_a_disc_seen_through_a_gaussian() -> None:
    for radius, blur in ((1.0, 0.6), (3.0, 0.9), (9.0, 0.7)):
        rng = np.random.default_rng(15)
        for r in (0.0, radius - blur, radius, radius + 1.5 * blur):
            samples = rng.normal((r, 0), blur, (200_000, 2))
            share = float((np.hypot(*samples.T) <= radius).mean())
            assert _cover(np.array([r]), radius, blur)[0][0] == pytest.approx(share, abs=0.006)


def _cover(r: Floats, radius: float, blur: float) -> list[Floats]:
    return [part[0] for part in cover(r[None], np.array([radius]), np.array([blur]))]


@pytest.mark.parametrize(("radius", "blur"), [(1.2, 0.7), (3.0, 0.5), (6.0, 0.6)])
def test_the_derivatives_of_the_model_are_its_slopes(radius: float, blur: float) -> None:
    r, step = np.linspace(0.05, radius + 2, 40), 1e-5
    _, by_r, by_radius = _cover(r, radius, blur)
    slope = (_cover(r + step, radius, blur)[0] - _cover(r - step, radius, blur)[0]) / (2 * step)
    growth = (_cover(r, radius + step, blur)[0] - _cover(r, radius - step, blur)[0]) / (2 * step)
    assert by_r == pytest.approx(slope, abs=1e-3)
    assert by_radius == pytest.approx(growth, abs=2e-2 if radius / blur > 8 else 1e-3)


def test_what_is_no_disc_is_refused_or_fits_badly() -> None:
    rng = np.random.default_rng(16)
    y, x = np.mgrid[:41, :41]
    edge = np.where(x > 20.3, 150.0, 60.0)
    stripe = np.where(np.abs(x - 20.3) < 2, 150.0, 60.0)
    corner = np.where((x > 20) & (y > 20), 150.0, 60.0)
    for image in (edge, stripe, corner, np.full((41, 41), 90.0)):
        noisy = image + rng.normal(0, 1, image.shape)
        disc = _fit_one(noisy, np.ones_like(noisy), 20.0, 20.0, 3.0)
        assert disc is None or disc.rms > 0.1 * abs(disc.contrast) or disc.stretch > 0.5 or disc.sigma.max() > 0.35


def test_a_disc_at_the_border_of_the_image_is_refused() -> None:
    clean = clean_image((40, 40), [Spot(1.0, 20.0, 4.0, 100.0)], 50.0, 0.7)
    assert _fit_one(clean, np.ones_like(clean), 1.0, 20.0, 4.0) is None


def test_pixels_of_infinite_noise_do_not_matter() -> None:
    clean = clean_image((41, 41), [Spot(20.2, 19.7, 3.0, 100.0)], 50.0, 0.7)
    spoilt, noise = clean.copy(), np.ones_like(clean)
    spoilt[24:26, 14:17], noise[24:26, 14:17] = 255.0, np.inf
    disc = _fit_one(spoilt, noise, 20.0, 20.0, 3.0)
    assert disc is not None
    assert disc.xy == pytest.approx([20.2, 19.7], abs=0.01)


def test_discs_are_fitted_together_as_each_alone() -> None:
    """Of all sizes, some of them where nothing is or at the border: none changes what becomes of another."""
    rng = np.random.default_rng(17)
    radii = np.array([1.5, 12.0, 2.5, 6.0, 3.0, 1.8, 9.0, 4.0])
    places = np.column_stack((np.full(8, 40.0), 30.0 + 55.0 * np.arange(8))) + rng.uniform(-0.5, 0.5, (8, 2))
    spots = [Spot(float(x), float(y), float(r), 90.0) for (x, y), r in zip(places, radii, strict=True)]
    clean = clean_image((80, 460), spots, 60.0, 0.8)
    noisy = clean + rng.standard_normal(clean.shape)
    starts = np.vstack((places + rng.uniform(-0.5, 0.5, (8, 2)), [(15.0, 200.0), (1.0, 100.0)]))
    sizes = np.append(radii * rng.uniform(0.8, 1.25, 8), (3.0, 3.0))
    together = fit_discs(noisy, np.ones_like(noisy), starts, sizes)
    assert [disc is not None for disc in together] == [True] * 8 + [False] * 2
    for disc, (x, y), size in zip(together[:8], starts, sizes, strict=False):
        alone = _fit_one(noisy, np.ones_like(noisy), x, y, size)
        assert disc is not None
        assert alone is not None
        assert np.hypot(*(disc.xy - alone.xy)) < 0.01 * alone.sigma.max()
        assert disc.radius == pytest.approx(alone.radius, rel=1e-3)
        assert disc.sigma == pytest.approx(alone.sigma, rel=1e-3)
