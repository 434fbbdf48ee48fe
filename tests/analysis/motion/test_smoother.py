"""The bundle over time: errors within their sigmas, gaps predicted, gross errors left out, late cameras named."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.measurements.model import ImageMeasurements, JumpMeasurements, PointMeasurement
from analysis.motion.smoother import Motion, smooth
from analysis.result.model import QUANTITIES, Phase, SmoothedState, Status
from rig.arrays import Floats
from tests.analysis.simulated import TrueJump, drawn, simulated_measurements, true_cameras, true_jump
from tests.support.repeats import repeats

SEED = 11
LARGEST = 4.5  # sigmas, of some thousand correlated errors of one jump; 6e-6 of single ones are larger


def _motion(seed: int, late_s: dict[str, float] | None = None) -> tuple[TrueJump, JumpMeasurements, Motion]:
    rng, truth = np.random.default_rng(seed), true_jump(seed)
    measured = simulated_measurements(truth, true_cameras(), rng, late_s=late_s)
    return truth, measured.jumps[0], smooth(measured.jumps[0], measured, drawn(true_cameras(), rng))


@pytest.fixture(scope="module")
def clean() -> tuple[TrueJump, JumpMeasurements, Motion]:
    return _motion(SEED)


def _states(motion: Motion) -> list[tuple[int, SmoothedState]]:
    return [(k, state) for k, state in enumerate(motion.states) if state is not None]


def _distance(offset: Floats, covariance: Floats) -> float:
    """Mahalanobis."""
    return float(np.sqrt(offset @ np.linalg.solve(covariance, offset)))


def test_points_and_velocity_err_as_their_covariance_says(clean: tuple[TrueJump, JumpMeasurements, Motion]) -> None:
    truth, jump, motion = clean
    for k, state in _states(motion):
        pulse = jump.pulses[k].pulse
        for i, point in enumerate(state.points.values()):
            assert point is not None
            assert _distance(point.xyz - truth.pose(pulse).markers[i], point.covariance) < LARGEST
        assert _distance(state.velocity.value - truth.velocity(pulse), state.velocity.covariance) < LARGEST
        assert state.height is not None
        assert abs(state.height.value - truth.pose(pulse).origin[2]) < LARGEST * state.height.sigma


def test_residuals_are_as_large_as_their_sigmas(clean: tuple[TrueJump, JumpMeasurements, Motion]) -> None:
    for phase, fit in clean[2].fit.items():
        scatter = np.sqrt(2 / fit.redundancy)
        assert abs(fit.chi_square / fit.redundancy - 1) < LARGEST * scatter, phase
    assert set(clean[2].fit) == set(Phase)


def test_takeoff_is_found(clean: tuple[TrueJump, JumpMeasurements, Motion]) -> None:
    truth, jump, motion = clean
    assert motion.takeoff is not None
    assert abs(motion.takeoff.pulse - truth.takeoff_pulse) < LARGEST * motion.takeoff.sigma_pulses
    assert motion.takeoff.sigma_pulses < 0.5
    since = (motion.takeoff.time - jump.pulses[0].time) * 1e-9 * truth.rate_hz
    assert since == pytest.approx(motion.takeoff.pulse - jump.pulses[0].pulse, abs=1e-6)


def test_table_is_that_of_the_hill(clean: tuple[TrueJump, JumpMeasurements, Motion]) -> None:
    truth, _, motion = clean
    assert motion.table is not None
    along = truth.jump.table_velocity / np.linalg.norm(truth.jump.table_velocity)
    slope = np.degrees(np.arcsin(along[2]))
    assert abs(motion.table.slope.value - slope) < LARGEST * motion.table.slope.sigma
    normal = np.array((-along[2], 0.0, along[0]))
    places = [truth.pose(truth.takeoff_pulse + after * truth.rate_hz).origin for after in (0.05, 0.15)]
    later = (places[1] - places[0]) @ normal / 0.1 + 9.81 * 0.1 * along[0]
    assert abs(motion.table.perpendicular.value - later) < LARGEST * motion.table.perpendicular.sigma


def test_derivatives_by_the_calibration_are_those_of_another_calibration() -> None:
    truth, system = true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, np.random.default_rng(SEED))
    step = np.zeros(len(system.covariance))
    step[[2, 4, 13]] = 0.1 * np.sqrt(np.diagonal(system.covariance))[[2, 4, 13]]
    one, other = (smooth(measured.jumps[0], measured, cameras) for cameras in (system, system.moved(step)))
    for (_, a), (_, b) in list(zip(_states(one), _states(other), strict=True))[8::6]:
        predicted = a.by_calibration @ step
        for row, name in enumerate(QUANTITIES[:8]):
            before, after = (_quantity(state, name) for state in (a, b))
            # The take-off and the densities of the motion move a little with the calibration.
            assert after[0] - before[0] == pytest.approx(predicted[row], abs=0.02 * before[1])


def _quantity(state: SmoothedState, name: str) -> tuple[float, float]:
    found = state.angles[name] if name in state.angles else getattr(state, name)
    assert found is not None
    return found.value, found.sigma


def test_points_that_were_not_measured_are_predicted_with_growing_sigma() -> None:
    truth, system = true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, np.random.default_rng(SEED))
    jump = measured.jumps[0]
    gap = range(16, 21)
    pulses = list(jump.pulses)
    for k in gap:
        images = {c: image if c == "K3" else ImageMeasurements({}, {}) for c, image in pulses[k].images.items()}
        pulses[k] = replace(pulses[k], images=images)
    whole = smooth(jump, measured, system)
    motion = smooth(replace(jump, pulses=tuple(pulses)), measured, system)
    growth = []
    for k in range(gap.start - 1, gap.stop + 1):
        state, complete = motion.states[k], whole.states[k]
        assert state is not None
        assert complete is not None
        point, measured_point = state.points["P2"], complete.points["P2"]
        assert point is not None
        assert measured_point is not None
        assert point.status is (Status.PREDICTED if k in gap else Status.CONTROLLED)
        assert _distance(point.xyz - truth.pose(jump.pulses[k].pulse).markers[1], point.covariance) < LARGEST
        growth.append(np.trace(point.covariance) / np.trace(measured_point.covariance))
    # Most of the sigma is that of the survey, which changes along the path: it grows beside what it was without a gap.
    assert np.argmax(growth) in (2, 3, 4)
    assert min(growth[1:-1]) > max(growth[0], growth[-1]) > 1.0


def test_a_wrong_identification_is_left_out() -> None:
    truth, system = true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, np.random.default_rng(SEED))
    jump = measured.jumps[0]
    image = jump.pulses[20].images["K2"]
    swapped = {**image.points, "P1": image.points["P2"], "P2": image.points["P1"]}
    off = PointMeasurement(image.points["P3"].xy + 3.0, image.points["P3"].covariance)
    pulses = list(jump.pulses)
    for k, points in ((20, swapped), (23, {**jump.pulses[23].images["K2"].points, "P3": off})):
        changed = replace(pulses[k].images["K2"], points=points)
        pulses[k] = replace(pulses[k], images={**pulses[k].images, "K2": changed})
    motion = smooth(replace(jump, pulses=tuple(pulses)), measured, system)
    number = jump.pulses[0].pulse
    assert {(t.pulse - number, t.camera, t.what) for t in motion.removed} == {
        (20, "K2", "P1"),
        (20, "K2", "P2"),
        (23, "K2", "P3"),
    }
    state = motion.states[20]
    assert state is not None
    point = state.points["P1"]
    assert point is not None
    assert point.cameras == ("K1", "K3")
    assert point.status is Status.TWO_RAYS
    assert _distance(point.xyz - truth.pose(jump.pulses[20].pulse).markers[0], point.covariance) < LARGEST


@pytest.mark.parametrize(("camera", "seconds"), repeats([("K2", 1 / 30), ("K1", 0.008), ("K3", -0.008)]))
def test_a_camera_that_is_late_is_named(camera: str, seconds: float) -> None:
    truth, jump, motion = _motion(SEED + 1, {camera: seconds})
    named = {name: offset for name, offset in motion.offsets.items() if offset.message}
    assert set(named) == {camera}
    offset = named[camera]
    assert abs(offset.offset_ms - seconds * 1e3) < LARGEST * offset.sigma_ms
    assert offset.message is not None
    assert camera in offset.message
    assert "later" in offset.message if seconds > 0 else "earlier" in offset.message
    for k, state in _states(motion)[5:]:
        expected = truth.pose(jump.pulses[k].pulse).origin
        assert _distance(state.origin.value - expected, state.origin.covariance) < LARGEST


def test_synchronous_cameras_raise_no_alarm(clean: tuple[TrueJump, JumpMeasurements, Motion]) -> None:
    assert all(offset.message is None for offset in clean[2].offsets.values())
    assert all(offset.sigma_ms < 1.0 for offset in clean[2].offsets.values())


@pytest.mark.parametrize("measured_pulses", [0, 1, 3])
def test_a_jump_with_few_measurements_has_no_states(measured_pulses: int) -> None:
    measured = simulated_measurements(true_jump(SEED), true_cameras(), np.random.default_rng(SEED))
    jump = measured.jumps[0]
    some = range(15, 15 + measured_pulses)
    pulses = tuple(pulse if k in some else replace(pulse, images={}) for k, pulse in enumerate(jump.pulses))
    motion = smooth(replace(jump, pulses=pulses), measured, true_cameras())
    assert motion.takeoff is None
    assert set(motion.states) == {None}
    assert motion.message is not None


def test_a_fall_that_bends_is_no_takeoff() -> None:
    """In flight from the first pulse on; in the last ones all seems to rise, as where names are wrong."""
    truth, system = true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, np.random.default_rng(SEED))
    flight = [pulse for pulse in measured.jumps[0].pulses if truth.since_takeoff(pulse.pulse) > 0.1]

    def risen(image: ImageMeasurements, by_px: float) -> ImageMeasurements:
        up = np.array((0.0, -by_px))
        points = {name: replace(point, xy=point.xy + up) for name, point in image.points.items()}
        return ImageMeasurements(points, {side: replace(ski, xy=ski.xy + up) for side, ski in image.skis.items()})

    for k in range(1, 6):
        pulse = flight[k - 6]
        images = {name: risen(image, 1.5 * k**2) for name, image in pulse.images.items()}
        flight[k - 6] = replace(pulse, images=images)
    assert smooth(JumpMeasurements(1, tuple(flight)), measured, system).takeoff is None


def test_a_known_edge_gives_the_takeoff() -> None:
    truth, system = true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, np.random.default_rng(SEED))
    found = smooth(measured.jumps[0], measured, system, edge=truth.jump.start).takeoff
    assert found is not None
    assert found.sigma_pulses < 0.01  # 6 mm at 25 m/s
    assert abs(found.pulse - truth.takeoff_pulse) < LARGEST * found.sigma_pulses


def test_exposures_of_different_length_are_not_lateness() -> None:
    truth, system = true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, np.random.default_rng(SEED), late_s={"K1": 0.004})
    cameras = {name: replace(camera, exposure_s=0.008 * (name == "K1")) for name, camera in measured.cameras.items()}
    motion = smooth(measured.jumps[0], replace(measured, cameras=cameras), system)
    assert all(offset.message is None for offset in motion.offsets.values())
    middle = 0.004 / 3 * truth.rate_hz  # of the cameras' mean exposure, in pulses
    for k, state in _states(motion)[5:]:
        expected = truth.pose(measured.jumps[0].pulses[k].pulse + middle).origin
        assert _distance(state.origin.value - expected, state.origin.covariance) < LARGEST


def test_many_gross_errors_do_not_bend_the_path() -> None:
    rng, truth, system = np.random.default_rng(SEED), true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, rng)
    pulses, wrong = [], 0
    for pulse in measured.jumps[0].pulses:
        images = {}
        for camera, image in pulse.images.items():
            off = {label: 15 * rng.standard_normal(2) * (rng.random() < 0.08) for label in image.points}
            points = {label: replace(point, xy=point.xy + off[label]) for label, point in image.points.items()}
            swap = rng.random() < 0.1 and len(image.skis) == 2
            skis = {"right": image.skis["left"], "left": image.skis["right"]} if swap else image.skis
            images[camera] = ImageMeasurements(points, skis)
            wrong += sum(bool(step.any()) for step in off.values())
        pulses.append(replace(pulse, images=images))
    jump = replace(measured.jumps[0], pulses=tuple(pulses))
    motion = smooth(jump, measured, drawn(system, rng))
    assert len(motion.removed) > 0.8 * wrong
    for k, state in _states(motion):
        for i, point in enumerate(state.points.values()):
            assert point is not None
            markers = truth.pose(jump.pulses[k].pulse).markers
            assert _distance(point.xyz - markers[i], point.covariance) < LARGEST


def test_sigmas_that_are_too_small_are_found_and_enlarged() -> None:
    rng, truth, system = np.random.default_rng(SEED), true_jump(SEED), true_cameras()
    measured = simulated_measurements(truth, system, rng)
    pulses = [
        replace(pulse, images={name: _surer(image, 2.0) for name, image in pulse.images.items()})
        for pulse in measured.jumps[0].pulses
    ]
    jump = replace(measured.jumps[0], pulses=tuple(pulses))
    motion = smooth(jump, measured, drawn(system, rng))
    assert motion.scale["points"] == pytest.approx(2.0, rel=0.2)  # medians of 350 tests scatter by 4 %
    assert motion.scale["skis"] == 1.0
    assert len(motion.removed) <= 2
    for k, state in _states(motion):
        expected = truth.pose(jump.pulses[k].pulse).origin
        assert _distance(state.origin.value - expected, state.origin.covariance) < LARGEST


def test_sigmas_that_are_too_large_make_no_vague_result(clean: tuple[TrueJump, JumpMeasurements, Motion]) -> None:
    """What images tell of their own sigmas counts in proportion; how large they are, the residuals tell."""
    truth, jump, sharp = clean
    rng = np.random.default_rng(SEED)
    measured = simulated_measurements(truth, true_cameras(), rng)
    pulses = [
        replace(pulse, images={name: _surer(image, 0.5, skis=0.4) for name, image in pulse.images.items()})
        for pulse in jump.pulses
    ]
    motion = smooth(replace(jump, pulses=tuple(pulses)), measured, drawn(true_cameras(), rng))
    assert motion.scale == {"points": 1.0, "skis": 1.0}
    for name in ("beta", "gamma", "dphi"):
        wide, narrow = (np.mean([_quantity(state, name)[1] for _, state in _states(m)]) for m in (motion, sharp))
        assert wide == pytest.approx(narrow, rel=0.15)  # 500 degrees of freedom of points, 200 of skis: 3 and 5 %


def _surer(image: ImageMeasurements, factor: float, skis: float = 1.0) -> ImageMeasurements:
    points = {name: replace(point, covariance=point.covariance / factor**2) for name, point in image.points.items()}
    return replace(image, points=points, skis={s: replace(k, sigma=k.sigma / skis) for s, k in image.skis.items()})
