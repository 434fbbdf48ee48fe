"""From which distributions the scenes of the corpus are drawn. The numbers are written down here and nowhere else.

They are wider than any hill that is known, since a rule that was made for one hill must show: none of them was chosen
by what the analysis can measure. A scene that no rig could measure (a camera that sees no ball, no two cameras that see
the jumper from different sides) is drawn again.
"""

import math
from dataclasses import dataclass
from enum import StrEnum
from hashlib import blake2b
from typing import Any, Final, TypeVar

import numpy as np
from pydantic import ValidationError

from rig.arrays import Floats
from rig.pulse import HillPulse
from simrig.world.projection import Projection
from simrig.world.scenario import Hill, Scenario
from simrig.world.truth import truth

_T = TypeVar("_T")
#: Numbers of cameras with their shares.
_CAMERAS: Final = {2: 0.2, 3: 0.45, 4: 0.15, 5: 0.1, 6: 0.1}
_SIZES: Final = {
    (320, 240): 0.1,
    (640, 480): 0.4,
    (752, 480): 0.15,
    (1024, 768): 0.15,
    (1280, 1024): 0.12,
    (1920, 1216): 0.08,
}
_RATES_HZ: Final = {25.0: 0.15, 30.0: 0.25, 50.0: 0.2, 60.0: 0.15, 100.0: 0.15, 200.0: 0.1}
_RENDERERS: Final = {"hill": 0.7, "drawn": 0.3}
#: Share of the scenes in which cameras stand on both sides of the hill.
_BOTH_SIDES: Final = 0.3
#: Share of the scenes whose balls are shaded by a sun.
_SUNNY: Final = 0.5
#: What is rendered of a jump, s after the take-off.
_SPAN_S: Final = (-0.75, 1.1)
#: Pixels of a whole log at most: a scene with more is drawn again. It keeps a run payable.
PIXELS_MOST: Final = 120_000_000
#: Each camera has to see so many surveyed balls.
_BALLS_LEAST: Final = 5
#: Two cameras at least see the jumper at an angle from one another of so many degrees.
_ANGLE_DEG: Final = 20.0
_TRIES: Final = 1000


class Half(StrEnum):
    """A half of the corpus."""

    WORK = "work"  #: to work with: its scenes may be looked at
    HELD_OUT = "held-out"  #: for the gate alone: nobody looks at its scenes, and one that was looked at leaves it


@dataclass(frozen=True, slots=True)
class Scene:
    """A scene of the corpus.

    Attributes:
        half: to which it belongs.
        number: in its half, from 0.
        scenario: hill, cameras, balls, jumper, weather.
        size: of the images, width and height, px.
        rate_hz: pulses per second.
        pulses: hill pulses that are rendered.
        renderer: "hill" or "drawn"; "path-traced" where that is asked for.
        marker_px: median radius of the markers in the images, px.
    """

    half: Half
    number: int
    scenario: Scenario
    size: tuple[int, int]
    rate_hz: float
    pulses: range
    renderer: str
    marker_px: float


def draw(half: Half, number: int, pixels_most: int = PIXELS_MOST) -> Scene:
    """Draw a scene; the same arguments give the same scene.

    Args:
        half: to which it belongs.
        number: in its half.
        pixels_most: pixels of its log at most.
    """
    seed = int.from_bytes(blake2b(f"{half.value} {number}".encode(), digest_size=4).digest())
    rng = np.random.default_rng(seed)
    for _ in range(_TRIES):
        scene = _drawn(rng, half, number, seed, pixels_most)
        if scene is not None:
            return scene
    raise RuntimeError(f"{_TRIES} draws of scene {number} gave no hill that a rig can measure")


def _drawn(rng: np.random.Generator, half: Half, number: int, seed: int, pixels_most: int) -> Scene | None:
    size, rate_hz = _one_of(rng, _SIZES), _one_of(rng, _RATES_HZ)
    count = _one_of(rng, _CAMERAS)
    first_s = 1.0
    pulses = range(max(0, round((first_s + _SPAN_S[0]) * rate_hz)), max(1, round((first_s + _SPAN_S[1]) * rate_hz)))
    if len(pulses) * count * size[0] * size[1] > pixels_most:
        return None
    settings = _settings(rng, seed, count, first_s)
    try:
        scenario = Scenario.model_validate(settings)
    except ValidationError:  # too bright for a camera, or a profile that is none
        return None
    scenario = Scenario.model_validate(settings | {"balls": _balls(rng, scenario.hill)})
    cameras = [camera.projection(*size) for camera in scenario.cameras]
    if not _measurable(scenario, cameras):
        return None
    renderer = _one_of(rng, _RENDERERS)
    middle = pulses[len(pulses) // 2]
    (state,) = truth(scenario, [HillPulse(middle)], rate_hz, size)["pulses"]
    if not state["jumper_present"]:
        return None
    radii = [scenario.jumper.marker_radius_m * c.c / float(c.distance(np.array(state["origin"]))) for c in cameras]
    return Scene(half, number, scenario, size, rate_hz, pulses, renderer, float(np.median(radii)))


def _settings(rng: np.random.Generator, seed: int, count: int, first_s: float) -> dict[str, Any]:
    """A scenario without balls."""
    p_x = rng.uniform(55, 115)
    hill = {
        "table_angle_deg": rng.uniform(9.5, 12.0),
        "table_height_m": rng.uniform(2.2, 4.0),
        "table_width_m": rng.uniform(2.2, 3.5),
        "knoll_angle_deg": rng.uniform(4.0, 9.0),
        "knoll_width_m": rng.uniform(9, 18),
        "p_x_m": p_x,
        "p_z_m": -p_x * rng.uniform(0.52, 0.58),
        "p_angle_deg": rng.uniform(34, 38),
    }
    weather = {"snowfall": _sometimes(rng, 0.25, 0.05, 0.4), "lens_snow": int(_sometimes(rng, 0.15, 1, 8))}
    sun = {
        "azimuth_deg": rng.uniform(-180, 180),
        "elevation_deg": rng.uniform(3, 50),
        "direct": rng.uniform(0.4, 1.0),
        "sky": rng.uniform(0.1, 0.6),
        "snow": rng.uniform(0.05, 0.4),
        "roughness_deg": rng.uniform(0, 40),
        "gloss": _sometimes(rng, 0.2, 0.1, 1.0),
    }
    light = {
        "sun": sun if rng.random() < _SUNNY else None,
        "cloud_depth": _sometimes(rng, 0.4, 0.05, 0.5),
        "cloud_period_s": rng.uniform(3, 20),
        "flicker": _sometimes(rng, 0.2, 0.05, 0.3),
        "flicker_hz": float(rng.choice((100.0, 120.0))),
        "glare_spots": int(_sometimes(rng, 0.25, 1, 5)),
        "reflections": int(_sometimes(rng, 0.3, 1, 25)),
    }
    image = {
        "black_level": rng.uniform(4, 14),
        "noise_sigma": rng.uniform(0.8, 4.0),
        "blur_sigma_px": rng.uniform(0.45, 1.1),
        "snow_flakes": int(rng.integers(0, 80)),
        "electrons_per_grey": float(rng.choice((0.0, rng.uniform(10, 80)))),
        "background_scale": rng.uniform(0.35, 1.1),
        "background_offset": rng.uniform(-20, 20),
    }
    return {
        "name": f"corpus {seed}",
        "seed": seed,
        "stamp": False,
        "first_takeoff_s": first_s,
        "jump_every_s": 4.0,
        "hill": hill,
        "jumper": _jumper(rng),
        "variation": {},
        "image": image,
        "light": light,
        "weather": weather,
        "surroundings": _surroundings(rng),
        "cameras": _cameras(rng, count),
        "ball_radius_m": rng.uniform(0.07, 0.125),
    }


def _jumper(rng: np.random.Generator) -> dict[str, Any]:
    length, opening, slope = rng.uniform(2.3, 2.75), rng.uniform(18, 36), rng.uniform(4, 16)
    missing = [{"marker": str(rng.choice(("P1", "P2", "P3", "P4")))}] if rng.random() < 0.1 else []
    return {
        "takeoff_speed_m_s": rng.uniform(22, 28),
        "takeoff_angle_deg": rng.uniform(-7.0, -4.5),
        "mass_kg": rng.uniform(45, 80),
        "ski_length_m": length,
        "ski_slope_deg": [[0.0, -11.0], [0.25, -2.0], [0.55, 0.6 * slope], [0.9, slope]],
        "ski_slope_difference_deg": [[0.0, 0.0], [0.4, rng.normal(0, 2.0)], [0.9, rng.normal(0, 2.0)]],
        "ski_opening_deg": [[0.02, 0.0], [0.3, 0.4 * opening], [0.9, opening]],
        "torso_length_m": rng.uniform(0.6, 0.8),
        "marker_radius_m": rng.uniform(0.03, 0.085),
        "marker": rng.uniform(120, 225),
        "patch": rng.uniform(10, 80),
        "suit": rng.uniform(20, 150),
        "skis": rng.uniform(40, 222),
        "occlusion": bool(rng.random() < 0.7),
        "missing_markers": missing,
    }


def _surroundings(rng: np.random.Generator) -> dict[str, Any]:
    people = []
    if rng.random() < 0.3:
        people.append(
            {"kind": "official", "X": [rng.uniform(-5, -2), rng.uniform(1, 2), 0.6], "walk_m": rng.uniform(0, 2)}
        )
    if rng.random() < 0.15:
        people.append({"kind": "jumper", "X": [-rng.uniform(5, 9), 0.0, rng.uniform(0.9, 1.6)]})
    return {
        "trees": int(_sometimes(rng, 0.5, 1, 20)),
        "flags": int(_sometimes(rng, 0.4, 1, 8)),
        "spectators": int(_sometimes(rng, 0.3, 1, 15)),
        "people": people,
    }


def _cameras(rng: np.random.Generator, count: int) -> list[dict[str, Any]]:
    side = -1 if rng.random() < 0.75 else 1
    both = rng.random() < _BOTH_SIDES
    exposure_us = math.exp(rng.uniform(math.log(150), math.log(4000)))
    cameras = []
    for index in range(count):
        on = -side if both and index % 2 else side
        centre = np.array((rng.uniform(-25, 70), on * rng.uniform(15, 50), rng.uniform(-14, 10)))
        target = np.array((rng.uniform(6, 12), 0.0, rng.uniform(-4, -1.5)))
        away = target - centre
        distance = float(np.linalg.norm(away))
        wide_m = rng.uniform(12, 28)
        lens: dict[str, float] = {}
        if rng.random() < 0.7:
            lens = {
                "x0": rng.normal(0, 4),
                "y0": rng.normal(0, 4),
                "a1": rng.normal(0, 5e-8),
                "b1": rng.normal(0, 3e-7),
                "b2": rng.normal(0, 3e-7),
            }
        moves = []
        if rng.random() < 0.1:
            moves.append({"from_s": rng.uniform(0.3, 1.8), "rotation_deg": rng.normal(0, 0.03, 3).tolist()})
        cameras.append(
            {
                "name": f"K{index + 1}",
                "c": 640 * distance / wide_m,
                "X0": centre.tolist(),
                "look_at": target.tolist(),
                "roll_deg": rng.normal(0, 2),
                "gain": rng.uniform(0.75, 1.0),
                "exposure_us": exposure_us,
                "late_ms": _sometimes(rng, 0.05, 2, 15),
                "shake_deg": _sometimes(rng, 0.3, 0.001, 0.012),
                "lens": lens,
                "moves": moves,
            }
        )
    return cameras


def _balls(rng: np.random.Generator, hill: Hill) -> list[dict[str, Any]]:
    """Balls on posts over the snow on both sides of the flight."""
    balls: list[dict[str, Any]] = []
    for index in range(int(rng.integers(9, 28))):
        x, y = rng.uniform(0, 22), float(rng.choice((-1, 1))) * rng.uniform(2, 10)
        z = float(hill.snow(x, y)) + rng.uniform(0.3, 5.0)
        control = rng.random() < 0.8
        balls.append(
            {
                "name": f"B{index + 1}",
                "role": "control" if control else "tie",
                "X": [x, y, z],
                "covered": _sometimes(rng, 0.05, 0.1, 0.5),
                "gone": bool(rng.random() < 0.04),
            }
        )
    return balls


def _measurable(scenario: Scenario, cameras: list[Projection]) -> bool:
    """Whether each camera sees enough surveyed balls, and two see the jumper from different sides."""
    surveyed = [np.array(b.X) for b in scenario.balls if b.role == "control" and not b.gone]
    for camera in cameras:
        if sum(bool(camera.sees(camera.pixels(X))) for X in surveyed if camera.distance(X) > 0) < _BALLS_LEAST:
            return False
    path = np.array((8.0, 0.0, -1.0))
    rays = [(path - camera.X0) / np.linalg.norm(path - camera.X0) for camera in cameras]
    angles = [_angle_deg(a, b) for i, a in enumerate(rays) for b in rays[:i]]
    return max(angles) > _ANGLE_DEG


def _angle_deg(a: Floats, b: Floats) -> float:
    """Angle between two lines of sight, at most 90 degrees: a line through both cameras measures nothing."""
    return math.degrees(math.acos(min(1.0, abs(float(a @ b)))))


def _one_of(rng: np.random.Generator, shares: dict[_T, float]) -> _T:
    values = list(shares)
    return values[int(rng.choice(len(values), p=np.array(list(shares.values())) / sum(shares.values())))]


def _sometimes(rng: np.random.Generator, share: float, low: float, high: float) -> float:
    """A number that is 0 in most scenes, and even between two bounds in the others."""
    drawn = rng.uniform(low, high)
    return float(drawn) if rng.random() < share else 0.0
