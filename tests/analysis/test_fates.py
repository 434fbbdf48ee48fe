"""What became of points and skis: each pulse, each image, with the one reason that holds."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

import numpy as np

from analysis.measurements.model import (
    POINTS,
    ImageMeasurements,
    JumpMeasurements,
    Measurements,
    PointMeasurement,
    PulseMeasurements,
)
from analysis.procedure.jump import compute_jump
from analysis.result.fates import Fate, ImageFate, PartFate
from analysis.result.model import Jump
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump

FLIGHT = 20  # a pulse of the flight, in sight of all cameras
_NONE: Mapping[str, PointMeasurement] = {}


@cache
def _measured() -> Measurements:
    return simulated_measurements(true_jump(3), true_cameras(), np.random.default_rng(3))


def _computed(change: Callable[[int, PulseMeasurements], PulseMeasurements] = lambda _, pulse: pulse) -> Jump:
    """The jump from changed measurements; pulses are counted from 0."""
    measured = _measured()
    changed = tuple(change(k, pulse) for k, pulse in enumerate(measured.jumps[0].pulses))
    return compute_jump(JumpMeasurements(1, changed), measured, true_cameras()).jump


def _at_flight(
    points: Mapping[str, Callable[[Mapping[str, PointMeasurement]], Mapping[str, PointMeasurement]]],
) -> Jump:
    """The jump with other points in some images of one pulse of the flight."""

    def changed(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        if k != FLIGHT:
            return pulse
        images = {
            name: ImageMeasurements(points[name](image.points), image.skis) if name in points else image
            for name, image in pulse.images.items()
        }
        return replace(pulse, images=images)

    return _computed(changed)


def _without(what: str) -> Callable[[Mapping[str, PointMeasurement]], Mapping[str, PointMeasurement]]:
    return lambda points: {name: point for name, point in points.items() if name != what}


def _shifted(
    what: str, px: tuple[float, float]
) -> Callable[[Mapping[str, PointMeasurement]], dict[str, PointMeasurement]]:
    return lambda points: {
        name: replace(point, xy=point.xy + px) if name == what else point for name, point in points.items()
    }


def _fate(jump: Jump, what: str) -> PartFate:
    return jump.pulses[FLIGHT].fates[what]


def test_a_fate_says_the_same_as_the_raw_solution() -> None:
    jump = _computed()
    used = missing = 0
    for pulse in jump.pulses:
        for what, part in pulse.fates.items():
            raw = pulse.raw.points[what] if what in POINTS else pulse.raw.skis[what]
            assert (part.fate is Fate.USED) == (raw is not None)
            there = {name for name, fate in part.images.items() if fate in (ImageFate.USED, ImageFate.RAW_ONLY)}
            assert there == set(() if raw is None else raw.cameras)
            used, missing = used + (raw is not None), missing + (raw is None)
    assert used > 5 * missing > 0


def test_what_was_not_measured_is_not_found_and_at_the_border_out_of_sight() -> None:
    jump = _at_flight({"K1": _without("P1"), "K2": _without("P1"), "K3": _without("P2")})
    helmet, hip = _fate(jump, "P1"), _fate(jump, "P2")
    assert helmet.fate is Fate.NOT_FOUND
    assert helmet.images == {"K1": ImageFate.NOT_FOUND, "K2": ImageFate.NOT_FOUND, "K3": ImageFate.NOT_USED}
    assert hip.fate is Fate.USED
    assert hip.images["K3"] is ImageFate.NOT_FOUND
    first = jump.pulses[0].fates
    assert ImageFate.OUT_OF_SIGHT in {fate for part in first.values() for fate in part.images.values()}


def test_a_wrong_image_of_three_is_a_gross_error() -> None:
    part = _fate(_at_flight({"K2": _shifted("P2", (0.0, 30.0))}), "P2")
    assert part.fate is Fate.USED
    assert part.images == {"K1": ImageFate.USED, "K2": ImageFate.GROSS_ERROR, "K3": ImageFate.USED}


def test_images_that_contradict_each_other_without_a_single_wrong_one() -> None:
    part = _fate(_at_flight({"K1": _shifted("P2", (0.0, 30.0)), "K2": _shifted("P2", (0.0, -40.0))}), "P2")
    assert part.fate is Fate.DISAGREE
    assert set(part.images.values()) == {ImageFate.NOT_USED}


def test_two_images_that_the_motion_contradicts() -> None:
    part = _fate(_at_flight({"K1": _without("P2"), "K2": _shifted("P2", (12.0, 0.0))}), "P2")
    assert part.fate is Fate.MOTION
    assert part.images["K1"] is ImageFate.NOT_FOUND


def test_a_name_that_nothing_bears_out() -> None:
    def bare(_: int, pulse: PulseMeasurements) -> PulseMeasurements:
        only = {"P2": "P3"}
        images = {
            name: ImageMeasurements({only[p]: point for p, point in image.points.items() if p in only}, {})
            for name, image in pulse.images.items()
        }
        return replace(pulse, images=images)

    part = _fate(_computed(bare), "P3")
    assert part.fate is Fate.NAME
    assert set(part.images.values()) == {ImageFate.NOT_USED}


def test_a_camera_without_a_frame() -> None:
    def gone(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        return replace(pulse, images={n: i for n, i in pulse.images.items() if n != "K2" or k != FLIGHT})

    part = _fate(_computed(gone), "P1")
    assert part.fate is Fate.USED
    assert part.images["K2"] is ImageFate.NO_FRAME
