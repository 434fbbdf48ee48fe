"""Measure here next: where one more click lowers the sigmas most.

A thing moves smoothly, so that a mark says something about the pulses around it too. The covariance of its path follows
from the marks and the prior of the motion alone, whatever their values are: a Kalman smoother without numbers. One more
mark at pulse k with the derivatives H and the noise R takes the trace of

    C_k H' (H C_k H' + R)^-1 H C_k

off the covariance C_k of its place, and what it does to other pulses goes with it. The suggested mark is the one that
takes the most off, over all things, pulses and cameras that may show the thing and were not looked at yet.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.motion.model.prior import LIVELIEST, transitions, white_jerk
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Flags, Floats

_PLACE_M, _SPEED, _ACCELERATION = 10.0, 30.0, 20.0  # standard deviations of a path before any mark, m, m/s, m/s^2
_ENOUGH_M: Final = 0.003  #: sigma of a place that no further mark needs to lower
_STATE = 9
_BORDER_PX = 8.0  # a thing that should appear nearer to the border may lie outside the image


@dataclass(frozen=True, slots=True, eq=False)
class Suggestion:
    """One more mark.

    Attributes:
        pulse, camera, thing: where.
        before: m, sigma of the place there, root of the mean variance of X, Y, Z.
        after: m, the same with the mark.
        why: in words.
    """

    pulse: int
    camera: str
    thing: str
    before: float
    after: float
    why: str


@dataclass(frozen=True, slots=True, eq=False)
class PathMarks:
    """What is known of a thing in n pulses and m cameras.

    Attributes:
        places: (n, 3) about where it is, m; the next known place where nothing is measured.
        measured: (n, m) whether it is marked.
        closed: (n, m) whether a mark is out of the question: hidden, not visible, or no frame.
    """

    places: Floats
    measured: Flags
    closed: Flags


def suggest(
    system: CameraSystem,
    names: Sequence[str],
    pulses: Sequence[int],
    things: Mapping[str, PathMarks],
    rate_hz: float,
    sigma_px: float = 0.3,
    skip: Collection[tuple[int, str, str]] = (),
) -> Suggestion | None:
    """The mark that lowers the covariance of the paths most.

    Args:
        system: the oriented cameras.
        names: of the m cameras.
        pulses: the n pulses, in order.
        things: what is known of each.
        rate_hz: pulses per second.
        sigma_px: of a mark.
        skip: pulse, camera and thing of marks that nobody wants to be asked for again.

    Returns:
        The mark; None if all places are known to 3 mm, or no mark is possible.
    """
    if not things:
        return None
    every = [_derivatives(system, names, known.places) for known in things.values()]
    rows, measured = np.stack([of for of, _ in every]), np.stack([known.measured for known in things.values()])
    covariance = _paths(measured, rows, np.diff(pulses).astype(float), rate_hz, sigma_px)
    possible = np.stack([inside for _, inside in every]) & ~measured
    possible &= ~np.stack([known.closed for known in things.values()])
    cross = rows @ covariance[:, :, None]  # (g, n, m, 2, 3)
    spread = cross @ rows.swapaxes(-1, -2) + sigma_px**2 * np.eye(2)
    gain = np.einsum("...ij,...ij->...", cross, np.linalg.solve(spread, cross))
    sigma = np.sqrt(np.trace(covariance, axis1=2, axis2=3) / 3)
    possible &= (sigma > _ENOUGH_M)[..., None]
    order = list(things)
    for pulse, camera, thing in skip:
        if thing in things and pulse in pulses and camera in names:
            possible[order.index(thing), list(pulses).index(pulse), list(names).index(camera)] = False
    if not possible.any():
        return None
    g, k, c = (int(i) for i in np.unravel_index(int(np.where(possible, gain, -1.0).argmax()), gain.shape))
    before = float(sigma[g, k])
    after = float(np.sqrt(max(0.0, before**2 - gain[g, k, c] / 3)))
    why = f"sigma of {order[g]} at pulse {pulses[k]} falls from {_length(before)} to {_length(after)}"
    return Suggestion(pulses[k], names[c], order[g], before, after, why)


def _length(metres: float) -> str:
    if metres >= 1.0:
        return "unknown" if metres > _PLACE_M / 2 else f"{metres:.1f} m"
    return f"{metres * 100:.0f} cm" if metres >= 0.1 else f"{metres * 1000:.0f} mm"


def _derivatives(system: CameraSystem, names: Sequence[str], places: Floats) -> tuple[Floats, Flags]:
    """Derivatives (n, m, 2, 3) of the image points of places by them, and which (n, m) lie inside the images."""
    rows = np.empty((len(places), len(names), 2, 3))
    inside = np.zeros(rows.shape[:2], bool)
    for c, name in enumerate(names):
        xy, rows[:, c], _ = system[name].linearised(places, np.zeros((len(places), 2)))
        room = np.minimum(xy, system[name].size - 1 - xy).min(axis=1)
        inside[:, c] = (room > _BORDER_PX) & system[name].in_front(places)
    return rows, inside


def _paths(measured: Flags, rows: Floats, steps: Floats, rate_hz: float, sigma_px: float) -> Floats:
    """Covariance (g, n, 3, 3) of the places of g paths: from what lies before a pulse, after it, and its own marks.

    Forward and backward the information (inverse covariance) of the state is carried separately and added.

    Args:
        measured: (g, n, m).
        rows: (g, n, m, 2, 3).
        steps: (n - 1,) pulses from one to the next.
        rate_hz: pulses per second.
        sigma_px: of a mark.
    """
    h = 1 / rate_hz
    own = np.zeros((*measured.shape[:2], _STATE, _STATE))
    weighted = rows * (measured / sigma_px**2)[..., None, None]
    own[..., :3, :3] = (weighted.swapaxes(-1, -2) @ rows).sum(axis=2)
    scale = np.repeat((_PLACE_M, _SPEED * h, _ACCELERATION * h**2 / 2), 3)
    before, after = np.zeros_like(own), np.zeros_like(own)
    before[:, 0] = np.diag(scale**-2.0)
    for k, step in enumerate(steps):
        move, noise = _step(step, h)
        last = np.linalg.inv(before[:, k] + own[:, k])
        before[:, k + 1] = np.linalg.inv(move @ last @ move.T + noise)
    for k in range(len(steps) - 1, -1, -1):  # F' (I^-1 + Q)^-1 F, in a form that needs no information either
        move, noise = _step(steps[k], h)
        following = after[:, k + 1] + own[:, k + 1]
        carried = np.linalg.inv(np.eye(_STATE) + noise @ following)
        after[:, k] = move.T @ following @ carried @ move
    return np.asarray(np.linalg.inv(before + own + after)[..., :3, :3])


def _step(steps: float, h: float) -> tuple[Floats, Floats]:
    """Transition and noise (9, 9) of so many pulses."""
    jerk = white_jerk(np.array(steps * h), h) * LIVELIEST
    move = np.kron(transitions(np.array(steps)), np.eye(3))
    return np.asarray(move, float), np.asarray(np.kron(jerk, np.eye(3)), float)
