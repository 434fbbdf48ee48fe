"""Spots of markers that are measured again as discs."""

import numpy as np
from scipy.ndimage import gaussian_filter

from analysis.candidates.markers.soft_discs import fit_soft_discs
from analysis.identification.markers.refinement import off_centre, radius_in_full_view

_PARTS = 10  # of a pixel's side, in which a disc is drawn
_RADIUS, _SIDE, _NOISE, _GROUND, _BRIGHT = 1.3, 20, 1.5, 45.0, 220.0


def _spots(in_sight: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Small discs of which a straight border leaves a share of the width, as soft spots; those alone that are good.

    Returns their errors (n, 2), covariances (n, 2, 2), radii (n,) and contrasts (n,).
    """
    steps = (np.arange(_SIDE * _PARTS) + 0.5) / _PARTS - 0.5
    count = len(in_sight)
    centres = (_SIDE - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    angles = rng.uniform(0, 2 * np.pi, count)
    sheet = np.empty((count * _SIDE, _SIDE), np.float32)
    for i, ((x0, y0), angle, share) in enumerate(zip(centres, angles, in_sight, strict=True)):
        x, y = np.meshgrid(steps - x0, steps - y0)
        seen = (np.hypot(x, y) < _RADIUS) & (x * np.cos(angle) + y * np.sin(angle) < (2 * share - 1) * _RADIUS)
        fine = np.where(seen, _BRIGHT, _GROUND).reshape(_SIDE, _PARTS, _SIDE, _PARTS).mean(axis=(1, 3))
        sheet[i * _SIDE : (i + 1) * _SIDE] = gaussian_filter(fine, 0.6)
    sheet += _NOISE * rng.standard_normal(sheet.shape).astype(np.float32)
    true = centres + np.column_stack((np.zeros(count), np.arange(count) * _SIDE))
    start = true - ((1 - in_sight) * _RADIUS)[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    found = fit_soft_discs(sheet, np.full_like(sheet, _NOISE), start, np.full(count, _RADIUS))
    good = np.asarray(found.good)
    return (found.xy - true)[good], found.covariance[good], found.radius[good], found.contrast[good]


def test_what_is_left_of_a_small_marker_is_as_uncertain_as_it_is_faint() -> None:
    """It may look as large as all of it, since the blur is."""
    rng = np.random.default_rng(3)
    whole = float(np.median(_spots(np.ones(40), rng)[3]))
    off, covariance, radius, contrast = _spots(np.tile((0.3, 0.4, 0.5), 40), rng)
    assert len(off) > 60
    squares = []
    for e, own, shown, light in zip(off, covariance, radius, contrast / whole, strict=True):
        total = own + off_centre(float(shown), _RADIUS, float(light)) ** 2 * np.eye(2)
        squares.append(float(e @ np.linalg.solve(total, e)) / 2)
    assert 0.3 < np.mean(squares) < 2.0
    assert np.mean(np.array(squares) > 8) < 0.03


def test_the_size_of_markers_is_that_of_whole_ones() -> None:
    """Of helmet and hip alone, the hip is half behind an arm in all images, or something bright is beside it."""
    which = np.repeat((0, 1), 10)
    whole, bright = 1.5 * np.ones(10), 80.0 * np.ones(10)
    covered = radius_in_full_view(np.concatenate((whole, 0.3 * whole)), np.concatenate((bright, 0.5 * bright)), which)
    beside = radius_in_full_view(np.concatenate((whole, 1.4 * whole)), np.concatenate((bright, bright)), which)
    assert covered == beside == 1.5
