"""Soft discs and bars against images that are drawn without the models."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from analysis.candidates.foreground.background import Background, Region
from analysis.candidates.markers.known_discs import DiscShape, Windows, fit_known_discs
from analysis.candidates.markers.soft_discs import fit_soft_discs
from analysis.scene.static_image import StaticImage
from rig.arrays import Floats
from tests.analysis.scene.rendering import Spot, clean_image

NOISE = 2.5
_PARTS = 8  # of a pixel, along each axis


def test_centres_of_streaks_have_sigmas_that_hold() -> None:
    rng = np.random.default_rng(7)
    count, pitch = 60, 24
    places = np.column_stack((np.full(count, 12.0), 12.0 + pitch * np.arange(count))) + rng.uniform(
        -0.5, 0.5, (count, 2)
    )
    half = np.array((0.6, 0.2))  # px of motion, a third of it down
    discs = [
        Spot(float(x), float(y), 1.6, 15.0) for xy in places for x, y in xy + np.linspace(-1, 1, 12)[:, None] * half
    ]
    clean = clean_image((24, pitch * count), discs, 40.0, 0.6)
    noisy = (clean + NOISE * rng.standard_normal(clean.shape)).astype(np.float32)
    fitted = fit_soft_discs(noisy, np.full(clean.shape, NOISE, np.float32), np.rint(places), np.full(count, 1.6))
    assert fitted.good.all()
    off = fitted.xy - places
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(fitted.covariance), off) / 2
    # 120 squares scatter by 2 / sqrt(120) = 0.18 about 1
    assert 0.55 < squares.mean() < 1.45
    assert abs(float(np.median(fitted.radius)) - 1.6) < 0.3


@pytest.mark.parametrize("cover", [90.0, 215.0, 20.0], ids=["a little darker", "brighter", "much darker"])
def test_centres_of_partly_covered_discs_have_sigmas_that_hold(cover: float) -> None:
    """A straight border covers up to nine tenths of the diameter, from eight sides."""
    rng = np.random.default_rng(11)
    radius, side, count = 3.0, 29, 96
    depths = np.tile(np.linspace(0.0, 0.9, 12), 8)  # shares of the diameter
    angles = np.repeat(np.arange(8) * np.pi / 4 + 0.2, 12)
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [
            _covered_disc(side, centre, radius, angle, (1 - 2 * depth) * radius, cover)
            for centre, angle, depth in zip(centres, angles, depths, strict=True)
        ]
    )
    images += NOISE * rng.standard_normal(images.shape)
    # What a fit without knowledge of the size finds is the middle of the visible part.
    starts = centres - 0.9 * (depths * radius)[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    shape = DiscShape(np.full(count, radius), 0.04, np.zeros((count, 2)), 130.0, 32.0)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    clear = depths < 0.4
    assert np.isfinite(found.xy[clear]).all()
    off = found.xy - centres
    there = np.asarray(np.isfinite(off).all(axis=1))
    assert there[depths > 0.7].mean() < 0.2, "of a sliver nothing is told"
    squares = np.einsum("ni,nij,nj->n", off[there], np.linalg.inv(found.covariance[there]), off[there]) / 2
    assert squares.mean() < 1.5
    assert (squares > 9).mean() <= 0.05
    assert np.sqrt((off[clear] ** 2).mean()) < 0.1, "px: starts are off by up to 0.9"


@pytest.mark.parametrize("border", [2.5, 3.0])
def test_something_faint_beside_a_disc_does_not_pull_it(border: float) -> None:
    """A sleeve a little brighter than the suit begins a pixel beside a marker, in all images alike."""
    rng = np.random.default_rng(5)
    radius, side, count = 1.6, 21, 64
    angles = np.arange(count) * 2 * np.pi / count
    towards = np.column_stack((np.cos(angles), np.sin(angles)))
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [_beside(side, centre, radius, angle, border) for centre, angle in zip(centres, angles, strict=True)]
    )
    images += NOISE * rng.standard_normal(images.shape)
    shape = DiscShape(np.full(count, radius), 0.04, np.zeros((count, 2)), 130.0, 32.0)
    starts = centres + rng.normal(0.0, 0.15, centres.shape)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    off = found.xy - centres
    # noise moves one centre by 0.03 px, their mean by 0.004
    assert abs(float((off * towards).sum(axis=1).mean())) < 0.022, "px"
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariance), off) / 2
    assert 0.3 < squares.mean() < 0.95


def test_discs_tell_their_size_themselves() -> None:
    """They are larger than expected, and half of them are partly covered: these need the size."""
    rng = np.random.default_rng(11)
    radius, side, count = 3.0, 29, 48
    depths = np.tile((0.0, 0.0, 0.0, 0.15, 0.25, 0.35), 8)  # shares of the diameter
    angles = np.repeat(np.arange(8) * np.pi / 4 + 0.2, 6)
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [
            _covered_disc(side, centre, radius, angle, (1 - 2 * depth) * radius, 90.0)
            for centre, angle, depth in zip(centres, angles, depths, strict=True)
        ]
    )
    images += NOISE * rng.standard_normal(images.shape)
    starts = centres - 0.9 * (depths * radius)[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    shape = DiscShape(np.full(count, 0.88 * radius), 0.04, np.zeros((count, 2)), 130.0, 32.0)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    off = found.xy - centres
    assert np.sqrt((off**2).mean()) < 0.07, "px"
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariance), off) / 2
    assert squares.mean() < 1.0


def test_discs_tell_their_contrast_themselves() -> None:
    """They are brighter than the spots that were first fitted to them, and a sliver is no whole disc that is faint."""
    rng = np.random.default_rng(11)
    radius, side, count = 1.4, 21, 96
    covered = np.arange(count) % 3 == 0
    angles = rng.uniform(0.0, 2 * np.pi, count)
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [
            _covered_disc(side, centre, radius, angle, (-0.3 if hidden else 2.0) * radius, 70.0)
            for centre, angle, hidden in zip(centres, angles, covered, strict=True)
        ]
    )
    images += NOISE * rng.standard_normal(images.shape)
    away = np.where(covered, 0.6 * radius, 0.0)
    starts = centres - away[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    shape = DiscShape(np.full(count, radius), 0.04, np.zeros((count, 2)), 95.0, 24.0)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    there = np.asarray(np.isfinite(found.xy).all(axis=1))
    assert there[~covered].mean() > 0.95
    assert there[covered].mean() < 0.1


def _beside(side: int, centre: Floats, radius: float, angle: float, border: float) -> NDArray[np.float64]:
    """A bright disc; beyond a line at `border` px from its centre the ground is brighter by a seventh of it."""
    steps = (np.arange(side * _PARTS) + 0.5) / _PARTS - 0.5
    x, y = np.meshgrid(steps - centre[0], steps - centre[1])
    ground = np.where(x * np.cos(angle) + y * np.sin(angle) > border, 78.0, 60.0)
    image = np.where(np.hypot(x, y) < radius, 190.0, ground)
    return np.asarray(gaussian_filter(image.reshape(side, _PARTS, side, _PARTS).mean(axis=(1, 3)), 0.55))


def _covered_disc(
    side: int, centre: Floats, radius: float, angle: float, border: float, cover: float
) -> NDArray[np.float64]:
    """A bright disc on a darker ground; beyond a line at `border` px from its centre there is something else."""
    steps = (np.arange(side * _PARTS) + 0.5) / _PARTS - 0.5
    x, y = np.meshgrid(steps - centre[0], steps - centre[1])
    image = np.where(np.hypot(x, y) < radius, 190.0, 60.0)
    if border < radius:
        image = np.where(x * np.cos(angle) + y * np.sin(angle) > border, cover, image)
    return np.asarray(gaussian_filter(image.reshape(side, _PARTS, side, _PARTS).mean(axis=(1, 3)), 0.55))


def test_changing_light_and_shake_are_no_movement() -> None:
    rng = np.random.default_rng(5)
    scene = gaussian_filter(rng.uniform(0, 1, (120, 160)), 3.0)
    scene = 60 + 100 * (scene - scene.min()) / np.ptp(scene)
    static = StaticImage("K1", scene.astype(np.float32), np.full(scene.shape, NOISE, np.float32), 31)
    moved = np.roll(scene, 1, axis=1) * 0.3 + scene * 0.7  # 0.3 px to the right
    image = 0.75 * moved + 9.0 + NOISE * rng.standard_normal(scene.shape)
    background = Background(static)
    assert background.regions(_uint8(image)) == []
    image[50:64, 70:92] += 40.0
    (region,) = background.regions(_uint8(image))
    assert region.holds(np.array((80.0, 57.0)))
    assert abs(float(np.median(region.noise)) / NOISE - 1) < 0.2


def _uint8(image: Floats) -> NDArray[np.uint8]:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _region(grey: Floats, behind: Floats) -> Region:
    sigma = np.full(grey.shape, NOISE, np.float32)
    front = np.abs(grey - behind) > 4 * NOISE
    return Region(0, 0, grey.astype(np.float32), behind.astype(np.float32), sigma, sigma, front)
