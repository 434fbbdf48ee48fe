"""Smooths a jump: the whole procedure from its measurements to the motion with everything that is known about it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy.special import chdtrc, ndtri

from analysis.measurements.model import JumpMeasurements, Measurements
from analysis.motion.adjustment.bundle import (
    Adjusted,
    Model,
    begun,
    near,
    root_of,
    settled,
    with_prior,
)
from analysis.motion.adjustment.gross_errors import fitting_sigmas, statistics, with_factors, without_gross_errors
from analysis.motion.adjustment.lasting import lasting_covariance
from analysis.motion.model.observations import GROUPS, Observations, by_hand, observations, used_cameras
from analysis.motion.model.prior import Prior, prior, re_estimated, start_densities
from analysis.motion.quantities import known_groups, smoothed_states
from analysis.motion.start_values import FEWEST, Start, start_values
from analysis.motion.synchrony import Synchrony, judged
from analysis.motion.table import TableMotion, table_motion
from analysis.motion.takeoff import Break, airborne, find_break, passing
from analysis.result.model import CameraOffset, Phase, Quantity, RayTest, SmoothedState, TakeOff, phase_at
from analysis.scene.camera_arrays import CameraArrays, own_root
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats
from rig.clocks import NS_PER_S, UtcNs
from rig.phrase import Phrase, phrase

_FREE_FRAMES: Final = 2.0  #: standard deviation of a camera's lateness before it is known, pulse intervals
_TRIGGER_S: Final = 20e-6  #: of cameras that obey one trigger
_STEPS_MOST, _TAKEOFF_ROUNDS, _COMPONENT_STEPS, _REMOVALS, _SCALINGS = 12, 2, 3, 12, 4


@dataclass(frozen=True, slots=True)
class Fit:
    """How well the measurements of a phase fit the motion.

    Attributes:
        observations: number of image coordinates that were used.
        redundancy: their degrees of freedom.
        chi_square: weighted square sum of their residuals; about the redundancy where all sigmas hold.
    """

    observations: int
    redundancy: float
    chi_square: float


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """A jump as one motion.

    Attributes:
        states: one per pulse of the jump; None before the first and after the last measured pulse.
        takeoff: None where it was not in sight.
        offsets: of the cameras that measured.
        fit: by phase, of phases with measurements.
        removed: measurements that contradict all others and were left out, the worst first.
        table: direction of the table and the velocity across it; None without take-off, or where the table was hardly
            in sight.
        scale: factors by which the sigmas of "points" and "skis" in the images were too small: if not 1, most of them
            agree worse than their sigmas said, and all results are computed with these sigmas times the factor.
        message: why there are no states; None where there are.
        late: of cameras that are not synchronous how late they are, s.
    """

    states: Sequence[SmoothedState | None]
    takeoff: TakeOff | None
    offsets: Mapping[str, CameraOffset]
    fit: Mapping[Phase, Fit]
    removed: Sequence[RayTest]
    table: TableMotion | None
    scale: Mapping[str, float] = field(default_factory=dict)
    message: Phrase | None = None
    late: Mapping[str, Quantity] = field(default_factory=dict)


def smooth(
    jump: JumpMeasurements, measurements: Measurements, system: CameraSystem, edge: Floats | None = None
) -> Motion:
    """The bundle over time of one jump.

    Args:
        jump: one of `measurements.jumps`.
        measurements: of the recording.
        system: the oriented cameras.
        edge: (3,) a point of the edge, where the survey knows it; then the path itself tells when O passes it.
            Otherwise the take-off is when the motion of O and skis stops to be that of the table.

    Returns:
        The motion; without states, and with the reason, where nothing can be computed.
    """
    everything = observations(jump, measurements, CameraArrays.of(system, tuple(measurements.cameras)))
    measured = np.flatnonzero(everything.seen.any(axis=(1, 2)))
    sight = slice(int(measured[0]), int(measured[-1]) + 1) if len(measured) else slice(0, 0)
    start = start_values(everything.part(sight), system) if len(measured) >= FEWEST else None
    if start is None:
        text = "fewer than {least} pulses have a point in two cameras: nothing to smooth"
        return _nothing(jump, phrase("jump_too_short", text, least=FEWEST))
    try:
        return _motion(jump, everything, sight, measurements.rate_hz, system, start, edge)
    except np.linalg.LinAlgError:
        text = "the measurements contradict each other: check the calibration and the names of the cameras"
        return _nothing(jump, phrase("jump_contradictory", text))


def _nothing(jump: JumpMeasurements, message: Phrase) -> Motion:
    return Motion([None] * len(jump.pulses), None, {}, {}, [], None, message=message)


def _motion(
    jump: JumpMeasurements,
    everything: Observations,
    sight: slice,
    rate_hz: float,
    system: CameraSystem,
    start: Start,
    edge: Floats | None,
) -> Motion:
    observed, unit = everything.part(sight), 1.0 / rate_hz
    free, factors = _with_free_cameras(observed, system, start, unit)
    rank = free.model.root.shape[1]
    took_part = np.asarray(free.used.any(axis=(0, 2)))
    fit = statistics(free)
    covariance = free.solution.shared_covariance + lasting_covariance(free, fit.square, fit.redundancy).shared
    synchrony = judged(observed.names, took_part, free.late * unit, covariance[rank:, rank:] * unit**2, unit)
    adjusted, takeoff = _with_takeoff(_synchronised(free, synchrony), edge)
    states: list[SmoothedState | None] = [None] * len(jump.pulses)
    states[sight] = _smoothed(adjusted, takeoff)
    return Motion(
        states,
        _takeoff(jump, rate_hz, everything.times, takeoff),
        synchrony.offsets,
        _fit(adjusted, takeoff),
        _removed(adjusted, [int(pulse.pulse) for pulse in jump.pulses[sight]]),
        None if takeoff is None else table_motion(adjusted, takeoff),
        {"points": float(factors[0]), "skis": float(factors[-1])},
        late={
            observed.names[i]: Quantity(float(synchrony.lateness[i]), float(synchrony.sigma[i]))
            for i in np.flatnonzero(synchrony.late)
        },
    )


def _with_free_cameras(
    observed: Observations, system: CameraSystem, start: Start, unit: float
) -> tuple[Adjusted, Floats]:
    """The bundle in which each camera may be late; nothing is known yet of take-off and densities.

    Returns the factors (6,), too, by which the sigmas of the measurements were too small.
    """
    m, late = len(observed.names), start.late / unit
    loose = np.repeat(start_densities()[1:2], 3, axis=0)
    root = root_of(system.covariance)
    model = Model(
        observed,
        CameraArrays.of(system, observed.names),
        root,
        own_root(system, observed.names, root),
        start.frame,
        prior(observed.times, unit, None, loose),
        np.full(m, late.mean()),
        np.full(m, _FREE_FRAMES),
        clock_is_mean=True,
    )
    shared = np.concatenate((np.zeros(model.root.shape[1]), late))
    channels = start.channels
    speed = np.gradient(channels, observed.times, axis=0) * unit
    states = np.concatenate((channels, speed, np.zeros_like(channels)), axis=1)
    free = settled(begun(model, states, near(model, states, shared), shared), _STEPS_MOST)
    free, factors = fitting_sigmas(free, _SCALINGS)
    return without_gross_errors(free, _REMOVALS), factors


def _synchronised(free: Adjusted, synchrony: Synchrony) -> Adjusted:
    """The bundle with cameras that obey the trigger; a camera that is late keeps its own lateness as an unknown."""
    unit = free.model.prior.unit
    unknown = _FREE_FRAMES if synchrony.told else synchrony.sigma / unit
    sigma = np.where(synchrony.late, unknown, _TRIGGER_S / unit)
    expected = np.where(synchrony.late, synchrony.lateness / unit, 0.0)
    model = replace(free.model, late=expected, late_sigma=sigma, clock_is_mean=False)
    shared = free.shared.copy()
    shared[model.root.shape[1] :] = expected
    return settled(begun(model, free.states, free.used, shared), _STEPS_MOST)


def _with_takeoff(adjusted: Adjusted, known: Floats | None) -> tuple[Adjusted, Break | None]:
    """Take-off and densities of the motion, in turn; then gross errors once more."""
    densities = start_densities()
    edge = None
    for _ in range(_TAKEOFF_ROUNDS):
        edge = find_break(adjusted, densities) if known is None else passing(adjusted, known)
        for _ in range(_COMPONENT_STEPS):
            adjusted = with_prior(adjusted, _prior(adjusted, edge, densities))
            densities = _components(adjusted)
        adjusted = with_factors(adjusted)
    adjusted = with_prior(adjusted, _prior(adjusted, edge, densities))
    return without_gross_errors(settled(adjusted, 2), _REMOVALS), edge


def _prior(adjusted: Adjusted, edge: Break | None, densities: Floats) -> Prior:
    times, unit = adjusted.model.observed.times, adjusted.model.prior.unit
    if edge is None:
        return prior(times, unit, None, densities, airborne(adjusted))
    return prior(times, unit, edge.seconds, densities)


def _components(adjusted: Adjusted) -> Floats:
    solution = adjusted.solution
    return re_estimated(adjusted.model.prior, adjusted.states, solution.covariance, solution.next_covariance)


def _over_takeoff(adjusted: Adjusted, edge: Break | None) -> tuple[Floats, Floats, Floats]:
    """States, their covariance, and that with the shared unknowns, over all possible times of the take-off.

    The bundle holds for one time of the take-off. Its solutions for several times, weighted, are the marginals.
    """
    solution = adjusted.solution
    if edge is None:
        return adjusted.states, solution.covariance, solution.cross
    model = adjusted.model
    before, after = (
        with_prior(adjusted, prior(model.observed.times, model.prior.unit, node, model.prior.density))
        for node in (edge.nodes[0], edge.nodes[2])
    )
    weighted = list(zip(edge.weights, (before, adjusted, after), strict=True))
    states = sum(w * a.states for w, a in weighted)
    shared = sum(w * a.shared for w, a in weighted)
    covariance, cross = np.zeros_like(solution.covariance), np.zeros_like(solution.cross)
    for w, a in weighted:
        off, off_shared = a.states - states, a.shared - shared
        covariance += w * (a.solution.covariance + off[:, :, None] * off[:, None, :])
        cross += w * (a.solution.cross + off[:, :, None] * off_shared)
    return np.asarray(states), covariance, cross


def _smoothed(adjusted: Adjusted, edge: Break | None) -> list[SmoothedState]:
    model, used = adjusted.model, adjusted.used
    rank = model.root.shape[1]
    states, covariance, cross = _over_takeoff(adjusted, edge)
    fit = statistics(adjusted)
    covariance = covariance + lasting_covariance(adjusted, fit.square, fit.redundancy).states
    return smoothed_states(
        model.frame,
        model.prior.unit,
        states,
        covariance,
        cross[:, :, :rank] @ np.linalg.pinv(model.root),
        used_cameras(model.observed, used),
        by_hand(model.observed, used),
        known_groups(used),
    )


def _takeoff(jump: JumpMeasurements, rate_hz: float, times: Floats, edge: Break | None) -> TakeOff | None:
    if edge is None:
        return None
    numbers = np.array([pulse.pulse for pulse in jump.pulses], float)
    return TakeOff(
        float(np.interp(edge.seconds, times, numbers)),
        edge.sigma * rate_hz,
        UtcNs(jump.pulses[0].time + round(edge.seconds * NS_PER_S)),
    )


def _fit(adjusted: Adjusted, edge: Break | None) -> dict[Phase, Fit]:
    """By phase; without a take-off all is flight."""
    judged_groups = statistics(adjusted)
    times = adjusted.model.observed.times
    phases = [phase_at(t - edge.seconds) if edge else Phase.FLIGHT for t in times]
    out = {}
    for phase in Phase:
        use = adjusted.used & np.array([p is phase for p in phases])[:, None, None]
        if use.any():
            square, redundancy = judged_groups.square[use].sum(), judged_groups.redundancy[use].sum()
            out[phase] = Fit(2 * int(use.sum()), float(redundancy), float(square))
    return out


def _removed(adjusted: Adjusted, pulses: list[int]) -> list[RayTest]:
    model = adjusted.model
    tests = statistics(adjusted).test
    gone = np.argwhere(model.observed.seen & ~adjusted.used)
    out = []
    for k, i, group in gone:
        residual = np.linalg.solve(model.observed.whitener[k, i, group], adjusted.equations.v[k, i, group])
        w = -float(ndtri(max(chdtrc(2, tests[k, i, group]), 1e-300) / 2))
        out.append(
            RayTest(pulses[k], model.observed.names[i], GROUPS[group], float(np.linalg.norm(residual)), w, removed=True)
        )
    return sorted(out, key=lambda test: -test.w)
