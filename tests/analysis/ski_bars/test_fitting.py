"""Both skis are found in all images together, off by what their sigmas say; what is no ski is refused."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import pytest

from analysis.candidates.foreground.background import Background
from analysis.scene.static_image import StaticImage
from analysis.ski_bars.bars import ExpectedBars, Poses
from analysis.ski_bars.fitting import FittedBars, fit_bars
from analysis.ski_bars.pixels import SkiView
from bench.analysis.simulated import true_cameras
from rig.arrays import Floats
from tests.analysis.digitizing.following.tracked_hill import NAMES, TrackedHill, hill
from tests.analysis.ski_bars.hill_views import views_of, with_bars

SYSTEM = true_cameras()
SIGMA = np.tile((0.03, 0.03, 0.03, 0.02, 0.02), 2)
SHAPE, SHAPE_SIGMA = (0.0, -1.34, 1.34), (0.005, 0.01, 0.01)


@pytest.fixture(scope="module")
def of() -> TrackedHill:
    return hill(21)


def _true(of: TrackedHill, pulse: int) -> Poses:
    skis = [of.truth[pulse]["skis"][side] for side in ("right", "left")]
    return Poses(np.array([ski["point"] for ski in skis]), np.array([ski["direction"] for ski in skis]))


def _fitted(of: TrackedHill, pulse: int, rng: np.random.Generator, *, empty: bool = False) -> FittedBars:
    views = []
    for name in NAMES:
        still = np.stack([of.frames(p)[name] for p in (30, 31, 78, 79)])
        grey = np.median(still, axis=0).astype(np.float32)
        background = Background(StaticImage(name, grey, np.full_like(grey, 2.0), len(still)))
        image = of.frames(30 if empty else pulse)[name]
        views.append(SkiView(SYSTEM[name], partial(background.part, image), np.zeros(3)))
    poses = _true(of, pulse).moved((rng.normal(size=10) * SIGMA).reshape(2, 5))
    shape, sigma = np.tile(SHAPE, (2, 1)), np.tile(SHAPE_SIGMA, (2, 1))
    return fit_bars(views, ExpectedBars(poses, np.diag(SIGMA**2), shape, sigma))


def test_lines_of_the_images_are_off_by_their_sigmas(of: TrackedHill) -> None:
    rng, errors = np.random.default_rng(3), []
    flight = of.in_sight("P1")[6:22:5]
    for pulse in flight:
        fitted, true = _fitted(of, pulse, rng), _true(of, pulse)
        for name, lines in fitted.lines.items():
            for k, line in enumerate(lines):
                if line is not None:
                    ends = SYSTEM[name].project(true.point[k] + np.outer((-1, 1), true.direction[k]))
                    along = (ends[1] - ends[0]) / np.hypot(*(ends[1] - ends[0]))
                    errors.append((line.xy - ends[0]) @ np.array((-along[1], along[0])) / line.sigma)
    assert len(errors) >= 4 * len(flight)  # of 6 a pulse; boots and legs hide the rest
    assert np.sqrt(np.mean(np.square(errors))) < 2.0  # 24 lines
    assert np.abs(errors).max() < 5


def test_a_scene_without_skis_is_refused(of: TrackedHill) -> None:
    fitted = _fitted(of, of.in_sight("P1")[10], np.random.default_rng(4), empty=True)
    assert fitted.seen == (False, False)
    assert all(line is None for lines in fitted.lines.values() for line in lines)


def _fitted_bars(of: TrackedHill, drawn: Callable[[str], Sequence[int]], off: Floats) -> FittedBars:
    """Bars are fitted that are drawn without a jumper, the left one half a metre above the ski of a jump.

    Args:
        of: the hill.
        drawn: by camera the skis that its image shows.
        off: (2, 3) by how much farther the bindings are expected, m.
    """
    true = _drawn(of)
    ends = [(X - 1.3 * d, X + 1.3 * d) for X, d in zip(true.point, true.direction, strict=True)]
    views = [with_bars(view, [ends[k] for k in drawn(view.camera.name)]) for view in views_of(of, [30])[0]]
    sigma = np.tile((0.03, 0.03, 0.03, 0.05, 0.05), 2)
    shape, shape_sigma = np.tile(SHAPE, (2, 1)), np.tile(SHAPE_SIGMA, (2, 1))
    expected = ExpectedBars(Poses(true.point + off, true.direction), np.diag(sigma**2), shape, shape_sigma)
    return fit_bars(views, expected, near=True)


def _drawn(of: TrackedHill) -> Poses:
    """Where bars are drawn."""
    true = _true(of, of.in_sight("P1")[20])
    return Poses(true.point + np.array(((0.0, 0.0, 0.0), (0.0, 0.0, 0.5))), true.direction)


def test_bars_that_all_images_show_are_fitted(of: TrackedHill) -> None:
    assert _fitted_bars(of, lambda _: (0, 1), np.zeros((2, 3))).seen == (True, True)


def test_what_one_ski_explains_shows_no_second_one(of: TrackedHill) -> None:
    true = _drawn(of)
    onto_the_right = np.stack((np.zeros(3), true.point[0] - true.point[1]))
    assert sum(_fitted_bars(of, lambda _: (0,), onto_the_right).seen) < 2


def test_no_ski_is_where_an_image_shows_the_scene(of: TrackedHill) -> None:
    """Two images of three show the left ski; the third one shows what is behind it."""
    fitted = _fitted_bars(of, lambda name: (0,) if name == NAMES[2] else (0, 1), np.zeros((2, 3)))
    assert fitted.seen == (True, False)
