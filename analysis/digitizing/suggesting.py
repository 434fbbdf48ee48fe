"""Where one more click lowers the sigmas most: "measure here next".

Each point is a path: position and velocity, whose acceleration is white noise. Filter and smoother (Rauch, Tung,
Striebel 1965) give its covariance at every pulse from the rays that are measured; they need no measured values, but for
the place at which the rays are linearised. A further ray of a camera adds the information A' A / sigma^2, with the
derivatives A of the collinearity equations (A1); the one that lowers the trace of the covariance most comes next.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.digitizing.space import Ray, inside, intersected
from analysis.measurements.entries import SIGMA_BY_HAND
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import Suggestion
from rig.arrays import Floats

#: Standard deviation of the acceleration of a point of a jumper, m/s^2.
_ACCELERATION: Final = 20.0
#: What is known of place and velocity before anything is measured, m and m/s.
_FAR_M, _FAST_M_S = 100.0, 50.0


@dataclass(frozen=True, slots=True, eq=False)
class MarkedPulse:
    """One pulse of a jump.

    Attributes:
        pulse: its number.
        time_s: when it fired.
        rays: of each point, by thing and camera.
        closed: things and cameras where nothing can be measured: no frame, hidden, not visible.
    """

    pulse: int
    time_s: float
    rays: Mapping[str, Mapping[str, Ray]]
    closed: frozenset[tuple[str, str]]


def suggested(system: CameraSystem, pulses: Sequence[MarkedPulse], things: Sequence[str]) -> Suggestion | None:
    """The click that lowers the sigmas most; None if no camera can see more.

    Args:
        system: the oriented cameras.
        pulses: of the jump, in order.
        things: points to measure.
    """
    best: tuple[float, Suggestion] | None = None
    keys = [(k, thing) for k, pulse in enumerate(pulses) for thing in things if pulse.rays.get(thing)]
    found = intersected(system, {f"{k} {thing}": pulses[k].rays[thing] for k, thing in keys})
    for thing in things:
        solved = {k: found.adjusted.state[i] for i, (k, of) in enumerate(keys) if of == thing and found.adjusted.ok[i]}
        if not solved:
            continue
        places = _places(pulses, solved)
        before = _covariances(system, pulses, thing, places)
        for k, pulse in enumerate(pulses):
            for name, camera in system.cameras.items():
                px = camera.project(places[k])
                if name in pulse.rays.get(thing, {}) or (thing, name) in pulse.closed or not inside(px, camera.size):
                    continue
                a = camera.linearised(places[k][None], px[None])[1][0]
                added = np.linalg.inv(np.linalg.inv(before[k]) + a.T @ a / SIGMA_BY_HAND**2)
                gain = float(np.trace(before[k]) - np.trace(added))
                if best is None or gain > best[0]:
                    sigmas = [1000 * float(np.sqrt(np.trace(each))) for each in (before[k], added)]
                    why = f"its sigma goes from {sigmas[0]:.0f} to {sigmas[1]:.0f} mm"
                    best = gain, Suggestion(pulse=pulse.pulse, camera=name, thing=thing, why=why)
    return None if best is None else best[1]


def _places(pulses: Sequence[MarkedPulse], solved: Mapping[int, Floats]) -> Floats:
    """Where a point is at each pulse (n, 3): between solved ones in proportion, beyond them straight on."""
    times = np.array([pulse.time_s for pulse in pulses])
    known = np.array(sorted(solved))
    xyz = np.array([solved[k] for k in known])
    between = np.stack([np.interp(times, times[known], xyz[:, i]) for i in range(3)], axis=1)
    if len(known) < 2:
        return between
    for inner, outer, beyond in ((1, 0, times < times[known[0]]), (-2, -1, times > times[known[-1]])):
        velocity = (xyz[outer] - xyz[inner]) / (times[known[outer]] - times[known[inner]])
        between[beyond] = xyz[outer] + (times[beyond] - times[known[outer]])[:, None] * velocity
    return between


def _covariances(system: CameraSystem, pulses: Sequence[MarkedPulse], thing: str, places: Floats) -> Floats:
    """Covariance (n, 3, 3) of a point at each pulse, from all its rays and its smooth motion."""
    n = len(pulses)
    information = np.zeros((n, 3, 3))
    for k, pulse in enumerate(pulses):
        for name, ray in pulse.rays.get(thing, {}).items():
            if name in system.names:
                camera = system[name]
                a = camera.linearised(places[k][None], ray.xy[None])[1][0]
                information[k] += a.T @ np.linalg.solve(ray.covariance, a)
    filtered, predicted = np.zeros((n, 6, 6)), np.zeros((n, 6, 6))
    steps = np.zeros((n, 6, 6))
    state = np.diag([_FAR_M**2] * 3 + [_FAST_M_S**2] * 3)
    for k, pulse in enumerate(pulses):
        if k:
            dt = pulse.time_s - pulses[k - 1].time_s
            steps[k] = np.kron([[1.0, dt], [0.0, 1.0]], np.eye(3))
            noise = np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3)) * _ACCELERATION**2 * dt
            state = steps[k] @ state @ steps[k].T + noise
        predicted[k] = state
        inverse = np.linalg.inv(state)
        inverse[:3, :3] += information[k]
        state = filtered[k] = np.linalg.inv(inverse)
    smoothed = filtered.copy()
    for k in range(n - 2, -1, -1):
        gain = filtered[k] @ steps[k + 1].T @ np.linalg.inv(predicted[k + 1])
        smoothed[k] += gain @ (smoothed[k + 1] - predicted[k + 1]) @ gain.T
    return smoothed[:, :3, :3]
