"""From a state of the motion with its covariance to points, skis, angles, height and speed with theirs."""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from analysis.measurements.model import POINTS, SIDES
from analysis.motion.model.channels import CHANNELS, ORIGIN, SKI_WEIGHTS, VECTORS, MotionFrame, slopes_and_headings
from analysis.motion.model.observations import GROUPS
from analysis.result.model import QUANTITIES, PointState, Quantity, SkiState, SmoothedState, Status, Vector
from photogrammetry.jumper.stick_model import ANGLES, body_angle_derivatives, body_angles, slope, slope_gradient
from rig.arrays import Flags, Floats

_INPUTS = CHANNELS + 3  # the channels and the velocity of O
_CONTROLLED = 3  # rays
_POINT_ROWS, _SKI_ROWS, _ORIGIN_ROWS = slice(0, 12), slice(12, 16), slice(16, 19)
_QUANTITY_ROWS, _ANGLE_ROWS, _VELOCITY_ROWS = slice(19, 30), slice(19, 24), slice(27, 30)
_ATTACK_ROW, _HEIGHT_ROW, _SPEED_ROW = 24, 25, 26
_DEGREES = np.ones(30)
_DEGREES[[12, 13, 14, 15, *range(19, 25)]] = np.degrees(1.0)
#: rad. Angles follow from a state by derivatives, which hold no longer where twice the sigma is a radian: there
#: an angle and its sine differ by a sixth. An angle that is less certain is as good as unknown.
_VAGUE: Final = 1 / 2
#: What each quantity needs, of GROUPS.
NEEDS: Final[Mapping[str, tuple[str, ...]]] = {
    "alpha": ("P2", "P3", "P4", "right", "left"),
    "beta": ("P1", "P2", "P3", "P4"),
    "gamma": ("right", "left"),
    "dphi": ("right", "left"),
    "phi": ("right", "left"),
    "angle_of_attack": ("right", "left"),
    "height": ("P3", "P4"),
    "speed": ("P3", "P4"),
}


def smoothed_states(
    frame: MotionFrame,
    unit: float,
    states: Floats,
    covariance: Floats,
    by_calibration: Floats,
    cameras: Sequence[Mapping[str, tuple[str, ...]]],
    by_hand: Sequence[Mapping[str, bool]],
    known: Flags,
    vague: float = _VAGUE,
) -> list[SmoothedState]:
    """What follows from n states.

    Args:
        frame: of the motion.
        unit: of time of the states, s.
        states: (n, 48).
        covariance: (n, 48, 48).
        by_calibration: (n, 48, p) derivatives of the states by the cameras' given parameters.
        cameras: of each pulse, by group those whose measurement was used.
        by_hand: of each pulse, by group whether a person measured any of them.
        known: (6,) which groups were ever intersected; of the others nothing is stated.
        vague: rad; skis and angles that are less certain, where nothing was seen for long, are left out.
    """
    pick = np.r_[0:CHANNELS, CHANNELS : CHANNELS + 3]
    scale = np.concatenate((np.ones(CHANNELS), np.full(3, 1 / unit)))
    inputs = states[:, pick] * scale
    spread = covariance[:, pick][:, :, pick] * np.outer(scale, scale)
    given = by_calibration[:, pick] * scale[:, None]
    values, by = _evaluated(frame, inputs)
    values, by = values * _DEGREES, by * _DEGREES[:, None]
    out = by @ spread @ by.transpose(0, 2, 1)
    gradient = (by @ given)[:, _QUANTITY_ROWS]
    return [
        _state(values[k], out[k], gradient[k], cameras[k], by_hand[k], dict(zip(GROUPS, known, strict=True)), vague)
        for k in range(len(states))
    ]


def known_groups(used: Flags) -> Flags:
    """(6,) which groups were in two cameras at once in any pulse."""
    return np.asarray((used.sum(axis=1) >= 2).any(axis=0))


def _evaluated(frame: MotionFrame, inputs: Floats) -> tuple[Floats, Floats]:
    """All results (n, 30) of inputs (n, 19), SI units, and their derivatives (n, 30, 19)."""
    channels, velocity = inputs[:, :CHANNELS], inputs[:, CHANNELS:] @ frame.rotation.T
    points, skis = frame.points(channels), frame.skis(channels)
    turned = slopes_and_headings(channels) + np.array((0.0, frame.heading))
    turned[..., 1] = (turned[..., 1] + np.pi) % (2 * np.pi) - np.pi
    origin = (points[:, 2] + points[:, 3]) / 2
    body = points[:, 0], points[:, 1], origin, skis[:, 0], skis[:, 1]
    angles, speed = body_angles(*body), np.linalg.norm(velocity, axis=1, keepdims=True)
    attack = angles[:, ANGLES.index("phi")] - slope(velocity)
    parts = (points.reshape(-1, 12), turned.reshape(-1, 4), origin, angles, attack[:, None], origin[:, 2:], speed)
    by = np.zeros((len(inputs), len(_DEGREES), _INPUTS))
    by_points = frame.by_vectors(np.tile(np.eye(3), (len(POINTS), 1, 1)), np.arange(len(POINTS)))
    by[:, _POINT_ROWS, :VECTORS] = by_points.reshape(-1, VECTORS)
    by[:, _SKI_ROWS, VECTORS:CHANNELS] = SKI_WEIGHTS.reshape(-1, CHANNELS - VECTORS)
    by[:, _ORIGIN_ROWS, ORIGIN] = frame.rotation
    of_angles = body_angle_derivatives(*body)
    by_body = np.concatenate((by_points[0], by_points[1], by_points[2:].mean(axis=0)))
    by[:, _ANGLE_ROWS, :VECTORS] = of_angles[:, :, :3].reshape(len(by), len(ANGLES), -1) @ by_body
    by_skis = frame.by_skis(channels).reshape(len(by), -1, CHANNELS - VECTORS)
    by[:, _ANGLE_ROWS, VECTORS:CHANNELS] = of_angles[:, :, 3:].reshape(len(by), len(ANGLES), -1) @ by_skis
    by[:, _ATTACK_ROW] = by[:, _ANGLE_ROWS][:, ANGLES.index("phi")]
    by[:, _ATTACK_ROW, CHANNELS:] = -slope_gradient(velocity) @ frame.rotation
    by[:, _HEIGHT_ROW, ORIGIN] = frame.rotation[2]
    by[:, _SPEED_ROW, CHANNELS:] = velocity @ frame.rotation / speed
    by[:, _VELOCITY_ROWS, CHANNELS:] = frame.rotation
    return np.concatenate((*parts, velocity), axis=1), by


def _state(
    values: Floats,
    covariance: Floats,
    gradient: Floats,
    cameras: Mapping[str, tuple[str, ...]],
    by_hand: Mapping[str, bool],
    known: Mapping[str, bool],
    vague: float,
) -> SmoothedState:
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    unknown = sigma > np.where(_DEGREES == 1.0, np.inf, np.degrees(vague))

    def quantity(row: int) -> Quantity:
        return Quantity(float(values[row]), float(sigma[row]))

    def status(group: str) -> Status:
        rays = len(cameras[group])
        if rays < 2:
            return Status.PREDICTED
        if by_hand[group]:
            return Status.BY_HAND
        return Status.CONTROLLED if rays >= _CONTROLLED else Status.TWO_RAYS

    points: dict[str, PointState | None] = {}
    for i, label in enumerate(POINTS):
        at = slice(3 * i, 3 * i + 3)
        points[label] = (
            PointState(values[at], covariance[at, at], cameras[label], status(label)) if known[label] else None
        )
    skis: dict[str, SkiState | None] = {}
    for i, side in enumerate(SIDES):
        up, aside = 12 + 2 * i, 13 + 2 * i
        known = {**known, side: known[side] and not (unknown[up] or unknown[aside])}
        direction = _direction(values[up], values[aside])
        correlation = float(covariance[up, aside] / (sigma[up] * sigma[aside]))
        ski = SkiState(direction, quantity(up), quantity(aside), correlation, cameras[side], status(side))
        skis[side] = ski if known[side] else None
    first = _QUANTITY_ROWS.start
    missing = [
        bool(unknown[first + i]) or not all(known[group] for group in NEEDS.get(name, ()))
        for i, name in enumerate(QUANTITIES)
    ]
    gradient = np.where(np.array(missing)[:, None], np.nan, gradient)
    found = {name: None if missing[i] else quantity(first + i) for i, name in enumerate(QUANTITIES)}
    return SmoothedState(
        points=points,
        skis=skis,
        angles={name: found[name] for name in ANGLES},
        height=found["height"],
        speed=found["speed"],
        origin=Vector(values[_ORIGIN_ROWS], covariance[_ORIGIN_ROWS, _ORIGIN_ROWS]),
        velocity=Vector(values[_VELOCITY_ROWS], covariance[_VELOCITY_ROWS, _VELOCITY_ROWS]),
        angle_of_attack=found["angle_of_attack"],
        by_calibration=gradient,
    )


def _direction(slope_deg: float, heading_deg: float) -> Floats:
    up, aside = np.radians((slope_deg, heading_deg))
    return np.array((np.cos(up) * np.cos(aside), np.cos(up) * np.sin(aside), np.sin(up)))
