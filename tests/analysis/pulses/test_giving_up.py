"""Skis of two images, of which one shows something else: nothing but the motion tells it."""

from dataclasses import replace

import numpy as np

from analysis.measurements.model import ImageMeasurements, JumpMeasurements, SkiMeasurement, Source
from analysis.procedure.jump import compute_jump
from analysis.result.model import Jump
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump

WRONG = (20, 25)  # pulses of the jump, in flight
TURNED = 0.03  # rad


def _turned(ski: SkiMeasurement, source: Source) -> SkiMeasurement:
    middle = ski.xy.mean(axis=0)
    along = ski.xy - middle
    return replace(ski, xy=ski.xy + TURNED * np.stack((-along[:, 1], along[:, 0]), axis=1), source=source)


def _jump(source: Source = Source.AUTOMATIC, *, turned: bool = True) -> Jump:
    """A simulated jump in which K2 never shows the left ski, and K3 shows something else in its place twice."""
    measured = simulated_measurements(true_jump(3), true_cameras(), np.random.default_rng(3))
    pulses = list(measured.jumps[0].pulses)
    for k, pulse in enumerate(pulses):
        images = dict(pulse.images)
        if "K2" in images:
            skis = {side: ski for side, ski in images["K2"].skis.items() if side != "left"}
            images["K2"] = ImageMeasurements(images["K2"].points, skis)
        if turned and k in WRONG:
            skis = {**images["K3"].skis, "left": _turned(images["K3"].skis["left"], source)}
            images["K3"] = ImageMeasurements(images["K3"].points, skis)
        pulses[k] = replace(pulse, images=images)
    return compute_jump(JumpMeasurements(1, tuple(pulses)), measured, true_cameras()).jump


def _missing(jump: Jump) -> set[int]:
    return {k for k, pulse in enumerate(jump.pulses) if pulse.raw.skis["left"] is None}


def test_a_ski_of_two_images_that_the_motion_contradicts_is_given_up() -> None:
    right, wrong = _jump(turned=False), _jump()
    assert _missing(wrong) - _missing(right) == set(WRONG)
    for k in WRONG:
        assert right.pulses[k].raw.skis["left"] is not None
        raw = wrong.pulses[k].raw
        assert raw.angles["gamma"] is None
        assert raw.skis["right"] is not None


def test_what_a_hand_measured_is_not_given_up() -> None:
    assert not _missing(_jump(Source.BY_HAND)) & set(WRONG)
