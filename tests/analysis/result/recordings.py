"""Plausible measured recordings without images and without the analysis, for tests of what reads them.

A jump of the simulated hill, seen by its cameras. Errors are drawn from the covariances that the recording states:
of the calibration (the same in all pulses), of every raw point (independent), and of the smoothed values (a linear
smoother with a white-noise-on-jerk prior applied to the raw errors). There are gaps, two rays and predicted values.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from scipy.interpolate import CubicSpline

from analysis.measurements.model import POINTS, SIDES
from analysis.result.fates import Fate, ImageFate, PartFate
from analysis.result.model import (
    BallResult,
    CameraOffset,
    Jump,
    JumperState,
    MeasuredRecording,
    OrientationResult,
    OrientedImage,
    Phase,
    PointState,
    PulseState,
    Quantity,
    RayTest,
    SkiState,
    SmoothedState,
    Status,
    TakeOff,
    Vector,
    Verdict,
    phase_at,
)
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.jumper.stick_model import ANGLES, body_angles, slope, slope_and_heading
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from tests.analysis.simulated import RATE_HZ, SIZE, START_NS, TrueJump, training, true_cameras, true_jump

#: Tail and tip of both skis follow the four points: eight places, 24 coordinates.
PLACES = (*POINTS, "right tail", "right tip", "left tail", "left tip")
SIGMA_PX = 0.25
HELMET_GAP = (14, 19)  #: pulses, counted from the first, in which nobody sees P1
LEFT_SKI_GAP = (24, 26)  #: likewise the left ski
TWO_RAYS = (8, 12)  #: in which K1 does not see P4
#: Of the prior's weight to that of the measurements; smoothed sigmas become about half the raw ones.
STIFFNESS = 6.0
TAKEOFF_SIGMA_PULSES = 0.03


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """What all recordings of one jump share.

    Attributes:
        truth: the jump.
        pulses: (n,) in sight.
        places: (n, 8, 3) true ones, m.
        covariance: (8, 3, 3) of raw places, by measurement alone.
        by_calibration: (n, 24, p) of the places.
        smoother: (8, n, n) smoothed = smoother times raw.
        posterior: (8, n, n) covariance over time of smoothed places / that of raw ones.
        gradient: (n, n) velocity = gradient times positions.
        calibration: (p, p) covariance of the cameras' parameters.
    """

    truth: TrueJump
    pulses: list[int]
    places: Floats
    covariance: Floats
    by_calibration: Floats
    smoother: Floats
    posterior: Floats
    gradient: Floats
    calibration: Floats


@cache
def model(jump_seed: int = 1, leg_deg: float = 0.0) -> Model:
    """The model of a jump; `leg_deg`: by how much helmet and hip are turned backwards in flight."""
    truth, system = true_jump(jump_seed), true_cameras()
    pulses = [p for p in range(1, 200) if -6 <= truth.pose(p).origin[0] <= 24]
    places = np.stack([_places(truth, pulse, leg_deg) for pulse in pulses])
    n, p = len(pulses), len(system.covariance)
    by_calibration, normal = np.zeros((n, 8, 3, p)), np.zeros((n, 8, 3, 3))
    for name in system.names:
        placed = system[name]
        _, by_point, by_parameters = placed.linearised(places.reshape(-1, 3), placed.project(places.reshape(-1, 3)))
        a, b = by_point.reshape(n, 8, 2, 3), by_parameters.reshape(n, 8, 2, -1)
        normal += np.swapaxes(a, -1, -2) @ a
        by_calibration[..., placed.columns] -= np.swapaxes(a, -1, -2) @ b
    cofactor = np.linalg.inv(normal)
    by_coordinates = (cofactor @ by_calibration).reshape(n, 24, p)
    third = np.diff(np.eye(n), 3, axis=0)
    prior = STIFFNESS * third.T @ third
    weights = np.array([[float(_seen(place, i)) for i in range(n)] for place in range(8)])
    posterior = np.linalg.inv(prior + np.eye(n) * weights[:, None, :])
    return Model(
        truth,
        pulses,
        places,
        SIGMA_PX**2 * cofactor.mean(axis=0),
        by_coordinates,
        posterior * weights[:, None, :],
        posterior,
        CubicSpline(np.arange(n) / RATE_HZ, np.eye(n))(np.arange(n) / RATE_HZ, 1),
        system.covariance,
    )


def recording(
    jump_seed: int = 1,
    *,
    seed: int = 0,
    calibration_error: Floats | None = None,
    source: str = "calibration 1",
    leg_deg: float = 0.0,
    jumps: int = 1,
) -> MeasuredRecording:
    """A measured recording.

    Args:
        jump_seed: draws the jump; with the same one only the errors differ.
        seed: draws the errors of measurement.
        calibration_error: (p,) of the cameras' parameters; see `calibration_error`. None: there is none.
        source: identifies the calibration.
        leg_deg: by how much this jumper's legs and body are turned backwards about the bindings in flight.
        jumps: how many; the second is another jump of the same jumper.
    """
    found = [
        _jump(jump_seed + k, leg_deg, np.random.default_rng((seed, k)), calibration_error, k + 1) for k in range(jumps)
    ]
    session = {"athlete": "A. Jumper", "bib": "7"}
    synchrony = {name: CameraOffset(0.1 * i, 0.2, None) for i, name in enumerate(true_cameras().names)}
    return MeasuredRecording("simulated", session, RATE_HZ, _orientation(source), synchrony, tuple(found))


def calibration_error(seed: int) -> Floats:
    """An error (p,) of the cameras' parameters, drawn from their covariance."""
    covariance = true_cameras().covariance
    return np.random.default_rng(seed).multivariate_normal(np.zeros(len(covariance)), covariance, method="eigh")


def true_quantities(jump_seed: int = 1, leg_deg: float = 0.0) -> Floats:
    """(n, 11) `QUANTITIES` without any error, one row a pulse, degrees, m, m/s."""
    m = model(jump_seed, leg_deg)
    velocity = m.gradient @ m.places[:, 2:4].mean(axis=1)
    return quantities(np.concatenate((m.places.reshape(len(velocity), -1), velocity), axis=-1))


def quantities(states: Floats) -> Floats:
    """`QUANTITIES` (..., 11) of 24 coordinates of the places and the velocity of O (..., 27)."""
    places, velocity = states[..., :24].reshape(*states.shape[:-1], 8, 3), states[..., 24:]
    helmet, hip, *bindings = (places[..., k, :] for k in range(4))
    origin = (bindings[0] + bindings[1]) / 2
    right, left = (places[..., tail + 1, :] - places[..., tail, :] for tail in (4, 6))
    angles = np.degrees(body_angles(helmet, hip, origin, right, left))
    attack = angles[..., 4] - np.degrees(slope(velocity))
    single = np.stack((attack, origin[..., 2], np.linalg.norm(velocity, axis=-1)), axis=-1)
    return np.concatenate((angles, single, velocity), axis=-1)


def _places(truth: TrueJump, pulse: int, leg_deg: float) -> Floats:
    pose = truth.pose(pulse)
    turned = leg_deg if phase_at(truth.since_takeoff(pulse)) is Phase.FLIGHT else 0.0
    turn = rotation_from_vector(-np.radians(turned) * pose.axes[1])
    body = pose.origin + (pose.markers[:2] - pose.origin) @ turn.T
    half = truth.ski_length / 2
    ends = [pose.markers[2 + s] + sign * half * pose.skis[s] for s in (0, 1) for sign in (-1, 1)]
    return np.stack([*body, *pose.markers[2:], *ends])


def _seen(place: int, i: int) -> bool:
    if place == 0:
        return not HELMET_GAP[0] <= i < HELMET_GAP[1]
    return not (place >= 6 and LEFT_SKI_GAP[0] <= i < LEFT_SKI_GAP[1])


def _fates(raw: JumperState) -> dict[str, PartFate]:
    """Used, or refused; every camera measured."""
    parts: dict[str, PointState | SkiState | None] = {**raw.points, **raw.skis}
    return {
        what: PartFate(Fate.DISAGREE, dict.fromkeys(true_cameras().names, ImageFate.NOT_USED))
        if part is None
        else PartFate(
            Fate.USED, {n: ImageFate.USED if n in part.cameras else ImageFate.NOT_FOUND for n in true_cameras().names}
        )
        for what, part in parts.items()
    }


def _jump(jump_seed: int, leg_deg: float, rng: np.random.Generator, error: Floats | None, number: int) -> Jump:
    m, (raw_spreads, smoothed_spreads) = model(jump_seed, leg_deg), _spreads(jump_seed, leg_deg)
    n = len(m.pulses)
    noise = np.einsum("pij,npj->npi", np.linalg.cholesky(m.covariance), rng.standard_normal((n, 8, 3)))
    shift = np.zeros((n, 24)) if error is None else m.by_calibration @ error
    raw = m.places + noise + shift.reshape(n, 8, 3)
    smoothed = m.places + np.einsum("pij,jpk->ipk", m.smoother, noise) + shift.reshape(n, 8, 3)
    velocity = m.gradient @ smoothed[:, 2:4].mean(axis=1)
    takeoff = m.truth.takeoff_pulse + TAKEOFF_SIGMA_PULSES * rng.standard_normal()
    states = []
    for i, pulse in enumerate(m.pulses):
        since = (pulse - takeoff) / RATE_HZ
        states.append(
            PulseState(
                PulseNumber(pulse),
                UtcNs(START_NS + round(pulse * 1e9 / RATE_HZ)),
                since,
                phase_at(since),
                alone := _raw(i, raw, raw_spreads[i]),
                _state(i, smoothed[i], velocity[i], smoothed_spreads[i]),
                _fates(alone),
            )
        )
    time = UtcNs(START_NS + round(takeoff * 1e9 / RATE_HZ))
    phases = {phase: {"pulses": sum(s.phase is phase for s in states), "chi2_by_dof": 1.02} for phase in Phase}
    tests = tuple(
        RayTest(PulseNumber(m.pulses[i]), "K2", "P2", 0.4 - 0.1 * k, 2.9 - 0.5 * k, False)
        for k, i in enumerate((5, 20, 9))
    )
    message = "measured in all phases; P1 is hidden in five pulses"
    return Jump(
        number,
        TakeOff(takeoff, TAKEOFF_SIGMA_PULSES, time),
        Verdict(True, message, phases),
        tuple(states),
        (*tests, RayTest(PulseNumber(m.pulses[9]), "K3", "P4", 0.1, np.nan, False)),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """What the errors of a state do, near the true state: gamma has no derivative where the skis are parallel.

    Attributes:
        whole: (27, 27) covariance of 24 coordinates and the velocity.
        sigmas: (11,) of `QUANTITIES`.
        by_calibration: (11, p) of `QUANTITIES`.
        skis: (2, 2, 2) covariance of slope and heading, degrees^2, right and left.
    """

    whole: Floats
    sigmas: Floats
    by_calibration: Floats
    skis: Floats


@cache
def _spreads(jump_seed: int, leg_deg: float) -> tuple[list[Spread], list[Spread]]:
    """Of raw and of smoothed states, pulse by pulse."""
    m = model(jump_seed, leg_deg)
    n = len(m.pulses)
    velocity = m.gradient @ m.places[:, 2:4].mean(axis=1)
    raw, smoothed = [], []
    origin_change = m.by_calibration.reshape(n, 8, 3, -1)[:, 2:4].mean(axis=1)
    factors = np.linalg.cholesky(m.covariance)
    for i in range(n):
        near = m.places[i] + np.einsum("pij,pj->pi", factors, np.random.default_rng(i).standard_normal((8, 3)))
        state = np.concatenate((near.ravel(), velocity[i]))
        change = np.einsum("n,njp->jp", m.gradient[i], origin_change)
        noise = m.covariance[2:4].sum(axis=0) / 4 * RATE_HZ**2 / 2
        raw.append(_spread(m, i, state, m.covariance, noise, change))
        rates = (m.gradient[i] @ m.posterior[2:4] @ m.gradient[i])[:, None, None]
        noise = (m.covariance[2:4] * rates).sum(axis=0) / 4
        smoothed.append(_spread(m, i, state, m.covariance * m.posterior[:, i, i, None, None], noise, change))
    return raw, smoothed


def _spread(m: Model, i: int, state: Floats, places: Floats, velocity: Floats, change: Floats) -> Spread:
    by_calibration = np.concatenate((m.by_calibration[i], change))
    whole = by_calibration @ m.calibration @ by_calibration.T
    for place in range(8):
        whole[3 * place : 3 * place + 3, 3 * place : 3 * place + 3] += places[place]
    whole[24:, 24:] += velocity
    derivative = _derivative(quantities, state)
    skis = [_derivative(partial(_slope_and_heading, tail=tail), state) for tail in (4, 6)]
    return Spread(
        whole,
        np.sqrt(np.diagonal(derivative @ whole @ derivative.T)),
        derivative @ by_calibration,
        np.stack([d @ whole @ d.T for d in skis]),
    )


def _raw(i: int, places: Floats, spread: Spread) -> JumperState:
    before, after = max(i - 1, 0), min(i + 1, len(places) - 1)
    velocity = (places[after, 2:4] - places[before, 2:4]).mean(axis=0) * RATE_HZ / 2
    state = _state(i, places[i], velocity, spread, smoothed=False)
    seen = [_seen(place, i) for place in range(8)]
    angles = dict(state.angles)
    if not seen[0]:
        angles["beta"] = None
    if not seen[6]:
        angles = dict.fromkeys(ANGLES)
    return JumperState(
        {name: state.points[name] if seen[k] else None for k, name in enumerate(POINTS)},
        {side: state.skis[side] if seen[4 + 2 * k] else None for k, side in enumerate(SIDES)},
        angles,
        state.height,
        state.speed if 0 < i < len(places) - 1 else None,
    )


def _state(i: int, places: Floats, velocity: Floats, spread: Spread, *, smoothed: bool = True) -> SmoothedState:
    state = np.concatenate((places.ravel(), velocity))
    found = [Quantity(float(v), float(s)) for v, s in zip(quantities(state), spread.sigmas, strict=True)]
    middle = np.zeros((3, 27))
    middle[:, 6:9] = middle[:, 9:12] = np.eye(3) / 2
    status = [_status(place, i, smoothed=smoothed) for place in range(8)]
    points = {
        name: PointState(places[k], spread.whole[3 * k : 3 * k + 3, 3 * k : 3 * k + 3], _cameras(k, i), status[k])
        for k, name in enumerate(POINTS)
    }
    skis = {side: _ski(state, 4 + 2 * k, spread.skis[k], status[4 + 2 * k], i) for k, side in enumerate(SIDES)}
    return SmoothedState(
        points,
        skis,
        dict(zip(ANGLES, found[:5], strict=True)),
        found[6],
        found[7],
        origin=Vector(middle @ state, middle @ spread.whole @ middle.T),
        velocity=Vector(velocity, spread.whole[24:, 24:]),
        angle_of_attack=found[5],
        by_calibration=spread.by_calibration,
    )


def _ski(state: Floats, tail: int, covariance: Floats, status: Status, i: int) -> SkiState:
    slope_deg, heading_deg = _slope_and_heading(state, tail)
    sigma = np.sqrt(np.diagonal(covariance))
    direction = state[3 * tail + 3 : 3 * tail + 6] - state[3 * tail : 3 * tail + 3]
    return SkiState(
        direction / np.linalg.norm(direction),
        Quantity(float(slope_deg), float(sigma[0])),
        Quantity(float(heading_deg), float(sigma[1])),
        float(covariance[0, 1] / sigma.prod()),
        _cameras(tail, i),
        status,
    )


def _slope_and_heading(states: Floats, tail: int) -> Floats:
    places = states[..., 3 * tail : 3 * tail + 6]
    return np.degrees(slope_and_heading(places[..., 3:] - places[..., :3]))


def _status(place: int, i: int, *, smoothed: bool) -> Status:
    if smoothed and not _seen(place, i):
        return Status.PREDICTED
    return Status.CONTROLLED if len(_cameras(place, i)) > 2 else Status.TWO_RAYS


def _cameras(place: int, i: int) -> tuple[str, ...]:
    names = true_cameras().names
    if not _seen(place, i):
        return ()
    return names[1:] if place == 3 and TWO_RAYS[0] <= i < TWO_RAYS[1] else names


def _derivative(function: Callable[[Floats], Floats], x: Floats, step: float = 1e-5) -> Floats:
    steps = step * np.eye(len(x))
    return ((function(x + steps) - function(x - steps)) / (2 * step)).T


@cache
def _orientation(source: str) -> OrientationResult:
    system = true_cameras()
    sigmas = np.sqrt(np.diagonal(system.covariance))
    images, parameters = {}, [""] * len(sigmas)
    for name in system.names:
        placed = system[name]
        own = placed.columns[:6]
        images[name] = OrientedImage(placed.position, placed.rotation, sigmas[own[:3]], np.degrees(sigmas[own[3:]]))
        for column, of in zip(own, ("X0", "Y0", "Z0", "angle1", "angle2", "angle3"), strict=True):
            parameters[column] = f"{name}.{of}"
    balls = {}
    for ball in training().balls:
        seen = {name: system[name].project(np.array(ball.X)) for name in system.names}
        inside = {name: xy for name, xy in seen.items() if np.all((xy >= 0) & (xy <= np.array(SIZE) - 1))}
        balls[ball.name] = BallResult(
            ball.role,
            np.array(ball.X),
            np.full(3, 0.012),
            {name: np.array([*xy, 0.1, 0.1]) for name, xy in inside.items()},
        )
    return OrientationResult(images, balls, (), ("12 of 14 balls found",), tuple(parameters), system.covariance, source)


def without_takeoff(given: MeasuredRecording) -> MeasuredRecording:
    """The recording as if the take-off had not been in sight: nothing smoothed, no take-off."""
    jumps = tuple(
        replace(jump, takeoff=None, pulses=tuple(replace(pulse, smoothed=None) for pulse in jump.pulses))
        for jump in given.jumps
    )
    return replace(given, jumps=jumps)
