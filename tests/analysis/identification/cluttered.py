"""Candidates as a detector would give them of simulated jumps: markers and skis without names, and much else."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from analysis.candidates.model import ImageCandidates, PulseCandidates, Spots, Trace
from analysis.measurements.model import POINTS, SIDES
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from simrig.world.jumper import Pose
from tests.analysis.simulated import SIGMA_PX, SKI_SIGMA_PX, START_NS, TrueJump

WIDTH_M = 0.1  #: of a ski


@dataclass(frozen=True)
class Disturbed:
    """What makes candidates hard.

    Attributes:
        false_spots: per image, anywhere.
        false_traces: per image, anywhere, as long as skis.
        body_spots: per image, within half a metre of the jumper.
        lost: share of markers that are not found.
        broken: share of traces that come in two pieces.
        hidden: (marker, camera or None for all, first, last pulse) that no spot shows.
        absent: (camera, first, last pulse) without an image.
        late_s: by camera, how much later it shows the scene.
        light: contrast of the spots of a marker, as a share of that of the others.
        stubs: all cameras but the first one show, not a ski, but something of 1 m through its binding, 4 degrees off.
    """

    false_spots: int = 0
    false_traces: int = 0
    body_spots: int = 0
    lost: float = 0.0
    broken: float = 0.0
    hidden: tuple[tuple[str, str | None, int, int], ...] = ()
    absent: tuple[tuple[str, int, int], ...] = ()
    late_s: dict[str, float] = field(default_factory=dict)
    light: dict[str, float] = field(default_factory=dict)
    stubs: bool = False


@dataclass
class Scene:
    """Candidates of a recording, and what each of them truly is.

    Attributes:
        candidates: of all pulses.
        spots: (pulse, camera, marker) to its true image coordinates, where a spot shows it.
        skis: (pulse, camera, side) to (2, 2) two true points of its axis, where a trace shows it.
    """

    candidates: list[PulseCandidates]
    spots: dict[tuple[int, str, str], Floats]
    skis: dict[tuple[int, str, str], Floats]


def scene(
    jumps: Sequence[TrueJump],
    system: CameraSystem,
    rng: np.random.Generator,
    pulses: range,
    disturbed: Disturbed | None = None,
) -> Scene:
    """A recording with jumps (their poses in the frame of `system`)."""
    made = Scene([], {}, {})
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
    xy, traces, light = [], [], list[float]()
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
        for side in (0, 1):
            found = _ski(pose, jump, system, name, side, how, rng)
            if how.stubs:
                traces += [_stub(found[0], rng)] if found and name != system.names[0] else []
            elif found:
                traces += found
                ends = _axis(pose, jump, side)[[0, -1]]
                made.skis[pulse, name, SIDES[side]] = system[name].project(system_points(system, ends))
        centre = system[name].project(system_points(system, pose.origin))
        if _inside(centre, size):
            scale = np.linalg.norm(system[name].project(system_points(system, pose.markers[0])) - centre)
            xy += list(centre + scale * rng.uniform(-1, 1, (how.body_spots, 2)))
    xy += list(rng.uniform(0, 1, (how.false_spots, 2)) * (size - 1))
    for _ in range(how.false_traces):
        traces.append(_false_trace(size, rng))
    order = rng.permutation(len(xy))
    xy_all = np.array(xy).reshape(-1, 2)[order]
    n = len(xy_all)
    contrast = 80.0 * np.array(light + [1.0] * (n - len(light)))[order]
    spots = Spots(xy_all, np.tile(SIGMA_PX**2 * np.eye(2), (n, 1, 1)), np.full(n, 1.6), contrast, np.full(n, 20.0))
    mixed = [traces[i] for i in rng.permutation(len(traces))]
    return ImageCandidates(spots, tuple(mixed))


def system_points(system: CameraSystem, xyz: Floats) -> Floats:
    """Points of the hill in the frame of `system`; see `moved_frame`."""
    turn, shift = FRAMES.get(id(system), (np.eye(3), np.zeros(3)))
    return np.asarray(xyz @ turn.T + shift)


FRAMES: dict[int, tuple[Floats, Floats]] = {}


def _inside(place: Floats, size: Floats) -> bool:
    return bool(((place >= 0) & (place <= size - 1)).all())


def _axis(pose: Pose, jump: TrueJump, side: int) -> Floats:
    along = np.linspace(-0.48, 0.48, 24)[:, None] * jump.ski_length
    return np.asarray(pose.markers[2 + side] + along * pose.skis[side])


def _ski(
    pose: Pose, jump: TrueJump, system: CameraSystem, name: str, side: int, how: Disturbed, rng: np.random.Generator
) -> list[Trace]:
    placed = system[name]
    xyz = system_points(system, _axis(pose, jump, side))
    xy = placed.project(xyz)
    inside = ((xy >= 0) & (xy <= placed.size - 1)).all(axis=1)
    if inside.sum() < 8:
        return []
    axis = xy[-1] - xy[0]
    across = np.array((-axis[1], axis[0])) / np.linalg.norm(axis)
    noisy = (xy + SKI_SIGMA_PX * rng.standard_normal((len(xy), 1)) * across)[inside]
    cut = len(noisy) // 2 if rng.random() < how.broken else len(noisy)
    pieces = [noisy[:cut], noisy[cut + 3 :]] if cut < len(noisy) else [noisy]
    return [_trace(piece) for piece in pieces if len(piece) >= 4]


def _trace(xy: Floats) -> Trace:
    return Trace(
        xy,
        np.full(len(xy), SKI_SIGMA_PX),
        0.05,
        xy[[0, -1]],
        3.2,
        100.0,
        np.zeros(len(xy)),
        np.zeros(len(xy)),
        0.02,
        0.0,
        0.05,
    )


def _stub(ski: Trace, rng: np.random.Generator) -> Trace:
    middle = len(ski.xy) // 2
    part = ski.xy[max(0, middle - 5) : middle + 5]
    centre, angle = part.mean(axis=0), np.radians(4.0) * rng.choice((-1, 1))
    turn = np.array(((np.cos(angle), -np.sin(angle)), (np.sin(angle), np.cos(angle))))
    return _trace(centre + (part - centre) @ turn.T)


def _false_trace(size: Floats, rng: np.random.Generator) -> Trace:
    begin = rng.uniform(0, 1, 2) * (size - 1)
    angle, length = rng.uniform(0, np.pi), rng.uniform(20, 80)
    end = begin + length * np.array((np.cos(angle), np.sin(angle)))
    return _trace(begin + np.linspace(0, 1, 16)[:, None] * (end - begin) + 0.2 * rng.standard_normal((16, 1)))
