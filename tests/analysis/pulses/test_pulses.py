"""The raw solution of each pulse: right in its sigmas, robust to one wrong ray, and nothing invented."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

from analysis.measurements.model import (
    SIDES,
    ImageMeasurements,
    JumpMeasurements,
    MeasuredCamera,
    Measurements,
    PulseMeasurements,
    SkiMeasurement,
    Source,
)
from analysis.pulses.solution import RawJump, solve_pulses
from analysis.pulses.travel import velocities
from analysis.result.model import JumperState, Status
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.jumper.stick_model import ANGLES, body_angles, slope
from rig.errors import BadInputError
from tests.analysis.simulated import RATE_HZ, TrueJump, drawn, simulated_measurements, true_cameras, true_jump

DRAWS = 20


def changed(
    measurements: Measurements, change: Callable[[PulseMeasurements, str, ImageMeasurements], ImageMeasurements | None]
) -> Measurements:
    """Measurements with each image changed, or left out where the change gives None."""
    pulses = []
    for pulse in measurements.jumps[0].pulses:
        images = {name: change(pulse, name, image) for name, image in pulse.images.items()}
        pulses.append(replace(pulse, images={name: image for name, image in images.items() if image is not None}))
    return replace(measurements, jumps=(JumpMeasurements(1, tuple(pulses)),))


def solved(measurements: Measurements) -> RawJump:
    """The raw solution with the cameras that are not in error."""
    return solve_pulses(measurements.jumps[0], measurements, true_cameras())


def numbers(state: JumperState) -> Iterator[tuple[str, float, float]]:
    """Everything that was measured: name, value, sigma."""
    for name, point in state.points.items():
        if point is not None:
            for axis in range(3):
                yield f"{name} {'XYZ'[axis]}", point.xyz[axis], float(np.sqrt(point.covariance[axis, axis]))
    for side, ski in state.skis.items():
        if ski is not None:
            yield f"{side} slope", ski.slope.value, ski.slope.sigma
            yield f"{side} heading", ski.heading.value, ski.heading.sigma
    single = {**state.angles, "height": state.height, "speed": state.speed}
    yield from ((name, q.value, q.sigma) for name, q in single.items() if q is not None)


def truth(jump: TrueJump, pulse: float) -> dict[str, float]:
    """The same of the simulated jumper."""
    pose = jump.pose(pulse)
    right, left = pose.skis
    values = {f"P{i + 1} {'XYZ'[axis]}": float(pose.markers[i][axis]) for i in range(4) for axis in range(3)}
    for side, ski in zip(SIDES, pose.skis, strict=True):
        values[f"{side} slope"] = float(np.degrees(slope(ski)))
        values[f"{side} heading"] = float(np.degrees(np.arctan2(ski[1], ski[0])))
    angles = np.degrees(body_angles(pose.markers[0], pose.markers[1], pose.markers[2:].mean(axis=0), right, left))
    way = jump.pose(pulse + 1).origin - jump.pose(pulse - 1).origin
    speed = float(np.linalg.norm(way)) * jump.rate_hz / 2
    return values | dict(zip(ANGLES, angles, strict=True)) | {"height": float(pose.origin[2]), "speed": speed}


@pytest.mark.long
def test_normalized_errors_over_calibration_draws() -> None:
    system, rng = true_cameras(), np.random.default_rng(1)
    errors: dict[str, list[list[float]]] = {}
    removed = rays = 0
    for draw in range(DRAWS):
        jump = true_jump(draw % 5)
        measurements = simulated_measurements(jump, system, rng)
        raw = solve_pulses(measurements.jumps[0], measurements, drawn(system, rng))
        removed, rays = removed + sum(test.removed for test in raw.tests), rays + len(raw.tests)
        normalized: dict[str, list[float]] = {}
        for pulse, state in zip(measurements.jumps[0].pulses, raw.states, strict=True):
            true = truth(jump, pulse.pulse)
            for name, value, sigma in numbers(state):
                normalized.setdefault(name, []).append((value - true[name]) / sigma)
        for name, values in normalized.items():
            errors.setdefault(name, []).append(values)
    assert len(errors) == 12 + 4 + 5 + 2
    for name, per_draw in errors.items():
        # The pulses of a draw share its calibration, so that the draws' means alone are independent: the mean square of
        # one normal variable scatters by the root of 2 / 20 = 0.32, and 23 names stay within 3 sigma of that.
        mean_square = float(np.mean([np.mean(np.square(values)) for values in per_draw]))
        assert mean_square == pytest.approx(1, abs=3 * np.sqrt(2 / DRAWS)), name
        inside = np.mean(np.abs(np.concatenate(per_draw)) < 2)
        assert 0.9 < inside < 0.99, name
    assert removed < 0.003 * rays  # risk 0.1 % for an object, of which all three rays may be given up


def test_gross_error_of_one_ray_is_removed_or_the_point_given_up() -> None:
    jump, rng = true_jump(2), np.random.default_rng(2)
    measurements = simulated_measurements(jump, true_cameras(), rng)
    wrong = {pulse.pulse: true_cameras().names[rng.integers(3)] for pulse in measurements.jumps[0].pulses[6:-6]}

    def spoil(pulse: PulseMeasurements, camera: str, image: ImageMeasurements) -> ImageMeasurements:
        if wrong.get(pulse.pulse) != camera:
            return image
        angle = rng.uniform(0, 2 * np.pi)
        hip = image.points["P2"]
        shifted = replace(hip, xy=hip.xy + 3 * np.array((np.cos(angle), np.sin(angle))))
        return replace(image, points={**image.points, "P2": shifted})

    raw = solved(changed(measurements, spoil))
    found = missed = 0
    for pulse, state in zip(measurements.jumps[0].pulses, raw.states, strict=True):
        hip = state.points["P2"]
        if pulse.pulse not in wrong or hip is None:
            continue
        camera = wrong[pulse.pulse]
        if len(hip.cameras) == 3:
            missed += 1
            continue
        assert camera not in hip.cameras
        assert hip.status is Status.TWO_RAYS
        test = next(t for t in raw.tests if (t.pulse, t.camera, t.what) == (pulse.pulse, camera, "P2"))
        assert test.removed
        error = hip.xyz - jump.pose(pulse.pulse).markers[1]
        assert error @ np.linalg.solve(hip.covariance, error) < 21  # chi-square, 3 degrees of freedom, 0.01 %
        found += 1
    # An error along an epipolar line fits one other ray, and the point is given up. An error of K1 in the direction in
    # which the other two, which stand close together, are weak is within their accuracy, and nothing shows it.
    assert found > 0.5 * len(wrong)
    assert missed < 0.1 * len(wrong)
    assert all(a.w >= b.w for a, b in zip(raw.tests, raw.tests[1:], strict=False) if np.isfinite(b.w))
    assert raw.tests[0].removed


@pytest.mark.parametrize("wrong", ["K1", "K2", "K3"])
def test_interchanged_skis_are_found_or_given_up(wrong: str) -> None:
    jump = true_jump(4)
    measurements = simulated_measurements(jump, true_cameras(), np.random.default_rng(3))

    def interchange(pulse: PulseMeasurements, camera: str, image: ImageMeasurements) -> ImageMeasurements:
        if camera != wrong or len(image.skis) < 2:
            return image
        return replace(image, skis={"right": image.skis["left"], "left": image.skis["right"]})

    raw = solved(changed(measurements, interchange))
    told = 0
    for pulse, state in zip(measurements.jumps[0].pulses, raw.states, strict=True):
        if not all(len(image.skis) == 2 for image in pulse.images.values()):
            continue
        true = truth(jump, pulse.pulse)
        told += sum(ski is not None and wrong not in ski.cameras for ski in state.skis.values())
        for name, value, sigma in numbers(state):
            if "slope" in name or "heading" in name:
                assert abs(value - true[name]) < 5 * sigma
    assert told > len(raw.states)  # of two skis in each pulse


def test_two_rays_one_ray_and_by_hand() -> None:
    measurements = simulated_measurements(true_jump(5), true_cameras(), np.random.default_rng(4))
    middle = len(measurements.jumps[0].pulses) // 2

    def without(pulse: PulseMeasurements, camera: str, image: ImageMeasurements) -> ImageMeasurements | None:
        if camera == "K1":
            return None
        points = {name: point for name, point in image.points.items() if (camera, name) != ("K2", "P1")}
        hand = {name: replace(point, source=Source.BY_HAND) for name, point in points.items() if name == "P2"}
        return replace(image, points={**points, **hand})

    raw = solved(changed(measurements, without))
    state = raw.states[middle]
    hip, binding, ski = state.points["P2"], state.points["P3"], state.skis["right"]
    assert hip is not None
    assert binding is not None
    assert ski is not None
    assert state.points["P1"] is None
    assert state.angles["beta"] is None
    assert state.angles["alpha"] is not None
    assert (hip.status, binding.status, ski.status) == (Status.BY_HAND, Status.TWO_RAYS, Status.TWO_RAYS)
    assert binding.cameras == ("K2", "K3")
    assert all(np.isnan(test.w) for test in raw.tests if test.what in SIDES)  # two planes always meet
    assert not any(test.what == "P1" for test in raw.tests)
    fewer = replace(true_cameras(), cameras={name: true_cameras()[name] for name in ("K2", "K3")})
    alike = solve_pulses(changed(measurements, without).jumps[0], measurements, fewer)
    np.testing.assert_allclose([n[1:] for n in numbers(alike.states[middle])], [n[1:] for n in numbers(state)])
    assert raw.states[0].speed is None
    assert raw.states[-1].speed is None


def test_ski_in_the_epipolar_plane_is_not_determined() -> None:
    measurements = simulated_measurements(true_jump(5), true_cameras(), np.random.default_rng(5))
    system = true_cameras()
    first, second = (system[name].position for name in ("K1", "K2"))

    def replace_ski(pulse: PulseMeasurements, camera: str, image: ImageMeasurements) -> ImageMeasurements | None:
        if camera == "K3" or "right" not in image.skis:
            return None
        tip, tail = (true_jump(5).pose(pulse.pulse).markers[2] + s * (second - first) for s in (-0.05, 0.05))
        line = np.linspace(system[camera].project(tip), system[camera].project(tail), 9)
        return ImageMeasurements({}, {"right": SkiMeasurement(line, np.full(9, 0.3))})

    assert all(state.skis["right"] is None for state in solved(changed(measurements, replace_ski)).states)


def test_exposures_of_different_length_belong_to_their_middles() -> None:
    jump = true_jump(6)
    exposures = {"K1": 0.001, "K2": 0.006, "K3": 0.002}
    late = {name: exposure / 2 - 0.0015 for name, exposure in exposures.items()}
    measurements = simulated_measurements(jump, true_cameras(), np.random.default_rng(6), late_s=late)
    cameras = {name: MeasuredCamera((640, 480), exposure) for name, exposure in exposures.items()}
    aware, unaware = (solved(m) for m in (replace(measurements, cameras=cameras), measurements))
    assert np.mean([test.w**2 for test in aware.tests if np.isfinite(test.w)]) < 1.2
    assert aware.scale["points"] == 1.0
    assert unaware.scale["points"] > 2  # what does not fit for another reason looks like scatter, up to one pixel
    middle = len(aware.states) // 2
    pulse = measurements.jumps[0].pulses[middle].pulse
    found, true = aware.states[middle].points["P2"], jump.pose(pulse).markers[1]
    assert found is not None
    assert np.abs(found.xyz - true).max() < 5 * np.sqrt(found.covariance.diagonal().max())


def test_wrong_places_at_the_ends_do_not_spoil_the_velocity() -> None:
    """At the borders of the images one marker is in sight first, and its first places are metres off."""
    times, true = np.arange(20) / RATE_HZ, np.array((25.0, 1.0, -6.0))
    points = times[:, None, None] * true + np.arange(4)[:, None]
    points[:2, 0] += (20.0, -12.0, 1.0)
    points[0, 1:] = np.nan
    points[-1, :3] = np.nan
    points[-2:, 3] -= (15.0, 0.0, 4.0)
    assert np.abs(velocities(points, times) - true).max() < 1e-6


def test_sigmas_that_most_measurements_exceed_are_scaled() -> None:
    measurements = simulated_measurements(true_jump(3), true_cameras(), np.random.default_rng(10))

    def boastful(_pulse: PulseMeasurements, _camera: str, image: ImageMeasurements) -> ImageMeasurements:
        points = {name: replace(point, covariance=point.covariance / 4) for name, point in image.points.items()}
        return replace(image, points=points)

    honest, scaled = solved(measurements), solved(changed(measurements, boastful))
    assert honest.scale == {"points": 1.0, "skis": 1.0}
    # the median of 150 chi-squares with 3 degrees of freedom scatters by 9 %, and so its root by 5 %
    assert scaled.scale["points"] == pytest.approx(2, rel=0.15)
    assert scaled.scale["skis"] == 1.0
    one, other = (next(p for p in raw.states[12].points.values() if p is not None) for raw in (honest, scaled))
    assert np.trace(other.covariance) == pytest.approx(np.trace(one.covariance), rel=0.2)


def test_a_camera_that_is_late_is_no_scatter() -> None:
    measurements = simulated_measurements(
        true_jump(3), true_cameras(), np.random.default_rng(11), late_s={"K2": 1 / RATE_HZ}
    )
    raw = solved(measurements)
    assert raw.scale == {"points": 1.0, "skis": 1.0}
    for state in raw.states:
        assert all(point is None or point.status is Status.TWO_RAYS for point in state.points.values())


def turned(system: CameraSystem, degrees: float) -> CameraSystem:
    """The same cameras in a survey whose frame is turned about Z and has its origin elsewhere."""
    turn = rotation_from_vector(np.array((0.0, 0.0, np.radians(degrees))))
    whole, cameras = np.eye(len(system.covariance)), {}
    for name, camera in system.cameras.items():
        whole[np.ix_(camera.columns[:3], camera.columns[:3])] = turn
        position = turn @ camera.position + np.array((300.0, -5000.0, 800.0))
        cameras[name] = replace(camera, position=position, rotation=turn @ camera.rotation)
    return CameraSystem(cameras, whole @ system.covariance @ whole.T)


@pytest.mark.parametrize("degrees", [90.0, 180.0, -137.0])
def test_any_survey_frame_gives_the_same_jumper(degrees: float) -> None:
    measurements = simulated_measurements(true_jump(8), true_cameras(), np.random.default_rng(8))
    here = solved(measurements)
    there = solve_pulses(measurements.jumps[0], measurements, turned(true_cameras(), degrees))
    for one, other in zip(here.states, there.states, strict=True):
        expected, found = ({name: (v, s) for name, v, s in numbers(state)} for state in (one, other))
        assert expected.keys() == found.keys()
        for name in set(expected) - {f"P{i} {axis}" for i in range(1, 5) for axis in "XYZ"} - {"height"}:
            value, sigma = expected[name]
            change = found[name][0] - value - (degrees if "heading" in name else 0.0)
            assert abs((change + 180) % 360 - 180) < 1e-5 * sigma, name
            assert found[name][1] == pytest.approx(sigma, rel=1e-4) or "heading" in name


def all_around(count: int) -> CameraSystem:
    """Cameras on both sides of the hill with lenses that distort, whose interior orientation is uncertain as well."""
    cameras, sigma = {}, []
    model = next(iter(true_cameras().cameras.values())).camera
    for i in range(count):
        position = np.array((-5 + 30 * i / (count - 1), (26.0 if i % 2 else -22.0) + i, 2.0 + i % 3))
        away = (position - np.array((9.0, 0.0, -2.0))) / np.linalg.norm(position - np.array((9.0, 0.0, -2.0)))
        right = np.cross((0.0, 0.0, 1.0), away) / np.linalg.norm(np.cross((0.0, 0.0, 1.0), away))
        interior = np.zeros(10)
        interior[0], interior[3] = 600.0 + 20 * i, 1e-8
        camera = replace(model, name=f"C{i}", interior=interior)
        rotation = np.stack((right, np.cross(away, right), away), axis=1)
        cameras[camera.name] = PlacedCamera(camera, position, rotation, np.arange(4), np.arange(10 * i, 10 * i + 10))
        sigma += [0.01] * 3 + [2e-4] * 3 + [0.5, 0.3, 0.3, 2e-9]
    mixed = np.eye(len(sigma)) + 0.3 * np.random.default_rng(0).standard_normal((len(sigma), len(sigma)))
    joint = mixed @ mixed.T
    return CameraSystem(cameras, joint * np.outer(sigma, sigma) / np.sqrt(np.outer(np.diag(joint), np.diag(joint))))


@pytest.mark.parametrize("count", [2, 6])
def test_any_number_of_cameras(count: int) -> None:
    system, rng, draws = all_around(count), np.random.default_rng(9), 6
    squares: dict[str, list[float]] = {}
    for draw in range(draws):
        jump = true_jump(draw % 4)
        measurements = simulated_measurements(jump, system, rng)
        middle = len(measurements.jumps[0].pulses) // 2
        pulses = measurements.jumps[0].pulses[middle - 1 : middle + 2]
        raw = solve_pulses(JumpMeasurements(1, pulses), measurements, drawn(system, rng))
        true = truth(jump, pulses[1].pulse)
        for name, value, sigma in numbers(raw.states[1]):
            squares.setdefault(name, []).append(((value - true[name]) / sigma) ** 2)
    assert len(squares) == 23
    total = sum(np.mean(values) for values in squares.values()) / len(squares)
    # 23 quantities of which about 12 are independent (20 unknowns, of which the calibration moves many together)
    assert total == pytest.approx(1, abs=3.5 * np.sqrt(2 / (12 * draws)))


def test_sizes_that_do_not_fit_are_refused() -> None:
    measurements = simulated_measurements(true_jump(1), true_cameras(), np.random.default_rng(7))
    cameras = {**measurements.cameras, "K2": MeasuredCamera((1280, 960), 0.0)}
    with pytest.raises(BadInputError, match=r"camera K2: measured in images of 1280 x 960 px.*give the calibration"):
        solved(replace(measurements, cameras=cameras))
