"""The jumps of a scenario: position and posture of the jumper at any time.

The dynamic system of Fig. 6 has its origin O at the midpoint of P3 and P4 (the middles of the skis) and its X' axis
along the mean direction of the skis; P1 (helmet) and P2 (hip) lie in its X'Z' plane. O follows the integrated flight.
In the first tenths of a second, while the legs stretch, it lags behind that: the skis still follow the table.
"""

import math
from dataclasses import dataclass

import numpy as np

from rig.arrays import Floats
from rig.pulse import HillPulse
from simrig.world.flight import Flight, Forces, fly
from simrig.world.keyframes import Curve, Keyframe
from simrig.world.scenario import Jumper, Scenario, Variation

PRESENT_X_M = (-6.0, 26.0)  #: the jumper is drawn while O is in this range, which is wider than any camera's view
FLIGHT_X_M = (0.0, 20.0)  #: the paper's "first 20 m of flight"
_FLIGHT_S = 1.2  #: a little longer than 26 m take; beyond, the path is straight
_STRETCH_S = 0.06  #: after this time the skis have taken over most of the body's upward speed
_SKI_ABOVE_TRACK_M = 0.03
_TABLE_ACCELERATION = 1.5  #: m/s^2 along the table: gravity less friction and air


@dataclass(frozen=True, slots=True)
class Pose:
    """The jumper at one instant; all points in m, shape (3,).

    Attributes:
        markers: P1 helmet, P2 hip, P3 right ski, P4 left ski; shape (4, 3).
        skis: unit directions of the right and the left ski, tail to tip; shape (2, 3).
        axes: X', Y', Z' of the dynamic system as rows; shape (3, 3).
    """

    markers: Floats
    skis: Floats
    axes: Floats

    @property
    def origin(self) -> Floats:
        """O of Fig. 6."""
        return np.asarray((self.markers[2] + self.markers[3]) / 2)


@dataclass(frozen=True, slots=True)
class Posture:
    """The curves that shape the body; angles in degrees, lengths in m, times since take-off."""

    ski_slope: Curve
    ski_slope_difference: Curve
    ski_opening: Curve
    ski_gap: Curve
    leg_length: Curve
    leg_angle: Curve
    torso_angle: Curve
    yaw: Curve
    torso_length: float

    def pose(self, time_s: float, origin: Floats) -> Pose:
        """The pose with O at `origin`."""
        slope, yaw = math.radians(self.ski_slope(time_s)), math.radians(self.yaw(time_s))
        forward = np.array((math.cos(slope) * math.cos(yaw), math.cos(slope) * math.sin(yaw), math.sin(slope)))
        side = np.array((-math.sin(yaw), math.cos(yaw), 0.0))
        up = np.cross(forward, side)
        half = math.radians(self.ski_opening(time_s)) / 2
        lean = math.radians(self.ski_slope_difference(time_s)) / 2
        along, apart = math.cos(lean) * math.cos(half) * forward, math.cos(lean) * math.sin(half) * side
        skis = np.stack((along - apart + math.sin(lean) * up, along + apart - math.sin(lean) * up))
        hip = origin + _polar(forward, up, self.leg_length(time_s), self.leg_angle(time_s))
        helmet = hip + _polar(forward, up, self.torso_length, self.torso_angle(time_s))
        aside = side * self.ski_gap(time_s) / 2
        return Pose(np.stack((helmet, hip, origin - aside, origin + aside)), skis, np.stack((forward, side, up)))


@dataclass(frozen=True, slots=True)
class Jump:
    """One jump of a series.

    Attributes:
        number: counted from 0.
        takeoff_s: scene time at which O passes the edge.
        start: O at that moment, m, shape (3,).
        table_velocity: velocity along the table at that moment, m/s, shape (3,).
        flight: path of the body's mass from then on.
        push: velocity that the take-off adds, m/s, shape (3,).
        posture: shape of the body.
    """

    number: int
    takeoff_s: float
    start: Floats
    table_velocity: Floats
    flight: Flight
    push: Floats
    posture: Posture

    def origin(self, time_s: float) -> Floats:
        """O at `time_s` after take-off (negative: on the table), m, shape (3,)."""
        if time_s <= 0:
            along = time_s + _TABLE_ACCELERATION * time_s**2 / 2 / float(np.linalg.norm(self.table_velocity))
            return np.asarray(self.start + self.table_velocity * along)
        return np.asarray(self.flight.position(time_s) - self.push * -math.expm1(-time_s / _STRETCH_S) * _STRETCH_S)

    def pose(self, time_s: float) -> Pose:
        """The pose at `time_s` after take-off."""
        return self.posture.pose(time_s, self.origin(time_s))

    def velocity(self, time_s: float, step_s: float = 1e-4) -> Floats:
        """Velocity of O, m/s, by central difference."""
        return np.asarray((self.origin(time_s + step_s) - self.origin(time_s - step_s)) / (2 * step_s))


class JumpSeries:
    """All jumps of a scenario; the latest one asked for is kept."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._latest: Jump | None = None

    def at(self, scene_s: float) -> tuple[Jump, float] | None:
        """The jump in sight at scene time `scene_s`, and the time since its take-off, s.

        None while nobody is in sight: O is outside `PRESENT_X_M`.
        """
        number = max(0, round((scene_s - self._scenario.first_takeoff_s) / self._scenario.jump_every_s))
        jump = self._jump(number)
        time_s = scene_s - jump.takeoff_s
        if not PRESENT_X_M[0] <= jump.origin(time_s)[0] <= PRESENT_X_M[1]:
            return None
        return jump, time_s

    def first(self) -> Jump:
        """The first jump."""
        return self._jump(0)

    def at_pulse(self, pulse: HillPulse, rate_hz: float) -> tuple[Jump, float] | None:
        """See `at`; the scene time of hill pulse `pulse` is pulse / rate."""
        return self.at(pulse / rate_hz)

    def _jump(self, number: int) -> Jump:
        latest = self._latest
        if latest is None or latest.number != number:
            latest = self._latest = _make_jump(self._scenario, number)
        return latest


def _make_jump(scenario: Scenario, number: int) -> Jump:
    """Jump `number`: the scenario's jumper, varied by scenario seed and number."""
    draw = np.random.default_rng((scenario.seed, number)).standard_normal(9)
    jumper, by = scenario.jumper, scenario.variation
    speed = jumper.takeoff_speed_m_s + by.speed_m_s * draw[0]
    angle = math.radians(jumper.takeoff_angle_deg + by.takeoff_angle_deg * draw[1])
    table = -math.radians(scenario.hill.table_angle_deg)
    table_velocity = speed * np.array((math.cos(table), 0.0, math.sin(table)))
    velocity = speed * np.array((math.cos(angle), 0.0, math.sin(angle)))
    velocity[1] = by.side_m_s * draw[2]
    start = np.array((0.0, 0.0, float(scenario.hill.table(0.0)) + _SKI_ABOVE_TRACK_M))
    forces = Forces(
        jumper.mass_kg,
        jumper.air_density_kg_m3,
        Curve.through(_scaled(jumper.drag_area_m2, 1 + by.lift * draw[3])),
        Curve.through(_scaled(jumper.lift_area_m2, 1 + by.lift * draw[4])),
    )
    takeoff_s = scenario.first_takeoff_s + number * scenario.jump_every_s
    flight = fly(forces, start, velocity, _FLIGHT_S)
    return Jump(number, takeoff_s, start, table_velocity, flight, velocity - table_velocity, _posture(jumper, by, draw))


def _posture(jumper: Jumper, by: Variation, draw: Floats) -> Posture:
    """Posture curves. The variation begins after take-off, where the track no longer guides the skis."""

    def varied(keyframes: tuple[Keyframe, ...], k: int) -> Curve:
        return Curve.through([(t, v + (by.posture_deg * draw[k] if t > 0 else 0.0)) for t, v in keyframes])

    return Posture(
        ski_slope=varied(jumper.ski_slope_deg, 5),
        ski_slope_difference=Curve.through(jumper.ski_slope_difference_deg),
        ski_opening=Curve.through(jumper.ski_opening_deg),
        ski_gap=Curve.through(jumper.ski_gap_m),
        leg_length=Curve.through(jumper.leg_length_m),
        leg_angle=varied(jumper.leg_angle_deg, 6),
        torso_angle=varied(jumper.torso_angle_deg, 7),
        yaw=Curve.through([(0.0, 0.0), (0.5, by.yaw_deg * draw[8])]),
        torso_length=jumper.torso_length_m,
    )


def _scaled(keyframes: tuple[Keyframe, ...], factor: float) -> list[Keyframe]:
    return [(time, value * factor) for time, value in keyframes]


def _polar(forward: Floats, up: Floats, length: float, angle_deg: float) -> Floats:
    angle = math.radians(angle_deg)
    return np.asarray(length * (math.cos(angle) * forward + math.sin(angle) * up))
