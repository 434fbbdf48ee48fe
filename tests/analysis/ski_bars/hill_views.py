"""What the cameras of a simulated hill show of skis."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from analysis.candidates.foreground.background import Background
from analysis.scene.static_image import StaticImage
from analysis.ski_bars.pixels import SkiView
from bench.analysis.simulated import true_cameras
from tests.analysis.digitizing.following.tracked_hill import NAMES, TrackedHill

SYSTEM = true_cameras()


def views_of(of: TrackedHill, pulses: Sequence[int]) -> list[list[SkiView]]:
    """The images of some pulses before the static scene."""
    backgrounds = {}
    for name in NAMES:
        grey = np.median([of.frames(p)[name] for p in (30, 31, 78, 79)], axis=0).astype(np.float32)
        backgrounds[name] = Background(StaticImage(name, grey, np.full_like(grey, 2.0), 4))
    return [
        [SkiView(SYSTEM[name], partial(backgrounds[name].part, of.frames(pulse)[name]), np.zeros(3)) for name in NAMES]
        for pulse in pulses
    ]
