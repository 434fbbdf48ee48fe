"""The verdict on a jump: what it says when something is missing or wrong, and that it accuses nobody else."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from analysis.measurements.model import ImageMeasurements, JumpMeasurements, Measurements, PulseMeasurements, Source
from analysis.procedure.jump import compute_jump
from analysis.result.model import Jump
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump


def test_points_that_are_never_seen_together_may_be_named_wrong() -> None:
    system = true_cameras()
    measured = simulated_measurements(true_jump(3), system, np.random.default_rng(3))
    whole = measured.jumps[0]
    without = tuple(
        replace(
            pulse,
            images={
                name: replace(image, points={key: of for key, of in image.points.items() if key != "P2"})
                for name, image in pulse.images.items()
            },
        )
        for pulse in whole.pulses
    )
    assert "which is which" not in compute_jump(whole, measured, system).jump.verdict.message
    verdict = compute_jump(JumpMeasurements(1, without), measured, system).jump.verdict
    assert not verdict.ok
    assert "no pulse shows all four points, so it is not certain which is which" in verdict.message


def test_nothing_is_given_where_nothing_tells_which_marker_is_which() -> None:
    def three_markers(_: int, pulse: PulseMeasurements) -> PulseMeasurements:
        markers = {
            name: ImageMeasurements({key: of for key, of in image.points.items() if key != "P2"}, {})
            for name, image in pulse.images.items()
        }
        return replace(pulse, images=markers)

    jump = _computed(three_markers)
    assert len(jump.pulses) == len(_measured().jumps[0].pulses)
    assert all(point is None for pulse in jump.pulses for point in pulse.raw.points.values())
    assert all(pulse.smoothed is None for pulse in jump.pulses)
    assert not jump.verdict.ok
    assert jump.verdict.message.count("which marker is which cannot be told, so none is given") == 1


def _measured() -> Measurements:
    return simulated_measurements(true_jump(3), true_cameras(), np.random.default_rng(3))


def _computed(change: Callable[[int, PulseMeasurements], PulseMeasurements]) -> Jump:
    """A simulated jump, computed from changed measurements; pulses are counted from 0."""
    measured = _measured()
    changed = tuple(change(k, pulse) for k, pulse in enumerate(measured.jumps[0].pulses))
    return compute_jump(JumpMeasurements(1, changed), measured, true_cameras()).jump


def test_a_camera_that_was_gone_contradicts_nobody() -> None:
    count = len(_measured().jumps[0].pulses)

    def gone(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        return replace(pulse, images={n: i for n, i in pulse.images.items() if n != "K2" or k < count // 5})

    def blind(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        nothing = ImageMeasurements({}, {})
        images = {n: i if n != "K2" or k < count // 5 else nothing for n, i in pulse.images.items()}
        return replace(pulse, images=images)

    assert "points in its images" not in _computed(gone).verdict.message
    assert "camera K2 has the jumper's points in its images" in _computed(blind).verdict.message


def test_without_a_take_off_nothing_is_said_of_edge_and_flight() -> None:
    flying = _computed(lambda k, pulse: pulse if k >= 25 and k % 3 else replace(pulse, images={}))
    assert flying.takeoff is None
    assert "the take-off was not found" in flying.verdict.message
    assert "around the edge" not in flying.verdict.message
    assert "in flight" not in flying.verdict.message


def test_a_raw_point_that_the_motion_contradicts_is_marked() -> None:
    """Measured by hand, so that it is not given up although it has two rays only."""
    right, system, wrong = _computed(lambda _, pulse: pulse), true_cameras(), 20
    state = right.pulses[wrong].smoothed
    assert state is not None
    point = state.points["P3"]
    assert point is not None
    place = point.xyz
    ray = place - system["K1"].position
    along = 0.2 * ray / np.linalg.norm(ray)  # farther away for K1: its ray and that of K3 meet there without a residual
    off = np.diff(system["K3"].project(np.array((place, place + along))), axis=0)[0]

    def two_rays(k: int, pulse: PulseMeasurements) -> PulseMeasurements:
        if k != wrong:
            return pulse
        images = {name: image for name, image in pulse.images.items() if name != "K2"}
        point = images["K3"].points["P3"]
        points = {**images["K3"].points, "P3": replace(point, xy=point.xy + off, source=Source.BY_HAND)}
        return replace(pulse, images={**images, "K3": replace(images["K3"], points=points)})

    jump = _computed(two_rays)
    number = jump.pulses[wrong].pulse
    assert not _marked(right)
    assert _marked(jump) == [(number, "P3")]
    assert f"raw points that the motion contradicts: 1, P3 at pulse {number} the most (0.2" in jump.verdict.message


def _marked(jump: Jump) -> list[tuple[int, str]]:
    """Pulse and name of the raw points that the motion contradicts."""
    points = [(pulse.pulse, name, point) for pulse in jump.pulses for name, point in pulse.raw.points.items()]
    return [(pulse, name) for pulse, name, point in points if point is not None and point.contradicted]
