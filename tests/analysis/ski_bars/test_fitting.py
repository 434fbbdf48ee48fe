"""Both skis are found in all images together, off by what their sigmas say; what is no ski is refused."""

from functools import partial

import numpy as np
import pytest

from analysis.candidates.foreground.background import Background
from analysis.scene.static_image import StaticImage
from analysis.ski_bars.bars import ExpectedBars, Poses
from analysis.ski_bars.fitting import FittedBars, fit_bars
from analysis.ski_bars.pixels import SkiView
from bench.analysis.simulated import true_cameras
from tests.analysis.digitizing.following.tracked_hill import NAMES, TrackedHill, hill

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
