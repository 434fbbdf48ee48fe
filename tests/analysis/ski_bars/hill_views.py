"""What the cameras of a simulated hill show of skis."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import cv2
import numpy as np

from analysis.candidates.foreground.background import Background, Region
from analysis.scene.static_image import StaticImage
from analysis.ski_bars.pixels import SkiView
from bench.analysis.simulated import true_cameras
from rig.arrays import Floats, Integers
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


def with_bars(view: SkiView, bars: Sequence[tuple[Floats, Floats]]) -> SkiView:
    """The view with dark bars between places in space."""

    def part(low: Integers, high: Integers) -> Region | None:
        region = view.part(low, high)
        if region is None:
            return None
        grey = region.grey.copy()
        for ends in bars:
            xy = view.camera.project(np.array(ends)) - (region.x, region.y)
            if np.isfinite(xy).all():
                first, last = np.rint(xy).astype(int).tolist()
                cv2.line(grey, first, last, 20.0, 3)
        return replace(region, grey=grey)

    return replace(view, part=part)
