"""Flight of the jumper as a point mass: gravity, drag and lift, integrated by the classical Runge-Kutta method."""

import math
from dataclasses import dataclass

import numpy as np

from rig.arrays import Floats
from simrig.world.keyframes import Curve

GRAVITY = 9.82  #: m/s^2, Trondheim
STEP_S = 0.01


@dataclass(frozen=True, slots=True)
class Forces:
    """Forces on the jumper.

    Attributes:
        mass: kg.
        density: density of the air, kg/m^3.
        drag_area: drag coefficient times area, m^2, by time since take-off.
        lift_area: lift coefficient times area, likewise.
    """

    mass: float
    density: float
    drag_area: Curve
    lift_area: Curve

    def acceleration(self, time_s: float, velocity: Floats) -> Floats:
        """Acceleration, m/s^2, shape (3,).

        Drag acts against the velocity. Lift acts upwards in the vertical plane of the velocity, at a right angle to it,
        and so does no work. Both are density / 2 * area * speed^2.
        """
        vx, vy, vz = velocity
        ground_speed = math.hypot(vx, vy)
        speed = math.hypot(ground_speed, vz)
        pressure = self.density * speed / (2 * self.mass)  # the vectors below bring one more factor speed
        drag, lift = pressure * self.drag_area(time_s), pressure * self.lift_area(time_s)
        tilt = vz / ground_speed if ground_speed else 0.0
        return np.array(
            (-drag * vx - lift * tilt * vx, -drag * vy - lift * tilt * vy, -drag * vz + lift * ground_speed - GRAVITY)
        )


@dataclass(frozen=True, slots=True)
class Flight:
    """An integrated flight.

    Attributes:
        states: position and velocity, m and m/s, at multiples of `STEP_S` from take-off; shape (n, 6).
    """

    states: Floats

    def position(self, time_s: float) -> Floats:
        """Position, m, shape (3,): cubic Hermite between the steps, straight line beyond the last step."""
        last = len(self.states) - 1
        i = min(max(int(time_s / STEP_S), 0), last - 1)
        u = time_s / STEP_S - i
        here, there = self.states[i], self.states[i + 1]
        if u > 1:
            return np.asarray(there[:3] + there[3:] * (u - 1) * STEP_S)
        a, b = here[3:] * STEP_S, there[3:] * STEP_S
        rise = there[:3] - here[:3]
        return np.asarray(here[:3] + u * (a + u * (3 * rise - 2 * a - b + u * (a + b - 2 * rise))))


def fly(forces: Forces, position: Floats, velocity: Floats, duration_s: float) -> Flight:
    """Integrate the flight from `position`, m, with `velocity`, m/s, both of shape (3,), over `duration_s`."""
    steps = math.ceil(duration_s / STEP_S)
    states = np.empty((steps + 1, 6))
    states[0] = *position, *velocity
    for i in range(steps):
        states[i + 1] = _runge_kutta(forces, i * STEP_S, states[i])
    return Flight(states)


def _runge_kutta(forces: Forces, time_s: float, state: Floats) -> Floats:
    def rate(late_s: float, there: Floats) -> Floats:
        return np.concatenate((there[3:], forces.acceleration(time_s + late_s, there[3:])))

    half = STEP_S / 2
    k1 = rate(0.0, state)
    k2 = rate(half, state + half * k1)
    k3 = rate(half, state + half * k2)
    k4 = rate(STEP_S, state + STEP_S * k3)
    return np.asarray(state + STEP_S / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
