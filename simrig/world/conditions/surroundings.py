"""What stands and moves around the hill: places of people, trees, flags and towers at any time; seeded.

`fronts` says what of it is between a camera and the jumper; images and truth both ask there.
"""

import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from rig.arrays import Floats
from simrig.world.conditions.effects import Tower
from simrig.world.figure.body import Part
from simrig.world.figure.sight import Front, outline
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

FLIGHT_MIDDLE = (10.0, 0.0, -1.8)
_NEAREST_M = 2.0
_TALL_M = 1.75


@dataclass(frozen=True, slots=True)
class Walker:
    """Somebody who walks up and down along X.

    Attributes:
        X: feet at the middle of the walk, m.
        walk_m: length of the walk.
        speed: m/s.
        phase: where on the walk at scene time 0, rad.
        coat: radiance.
    """

    X: Floats
    walk_m: float
    speed: float
    phase: float
    coat: float

    def feet(self, scene_s: float) -> Floats:
        """Place of the feet."""
        turn = self.phase + (math.pi * self.speed / self.walk_m * scene_s if self.walk_m else 0.0)
        return _moved(self.X, x=0.5 * self.walk_m * math.sin(turn))

    def parts(self, scene_s: float) -> list[Part]:
        """Legs, trunk, arm and head."""
        feet = self.feet(scene_s)
        stride = 0.25 * math.sin(4.5 * scene_s + self.phase) if self.walk_m else 0.08
        hip, neck = _moved(feet, z=0.48 * _TALL_M), _moved(feet, z=0.82 * _TALL_M)
        head = _moved(feet, z=0.93 * _TALL_M)
        return [
            Part(_moved(feet, stride, 0.08, 0.05), hip, 0.07, 0.1, 0.7 * self.coat),
            Part(_moved(feet, -stride, -0.08, 0.05), hip, 0.07, 0.1, 0.7 * self.coat),
            Part(hip, neck, 0.17, 0.2, self.coat),
            Part(_moved(neck, z=-0.1), _moved(hip, x=-stride, z=0.05), 0.06, 0.05, 0.9 * self.coat),
            Part(head, head, 0.11, 0.11, 140.0),
        ]


@dataclass(frozen=True, slots=True)
class Swaying:
    """A tree or a flag.

    Attributes:
        foot: m, shape (3,).
        tall: m.
        radiance: of its surface.
        rate: of its sway, rad/s.
        phase: rad.
    """

    foot: Floats
    tall: float
    radiance: float
    rate: float
    phase: float

    def sway(self, scene_s: float) -> float:
        """-1 to 1."""
        return 0.7 * math.sin(self.rate * scene_s + self.phase) + 0.3 * math.sin(2.7 * self.rate * scene_s)


def walkers(scenario: Scenario) -> list[Walker]:
    """Spectators beside the knoll, and officials where the scenario puts them."""
    rng = np.random.default_rng((scenario.seed, 44))
    found = []
    for _ in range(scenario.surroundings.spectators):
        x, y = rng.uniform(4, 45), rng.uniform(10.5, 15)
        feet = np.array((x, y, scenario.hill.snow(x, y)))
        found.append(
            Walker(feet, rng.uniform(1, 8), rng.uniform(0.4, 1.5), rng.uniform(0, 2 * math.pi), rng.uniform(30, 200))
        )
    for k, person in enumerate(scenario.surroundings.people):
        if person.kind == "official":
            found.append(Walker(np.array(person.X), person.walk_m, 0.4, 1.7 * k, 70.0 + 60 * (k % 3)))
    return found


def trees(scenario: Scenario, beyond: int) -> list[Swaying]:
    """Spruces between knoll and forest, on the side `beyond` the hill: 1 left, -1 right, as a camera sees it."""
    rng = np.random.default_rng((scenario.seed, 45))
    found = []
    for _ in range(scenario.surroundings.trees):
        foot = _on_snow(scenario, rng.uniform(-15, 70), beyond * rng.uniform(17, 26))
        tall, grey = rng.uniform(5, 11), rng.uniform(70, 115)
        found.append(Swaying(foot, tall, grey, rng.uniform(0.8, 2.5), rng.uniform(0, 2 * math.pi)))
    return found


def flags(scenario: Scenario, beyond: int) -> list[Swaying]:
    """Flags in a row beside the knoll, on the side `beyond` the hill."""
    rng = np.random.default_rng((scenario.seed, 46))
    found = []
    for x in np.linspace(3.0, 40.0, scenario.surroundings.flags):
        foot, tall, grey = _on_snow(scenario, float(x), beyond * 10.0), rng.uniform(3, 5), rng.uniform(40, 215)
        found.append(Swaying(foot, tall, grey, rng.uniform(5, 9), rng.uniform(0, 2 * math.pi)))
    return found


def corners(tower: Tower) -> Floats:
    """The corners of a tower, m, shape (8, 3); bit 2 of the index: along X, bit 1: along Y, bit 0: top."""
    return np.array(
        [np.add(tower.X, np.multiply(tower.size_m, (i - 0.5, j - 0.5, k))) for i, j, k in product((0, 1), repeat=3)]
    )


def in_front(tower: Tower, projection: Projection) -> bool:
    """Whether a tower stands between this camera and the flight."""
    return bool(projection.distance(tower.X) < projection.distance(FLIGHT_MIDDLE))


def seen(walker: Walker, projection: Projection, scene_s: float) -> bool:
    """Whether somebody is far enough from the camera to be drawn."""
    return bool(projection.distance(walker.feet(scene_s)) > _NEAREST_M)


def fronts(
    scenario: Scenario, people: list[Walker], projection: Projection, scene_s: float, distance: float
) -> list[Front]:
    """What is nearer to a camera than the jumper.

    Args:
        scenario: the scenario.
        people: its `walkers`.
        projection: the camera.
        scene_s: scene time.
        distance: of the jumper from that camera, m.
    """
    found: list[Front] = []
    for walker in people:
        if seen(walker, projection, scene_s) and float(projection.distance(walker.feet(scene_s))) < distance:
            found += walker.parts(scene_s)
    return found + tower_outlines(scenario, projection)


def tower_outlines(scenario: Scenario, projection: Projection) -> list[Floats]:
    """Outlines of the towers in front of a camera, px."""
    towers = [tower for tower in scenario.surroundings.towers if in_front(tower, projection)]
    shapes = [outline(corners(tower), projection) for tower in towers]
    return [shape for shape in shapes if shape is not None]


def _on_snow(scenario: Scenario, x: float, y: float) -> Floats:
    return np.array((x, y, scenario.hill.snow(x, y)))


def _moved(point: Floats, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Floats:
    return np.asarray(point + np.array((x, y, z)))
