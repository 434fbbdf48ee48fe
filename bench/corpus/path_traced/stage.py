"""Describes a scene for Blender: shapes, materials, light, ideal cameras, and a shot per camera and pulse.

Pictures are rendered with `FINER` pixels for one, wider than the image by a margin: `hill` adds the lens, the movements
of the camera and the sensor. Of a shot only the surroundings of the jumper and of its shadow are rendered; all else is
the picture without the jumper.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from bench.corpus.path_traced.figure import MARKER_THICK_M, Figure
from bench.corpus.path_traced.optics import FINER, Optics
from bench.corpus.path_traced.scenery import Scenery, towards
from rig.arrays import Floats
from simrig.world.jumper import Jump, JumpSeries
from simrig.world.scenario import BRIGHTEST, Scenario

#: Radiance of a white surface in full light, of what a picture holds: the sensor alone clips what is brighter.
WHITE: Final = 0.4
STILL: Final = "still"  # picture of a camera without the jumper
_SAMPLES, _STILL_SAMPLES = 12, 6  # of a pixel of the picture: 48 and 24 of one of the image
_BOUNCES: Final = 1
_AROUND_M: Final = 0.35  # rendered about the joints
_ALBEDO: Final = 0.85  # of white
_OVERCAST: Final = 0.9  # radiance of the sky without a sun
_EXPOSED: Final = 0.85  # radiance of a white plate that faces the cameras, 1 where the sensor is full
_ON_PLATE: Final = 40  # points whose sight decides which share of a marker is seen
_PATCHED: Final = 0.5  # share of the scenes in which the hip has a dark patch around its marker
_BEND_M: Final = 0.012  # of the skis, standard deviation

#: Albedo, contrast and grain (m) of the texture, height of the bumps (m), share of gloss, roughness of the surfaces.
_MATERIALS: Final = {
    "snow": (0.8, 0.08, 0.6, 0.0, 0.0, 0.8),
    "ice": (0.5, 0.1, 0.2, 0.0, 0.1, 0.3),
    "boards": (0.35, 0.3, 0.3, 0.0, 0.0, 0.7),
    "needles": (0.06, 0.8, 0.25, 0.0, 0.0, 1.0),
    "post": (0.3, 0.0, 1.0, 0.0, 0.0, 0.6),
    "shield": (0.05, 0.3, 0.05, 0.0, 0.0, 0.8),
    "skin": (0.5, 0.1, 0.05, 0.0, 0.0, 0.6),
    "visor": (0.04, 0.0, 1.0, 0.0, 0.1, 0.1),
    "glove": (0.2, 0.4, 0.03, 0.01, 0.0, 0.8),
    "boot": (0.1, 0.4, 0.08, 0.01, 0.05, 0.4),
}


class Stage:
    """The cameras, the hill and the first jumper of a scenario, as a description.

    Args:
        scenario: the scenario.
        states: its truth by hill pulse, as `simrig.world.truth` tells it.
        optics: of its cameras.

    Attributes:
        scenery: what stands still.
        told: the description, ready for JSON.
    """

    def __init__(self, scenario: Scenario, states: Mapping[int, Mapping[str, Any]], optics: Sequence[Optics]) -> None:
        self._scenario, self._states = scenario, states
        self._rng = np.random.default_rng((scenario.seed, 5))
        names = [camera.name for camera in scenario.cameras]
        self._optics = dict(zip(names, optics, strict=True))
        self._cameras = {name: of.camera for name, of in self._optics.items()}
        self._jump: Jump = JumpSeries(scenario).first()
        jumping = [state for state in states.values() if state["jumper_present"]]
        path = np.array([state["origin"] for state in jumping])
        self._facing = towards(list(self._cameras.values()), path.mean(axis=0))
        self._figure = Figure(
            scenario.jumper, self._facing, float(self._rng.normal(0, _BEND_M)), bool(self._rng.random() < _PATCHED)
        )
        self.scenery = Scenery(scenario, list(self._cameras.values()), path, self._rng)
        self.told = self._description()

    def joints(self, pulse: int) -> Floats:
        """The points of the figure in the middle of the exposure of a pulse, m, shape (19, 3)."""
        return self._figure.joints(self._jump.pose(self._states[pulse]["since_takeoff_s"]))

    def _description(self) -> dict[str, Any]:
        still = self.scenery.placed()
        meshes = {name: {**mesh.plain(), "materials": of} for name, (mesh, of, _) in still.items()}
        meshes |= {name: {**mesh.plain(), "materials": of} for name, (mesh, of) in self._figure.meshes.items()}
        shots = [self._empty(name) for name in self._cameras]
        parts: dict[str, str] = {}
        for pulse, state in self._states.items():
            if state["jumper_present"]:
                for name in self._cameras:
                    shot, used = self._shot(name, pulse, state)
                    shots.append(shot)
                    parts |= used
        return {
            **self._light(),
            "bounces": _BOUNCES,
            "materials": self._materials(),
            "meshes": meshes,
            "still": {name: [place.tolist() for place in places] for name, (_, _, places) in still.items()},
            "parts": parts,
            "cameras": {name: self._camera(name) for name in self._cameras},
            "shots": shots,
        }

    def _camera(self, name: str) -> dict[str, Any]:
        camera, pose = self._cameras[name], np.eye(4)
        pose[:3] = np.column_stack((camera.R, camera.X0))
        return {"size": self._optics[name].size, "c": camera.c * FINER, "pose": pose.tolist()}

    def _empty(self, name: str) -> dict[str, Any]:
        width, height = self._optics[name].size
        return {
            "name": f"{name}-{STILL}",
            "camera": name,
            "samples": _STILL_SAMPLES,
            "rectangles": [(0, 0, width, height)],
            "places": {},
            "way": [0.0, 0.0, 0.0],
            "samples_of": {},
        }

    def _shot(self, name: str, pulse: int, state: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, str]]:
        """A camera's shot of a pulse, and the mesh of each part in it."""
        settings = next(camera for camera in self._scenario.cameras if camera.name == name)
        since_s = state["middle_s"][name] - self._jump.takeoff_s
        pose = self._jump.pose(since_s)
        worn = self._scenario.jumper.worn(self._jump.number)
        placed = self._figure.placed(pose, worn)
        joints = self._figure.joints(pose)
        way = self._jump.velocity(since_s) * settings.exposure_us / 1e6
        shown = [joints] if self._sun is None else [joints, self._shadow(joints, self._sun)]
        labels = [label for label, on in zip(("P1", "P2", "P3", "P4"), worn, strict=True) if on]
        shot = {
            "name": f"{name}-{pulse}",
            "camera": name,
            "samples": _SAMPLES,
            "rectangles": _apart([r for points in shown if (r := self._rectangle(name, points))]),
            "places": {part: place.tolist() for part, (_, place) in placed.items()},
            "way": way.tolist(),
            "samples_of": {label: self._plate(placed[f"{label} marker"][1], name).tolist() for label in labels},
        }
        return shot, {part: mesh for part, (mesh, _) in placed.items()}

    def _rectangle(self, name: str, points: Floats) -> tuple[int, int, int, int] | None:
        """Left, top, right and bottom of the part of a picture that shows these points, px; None: it does not."""
        camera = self._cameras[name]
        distance = camera.distance(points)
        if distance.min() < 1:
            return None
        seen, reach = self._optics[name].pixels(points), _AROUND_M * FINER * camera.c / float(distance.mean())
        size = np.array(self._optics[name].size)
        low = np.clip(np.floor(seen.min(axis=0) - reach), 0, size).astype(int)
        high = np.clip(np.ceil(seen.max(axis=0) + reach), 0, size).astype(int)
        if (high - low < 2).any():
            return None
        return int(low[0]), int(low[1]), int(high[0]), int(high[1])

    def _shadow(self, points: Floats, sun: Floats) -> Floats:
        """Where the shadows of points fall, m, shape (n, 3)."""
        ways = np.linspace(0, 60, 400)[:, None, None]
        along = points - ways * sun
        hill = self._scenario.hill
        ground = self.scenery.snow(along[..., 0], along[..., 1])
        on_table = (along[..., 0] <= 0) & (np.abs(along[..., 1]) < hill.table_width_m / 2)
        ground = np.where(on_table, hill.table(along[..., 0]), ground)
        first = np.argmax(along[..., 2] <= ground, axis=0)
        return np.asarray(along[first, np.arange(len(points))])

    def _plate(self, matrix: Floats, name: str) -> Floats:
        """Points all over the side of a marker's plate that a camera sees, m, shape (n, 3)."""
        k = np.arange(_ON_PLATE)
        r = 0.95 * self._scenario.jumper.marker_radius_m * np.sqrt((k + 0.5) / _ON_PLATE)
        turn = k * math.pi * (3 - math.sqrt(5))
        side = np.sign((self._cameras[name].X0 - matrix[:3, 3]) @ matrix[:3, 2])
        flat = np.stack((r * np.cos(turn), r * np.sin(turn), np.full(len(k), side * MARKER_THICK_M / 2)), axis=1)
        return flat @ matrix[:3, :3].T + matrix[:3, 3]

    @property
    def _sun(self) -> Floats | None:
        """Unit vector to the sun; None: the sky is overcast."""
        sun = self._scenario.light.sun
        if sun is None:
            return None
        azimuth, elevation = math.radians(sun.azimuth_deg), math.radians(sun.elevation_deg)
        level = math.cos(elevation)
        return np.array((level * math.cos(azimuth), level * math.sin(azimuth), math.sin(elevation)))

    def _light(self) -> dict[str, Any]:
        """Sun and sky, exposed as an operator would: a white plate that faces the cameras is nearly white.

        Half of what it sees is sky, half is snow in the same light.
        """
        sun, towards = self._scenario.light.sun, self._sun
        direct, sky = (0.0, _OVERCAST) if sun is None else (sun.direct, sun.sky)
        there = np.zeros(3) if towards is None else towards
        snow = _MATERIALS["snow"][0] * (direct * max(0.0, float(there[2])) + sky)
        plate = direct * max(0.0, float(self._facing @ there)) + (sky + snow) / 2
        scale = WHITE * _EXPOSED / (_ALBEDO * plate)
        shone = {"towards": there.tolist(), "irradiance": math.pi * direct * scale}
        return {"sun": None if towards is None else shone, "sky": sky * scale}

    def _materials(self) -> dict[str, dict[str, float]]:
        jumper, sun = self._scenario.jumper, self._scenario.light.sun
        gloss, rough_deg = (0.0, 20.0) if sun is None else (0.1 * sun.gloss, sun.roughness_deg)
        known = _MATERIALS | {
            "ball": (_ALBEDO, 0.0, 1.0, 0.0, gloss, math.radians(rough_deg)),
            "marker": (_ALBEDO * jumper.marker / BRIGHTEST, 0.05, 0.02, 0.0, 0.0, 0.9),
            "suit": (_ALBEDO * jumper.suit / BRIGHTEST, 0.15, 0.12, 0.015, 0.0, 0.7),
            "helmet": (_ALBEDO * jumper.patch / BRIGHTEST, 0.1, 0.3, 0.0, 0.05, 0.3),
            "patch": (_ALBEDO * jumper.patch / BRIGHTEST, 0.1, 0.1, 0.0, 0.0, 0.7),
            "ski": (_ALBEDO * jumper.skis / BRIGHTEST, 0.07, 0.1, 0.0, 0.04, 0.4),
            "print": (0.6 * _ALBEDO * jumper.skis / BRIGHTEST, 0.2, 0.05, 0.0, 0.04, 0.4),
        }
        keys = "albedo", "contrast", "grain_m", "bump_m", "gloss", "roughness"
        return {name: dict(zip(keys, of, strict=True)) for name, of in known.items()}


def _apart(rectangles: list[tuple[int, int, int, int]]) -> list[tuple[int, int, int, int]]:
    """The rectangles; two that overlap become one."""
    if len(rectangles) == 2:
        (a, b, c, d), (e, f, g, h) = rectangles
        if max(a, e) < min(c, g) and max(b, f) < min(d, h):
            return [(min(a, e), min(b, f), max(c, g), max(d, h))]
    return rectangles
