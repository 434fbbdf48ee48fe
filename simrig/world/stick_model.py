"""The stick model of Fig. 6: the numbers that describe a pose, and the ski lines in the form of Eq. (C8).

The figure's angles are read so, all in degrees, X' the mean direction of the skis (tail to tip), O the midpoint of P3
and P4:

- alpha: between X' and the legs O-P2;
- beta: at the hip, between P2-O and P2-P1; 180 would be a straight body;
- gamma: between the two skis, the opening of the V;
- dphi: slope of the right ski minus slope of the left one;
- phi: slope of X' above the horizontal.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simrig.world.jumper import Pose

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Angles:
    """Angles of Fig. 6, degrees."""

    alpha: float
    beta: float
    gamma: float
    dphi: float
    phi: float


@dataclass(frozen=True, slots=True)
class SkiLine:
    """A ski line by Eq. (C8): Z = alpha X + gamma, Y = beta X + delta."""

    alpha: float
    beta: float
    gamma: float
    delta: float


def angles(pose: Pose) -> Angles:
    """The angles of a pose."""
    helmet, hip = pose.markers[0], pose.markers[1]
    right, left = pose.skis
    forward = pose.axes[0]
    return Angles(
        alpha=_between(forward, hip - pose.origin),
        beta=_between(pose.origin - hip, helmet - hip),
        gamma=_between(right, left),
        dphi=_slope(right) - _slope(left),
        phi=_slope(forward),
    )


def ski_line(point: Array, direction: Array) -> SkiLine:
    """The line through `point` along `direction`, both of shape (3,); it must not be parallel to the YZ plane."""
    alpha, beta = float(direction[2] / direction[0]), float(direction[1] / direction[0])
    return SkiLine(alpha, beta, float(point[2] - alpha * point[0]), float(point[1] - beta * point[0]))


def _between(a: Array, b: Array) -> float:
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))


def _slope(direction: Array) -> float:
    return math.degrees(math.atan2(direction[2], math.hypot(direction[0], direction[1])))
