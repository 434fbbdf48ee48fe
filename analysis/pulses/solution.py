"""Solves the pulses of a jump one by one: the raw solution, for whose values nothing is assumed about the motion."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from analysis.measurements.model import POINTS, SIDES, JumpMeasurements, Measurements, PulseMeasurements
from analysis.pulses.giving_up import ExpectedPoints, ExpectedSkis, give_up_points, give_up_skis
from analysis.pulses.gross_errors import Checked, check_points, check_skis
from analysis.pulses.least_squares import Condition, adjust
from analysis.pulses.points import points_of
from analysis.pulses.scaling import scaled_to_fit
from analysis.pulses.skis import skis_of
from analysis.pulses.states import Solved, jumper_states
from analysis.pulses.travel import velocities
from analysis.result.model import JumperState, Quantity, RayTest, SmoothedState
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from rig.arrays import Integers
from rig.errors import BadInputError

_NS = 1e-9
_TOGETHER_S = 1e-7  # within which exposures are simultaneous: 3 um of way


@dataclass(frozen=True, slots=True, eq=False)
class RawJump:
    """A jump, solved pulse by pulse.

    Attributes:
        states: one for each pulse of the measurements, in order, at the middle of the exposures.
        tests: of all rays and image lines, the worst first. Where an error was found, but not the wrong ray, all rays
            of that point are removed.
        conditions: of P1 to P4 and the skis, pulse by pulse.
        scale: factors by which the sigmas of "points" and "skis" in the images were too small: if they are not 1, most
            of them agree worse than their sigmas said, and all results are computed with these sigmas times the factor.
    """

    states: tuple[JumperState, ...]
    tests: tuple[RayTest, ...]
    conditions: tuple[Mapping[str, Condition], ...] = ()
    scale: Mapping[str, float] = field(default_factory=dict)


def solve_pulses(
    jump: JumpMeasurements,
    measurements: Measurements,
    system: CameraSystem,
    smoothed: Sequence[SmoothedState | None] = (),
    doubted: Collection[RayTest] = (),
    late: Mapping[str, Quantity] | None = None,
) -> RawJump:
    """Intersect points and skis of each pulse, compute angles, height and speed, and test all rays.

    Args:
        jump: what was measured; images of cameras that are not oriented are left out.
        measurements: the recording that the jump belongs to, with the cameras' exposure times.
        system: the oriented cameras.
        smoothed: states of the pulses by the motion over time; points and skis that contradict them are given up if
            too few images control them. None at all: nothing is known of the motion.
        doubted: rays that contradict the motion.
        late: by camera how much later than at the pulse it shows the jumper, s, of cameras that are not synchronous.

    Raises:
        BadInputError: images have another size than the camera was calibrated for.
    """
    cameras = [system[name] for name in system.names]
    _check_sizes(cameras, measurements)
    pulses = jump.pulses
    if not pulses:
        return RawJump((), ())
    times = np.array([(pulse.time - pulses[0].time) * _NS for pulse in pulses])
    lateness = np.array([_lateness(camera.name, measurements, late or {}) for camera in cameras])
    shift = spread = None
    if np.abs(lateness).max() > _TOGETHER_S:
        place = adjust(points_of(system, pulses), system.covariance).state  # good enough for the velocity
        velocity = velocities(place.reshape(-1, len(POINTS), 3), times)[:, None]
        shift, spread = (lateness[:, i, None] * velocity for i in range(2))
    points, skis = points_of(system, pulses, shift, spread), skis_of(system, pulses, shift, spread)
    other_names = [skis.interchanged(image) for image in range(len(cameras))]
    points, places, points_scale = scaled_to_fit(points, system.covariance)
    skis, lines, skis_scale = scaled_to_fit(skis, system.covariance, other_names)
    numbers = np.array([pulse.pulse for pulse in pulses])
    good_points = check_points(points, places, system.covariance)
    good_skis = check_skis(skis, lines, system.covariance)
    if smoothed:
        expected = _expected_points(smoothed, doubted, numbers, system.names)
        expected = replace(expected, doubted=expected.doubted & ~points.by_hand)
        good_points = give_up_points(points, good_points, system.covariance, expected)
        good_skis = give_up_skis(skis, good_skis, _expected_skis(smoothed))
    solved = Solved(good_points, points.by_hand, good_skis, skis.by_hand)
    tests = sorted(_tests(solved, pulses, system.names), key=lambda test: (np.isnan(test.w), -test.w))
    scale = {"points": points_scale, "skis": skis_scale}
    return RawJump(jumper_states(solved, numbers, times, system), tuple(tests), _conditions(solved), scale)


def _conditions(solved: Solved) -> tuple[dict[str, Condition], ...]:
    """Of points and skis, pulse by pulse."""
    points = solved.points.adjusted.condition.reshape(-1, len(POINTS))
    skis = solved.skis.adjusted.condition.reshape(-1, len(SIDES))
    both = np.concatenate((points, skis), axis=1)
    return tuple(dict(zip((*POINTS, *SIDES), map(Condition, row), strict=True)) for row in both.tolist())


def _lateness(camera: str, measurements: Measurements, late: Mapping[str, Quantity]) -> tuple[float, float]:
    """How much later than the instant of the result a camera sees the jumper, and the standard deviation of that, s."""
    known, offset = measurements.late_s(camera), late.get(camera)
    return (known, 0.0) if offset is None else (known + offset.value, offset.sigma)


def _expected_points(
    smoothed: Sequence[SmoothedState | None], doubted: Collection[RayTest], pulses: Integers, names: tuple[str, ...]
) -> ExpectedPoints:
    """What the motion says of all points, P1 to P4 pulse by pulse."""
    n = len(pulses) * len(POINTS)
    xyz, covariance, flags = np.full((n, 3), np.nan), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, len(names)), bool)
    for k, state in enumerate(smoothed):
        for i, name in enumerate(POINTS):
            if state is not None and (point := state.points[name]) is not None:
                xyz[k * len(POINTS) + i], covariance[k * len(POINTS) + i] = point.xyz, point.covariance
    row = {int(pulse): k * len(POINTS) for k, pulse in enumerate(pulses)}
    for test in doubted:
        if test.what in POINTS:
            flags[row[test.pulse] + POINTS.index(test.what), names.index(test.camera)] = True
    return ExpectedPoints(xyz, covariance, flags)


def _expected_skis(smoothed: Sequence[SmoothedState | None]) -> ExpectedSkis:
    """What the motion says of all skis, right and left pulse by pulse."""
    n = len(smoothed) * len(SIDES)
    direction, covariance = np.full((n, 3), np.nan), np.tile(np.eye(2), (n, 1, 1))
    for k, state in enumerate(smoothed):
        for i, side in enumerate(SIDES):
            if state is not None and (ski := state.skis[side]) is not None:
                direction[k * len(SIDES) + i], covariance[k * len(SIDES) + i] = ski.direction, ski.covariance
    return ExpectedSkis(direction, covariance)


def _check_sizes(cameras: list[PlacedCamera], measurements: Measurements) -> None:
    for camera in cameras:
        there = measurements.cameras.get(camera.name)
        size = (int(camera.size[0]), int(camera.size[1]))
        if there is not None and there.size != size:
            measured, calibrated = (f"{width} x {height}" for width, height in (there.size, size))
            raise BadInputError(
                f"camera {camera.name}: measured in images of {measured} px, but oriented for {calibrated} px; "
                "give the calibration that belongs to these images"
            )


def _tests(solved: Solved, pulses: tuple[PulseMeasurements, ...], names: tuple[str, ...]) -> list[RayTest]:
    return [*_of(solved.points, POINTS, pulses, names), *_of(solved.skis, SIDES, pulses, names)]


def _of(
    checked: Checked, what: tuple[str, ...], pulses: tuple[PulseMeasurements, ...], names: tuple[str, ...]
) -> list[RayTest]:
    rows, images = np.nonzero(np.isfinite(checked.residual))
    return [
        RayTest(
            pulses[row // len(what)].pulse,
            names[image],
            what[row % len(what)],
            float(checked.residual[row, image]),
            float(checked.w[row, image]),
            bool(checked.removed[row, image]),
        )
        for row, image in zip(rows, images, strict=True)
    ]
