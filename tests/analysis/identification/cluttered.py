"""Candidates as a detector would give them of simulated jumps: markers without names, and much else."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.candidates.markers.known_discs import DiscShape
from analysis.candidates.model import ImageCandidates, PulseCandidates, Spots
from analysis.measurements.model import POINTS
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats, Integers
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from tests.analysis.simulated import SIGMA_PX, START_NS, TrueJump, true_cameras, true_jump


@dataclass(frozen=True)
class Disturbed:
    """What makes candidates hard.

    Attributes:
        false_spots: per image, anywhere.
        body_spots: per image, within half a metre of the jumper.
        lost: share of markers that are not found.
        hidden: (marker, camera or None for all, first, last pulse) that no spot shows.
        absent: (camera, first, last pulse) without an image.
        late_s: by camera, how much later it shows the scene.
        light: contrast of the spots of a marker, as a share of that of the others.
    """

    false_spots: int = 0
    body_spots: int = 0
    lost: float = 0.0
    hidden: tuple[tuple[str, str | None, int, int], ...] = ()
    absent: tuple[tuple[str, int, int], ...] = ()
    late_s: dict[str, float] = field(default_factory=dict)
    light: dict[str, float] = field(default_factory=dict)


@dataclass
class Scene:
    """Candidates of a recording, and what each of them truly is.

    Attributes:
        candidates: of all pulses.
        spots: (pulse, camera, marker) to its true image coordinates, where a spot shows it.
    """

    candidates: list[PulseCandidates]
    spots: dict[tuple[int, str, str], Floats]


def scene(
    jumps: Sequence[TrueJump],
    system: CameraSystem,
    rng: np.random.Generator,
    pulses: range,
    disturbed: Disturbed | None = None,
) -> Scene:
    """A recording with jumps (their poses in the frame of `system`)."""
    made = Scene([], {})
    how = disturbed or Disturbed()
    for pulse in pulses:
        images = {}
        for name in system.names:
            if any(camera == name and first <= pulse <= last for camera, first, last in how.absent):
                continue
            images[name] = _image(jumps, system, name, pulse, how, rng, made)
        time = UtcNs(START_NS + round(pulse * 1e9 / 30))
        made.candidates.append(PulseCandidates(PulseNumber(pulse), time, images))
    return made


def _image(
    jumps: Sequence[TrueJump],
    system: CameraSystem,
    name: str,
    pulse: int,
    how: Disturbed,
    rng: np.random.Generator,
    made: Scene,
) -> ImageCandidates:
    size = system[name].size
    xy, light = [], list[float]()
    for jump in jumps:
        shown = pulse + how.late_s.get(name, 0.0) * jump.rate_hz
        if not -8 <= jump.pose(shown).origin[0] <= 28:
            continue
        pose = jump.pose(shown)
        for label, xyz in zip(POINTS, system_points(system, pose.markers), strict=True):
            place = system[name].project(xyz)
            hidden = any(h[0] == label and h[1] in {None, name} and h[2] <= pulse <= h[3] for h in how.hidden)
            if _inside(place, size) and not hidden and rng.random() >= how.lost:
                xy.append(place + SIGMA_PX * rng.standard_normal(2))
                light += [1.0] * (len(xy) - 1 - len(light)) + [how.light.get(label, 1.0)]
                made.spots[pulse, name, label] = place
        centre = system[name].project(system_points(system, pose.origin))
        if _inside(centre, size):
            scale = np.linalg.norm(system[name].project(system_points(system, pose.markers[0])) - centre)
            xy += list(centre + scale * rng.uniform(-1, 1, (how.body_spots, 2)))
    xy += list(rng.uniform(0, 1, (how.false_spots, 2)) * (size - 1))
    order = rng.permutation(len(xy))
    xy_all = np.array(xy).reshape(-1, 2)[order]
    n = len(xy_all)
    contrast = 80.0 * np.array(light + [1.0] * (n - len(light)))[order]
    spots = Spots(xy_all, np.tile(SIGMA_PX**2 * np.eye(2), (n, 1, 1)), np.full(n, 1.6), contrast, np.full(n, 20.0))
    return ImageCandidates(spots)


def system_points(system: CameraSystem, xyz: Floats) -> Floats:
    """Points of the hill in the frame of `system`; see `moved_frame`."""
    turn, shift = FRAMES.get(id(system), (np.eye(3), np.zeros(3)))
    return np.asarray(xyz @ turn.T + shift)


FRAMES: dict[int, tuple[Floats, Floats]] = {}


def _inside(place: Floats, size: Floats) -> bool:
    return bool(((place >= 0) & (place <= size - 1)).all())


@dataclass
class SimulatedLook:
    """Finds every marker that lies within 4 sigma of the expected place.

    Attributes:
        light: contrast of the disc of each marker; one whose spots have another contrast is none.
        every: discs are found in one of so many pulses.
    """

    light: Mapping[str, float] = field(default_factory=lambda: dict.fromkeys(POINTS, 80.0))
    every: int = 1

    def look_for_spots(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, covariance: Floats) -> list[Spots]:
        """See `SecondLook`."""
        return [self._near(*of, camera) for of in zip(pulses, xy, covariance, strict=True)]

    def _near(self, pulse: PulseNumber, xy: Floats, covariance: Floats, camera: str) -> Spots:
        placed = true_cameras()[camera]
        places = [
            placed.project(marker)
            for marker in true_jump(7).pose(pulse).markers
            if (off := placed.project(marker) - xy) @ np.linalg.solve(covariance, off) < 16
        ]
        n = len(places)
        sigma = np.tile(SIGMA_PX**2 * np.eye(2), (n, 1, 1))
        return Spots(np.reshape(places, (n, 2)), sigma, np.full(n, 1.6), np.full(n, 80.0), np.full(n, 4.0))

    def part(self, pulse: PulseNumber, camera: str, low: Integers, high: Integers) -> Region | None:
        """See `SecondLook`; there are no images."""

    def fit_discs(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, shape: DiscShape) -> Spots:
        """See `SecondLook`."""
        n = len(pulses)
        discs = Spots(np.full_like(xy, np.nan), np.tile(np.eye(2), (n, 1, 1)), shape.radius, np.zeros(n), np.zeros(n))
        for i, pulse in enumerate(pulses):
            places = true_cameras()[camera].project(true_jump(7).pose(pulse).markers)
            nearest = int(np.linalg.norm(places - xy[i], axis=1).argmin())
            light = self.light[POINTS[nearest]]
            like = abs(light - shape.contrast) < 2 * shape.sigma_contrast
            if like and pulse % self.every == 0 and np.linalg.norm(places[nearest] - xy[i]) < shape.radius[i]:
                discs.xy[i], discs.covariance[i] = places[nearest], SIGMA_PX**2 * np.eye(2)
                discs.contrast[i], discs.strength[i] = light, 20.0
        return discs
