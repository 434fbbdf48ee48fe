"""Where the skis are at a pulse at which a person marked them: to be fitted there, and to be followed from there."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from analysis.digitizing.following.points.motion import KnownMotion
from analysis.digitizing.geometry.space import PointsInSpace, Ray, intersected
from analysis.digitizing.marks.effective import covariance_of, effective_pulse
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import LINES
from analysis.digitizing.opened_log import OpenedLog
from analysis.measurements.model import PulseMeasurements
from analysis.pulses.least_squares import adjust
from analysis.pulses.points import rays
from analysis.pulses.skis import across_axes, skis_of
from analysis.scene.camera_system import CameraSystem
from analysis.ski_bars.bars import OF_POSE, SKIS, USUAL_SHAPE, USUAL_SHAPE_SIGMA, ExpectedBars, Poses
from analysis.ski_bars.pixels import SkiView
from rig.api.digitizing import MarkState
from rig.arrays import Floats
from rig.errors import NoFitError
from rig.phrase import Phrase, phrase

#: The binding on each ski, right and left.
BINDINGS: Final = {"right ski": "P3", "left ski": "P4"}
#: A person marks the axis or an edge: standard deviations of that, m across, and rad.
_BESIDE_M, _TURNED = 0.03, 0.02
#: How well the middle of what was marked tells where the binding is, m.
_MIDDLE_M: Final = 0.3
#: How fast a jumper is along his skis, and how far he may be from that, m/s.
_SPEED, _SPEED_SIGMA = 25.0, 8.0


@dataclass(frozen=True, slots=True, eq=False)
class SkiStart:
    """The skis at a pulse.

    Attributes:
        expected: from the marks.
        present: of both skis, which are marked in two images or more.
        bound: of both skis, whether the binding is marked.
        known: about the motion of both bindings.
        refused: by ski, why it does not begin.
    """

    expected: ExpectedBars
    present: tuple[bool, bool]
    bound: tuple[bool, bool]
    known: list[KnownMotion]
    refused: Mapping[str, Phrase]


def ski_views(log: OpenedLog, system: CameraSystem, pulse: int, velocity: Floats) -> list[SkiView]:
    """What the oriented cameras show at a pulse of skis that move with a velocity (3,), m/s.

    Raises:
        NoFitError: no oriented camera has a frame.
    """
    frames, nothing = log.frames(pulse), log.unmeasured
    views = [
        SkiView(
            system[name].shifted(background.shift(frames[name])),
            partial(background.part, frames[name]),
            nothing.late_s(name) * velocity,
        )
        for name, background in log.backgrounds().items()
        if name in frames and name in system.names
    ]
    if not views:
        raise NoFitError(phrase("hand_no_frames", "pulse {pulse}: no oriented camera has a frame", pulse=pulse))
    return views


def ski_start(
    log: OpenedLog, system: CameraSystem, marks: Mapping[Key, Entered], pulse: int, known: Mapping[str, KnownMotion]
) -> SkiStart:
    """The skis at a pulse, from the marks that stand there.

    Args:
        log: the log.
        system: the oriented cameras.
        marks: at the pulse.
        pulse: its number.
        known: of the motion of bindings and other points, by name.
    """
    measured = effective_pulse(pulse, log.times[pulse], marks, None)
    skis = skis_of(system, [measured])
    lines = adjust(skis, system.covariance)
    bindings = intersected(system, {name: _rays(marks, name) for name in BINDINGS.values()})
    poses = Poses(np.zeros((SKIS, 3)), np.tile((1.0, 0.0, 0.0), (SKIS, 1)))
    covariance = np.eye(SKIS * OF_POSE)
    present, bound, motions = [False, False], [False, False], []
    refused: dict[str, Phrase] = {}
    anything = next(iter(known.values()), None)
    for k, (line, binding) in enumerate(BINDINGS.items()):
        motion = known.get(binding, anything)
        if not lines.ok[k]:
            refused[line] = phrase(
                "hand_ski_needs",
                "pulse {pulse}: a ski needs two points in each of two images that show it well",
                pulse=pulse,
            )
            motions.append(motion or KnownMotion(np.zeros(3), _SPEED_SIGMA))
            continue
        direction = _forward(lines.state[k, 3:], motion)
        motions.append(motion or KnownMotion(_SPEED * direction, _SPEED_SIGMA))
        bound[k] = bool(bindings.adjusted.ok[k])
        origin = lines.state[k, :3]
        place, sigma = _binding(system, measured, line, k, origin, direction, bindings, bound[k])
        foot = origin + direction * ((place - origin) @ direction)
        poses.point[k], poses.direction[k] = foot, direction
        aside, normal = (axis[k] for axis in poses.axes())
        own = slice(OF_POSE * k, OF_POSE * (k + 1))
        covariance[own, own] = _of_pose(
            lines.state[k], lines.image_covariance[k], foot, direction, (aside, normal), sigma
        )
        present[k] = True
    expected = ExpectedBars(poses, covariance, np.tile(USUAL_SHAPE, (SKIS, 1)), np.tile(USUAL_SHAPE_SIGMA, (SKIS, 1)))
    return SkiStart(expected, (present[0], present[1]), (bound[0], bound[1]), motions, refused)


def _forward(direction: Floats, motion: KnownMotion | None) -> Floats:
    """A direction from tail to tip: the way that the jumper goes, which is X if nothing else is known."""
    way = np.array((1.0, 0.0, 0.0)) if motion is None else motion.velocity
    return np.asarray(direction if direction @ way > 0 else -direction)


def _binding(
    system: CameraSystem, measured: PulseMeasurements, line: str, k: int, origin: Floats,
    direction: Floats, bindings: PointsInSpace, bound: bool,
) -> tuple[Floats, float]:  # fmt: skip
    """Where the binding is, and its standard deviation along the ski, m."""
    if bound:
        spread = bindings.adjusted.image_covariance[k]
        return bindings.adjusted.state[k], float(np.sqrt(direction @ spread @ direction))
    levers = []
    for name, image in measured.images.items():
        if name in system.names and LINES[line] in image.skis:
            camera = system[name]
            for ray in rays(camera, image.skis[LINES[line]].xy[None])[0]:
                away, cosine = origin - camera.position, float(direction @ ray)
                levers.append((cosine * (ray @ away) - direction @ away) / (1 - cosine**2))
    return origin + direction * (min(levers) + max(levers)) / 2, _MIDDLE_M


def _of_pose(
    state: Floats, covariance: Floats, foot: Floats, direction: Floats, axes: tuple[Floats, Floats], along: float
) -> Floats:
    """Covariance (5, 5) of a pose from that of a line (4, 4), of what a person marks, and along the ski."""
    one, other = (axis[0] for axis in across_axes(state[None, 3:]))
    lever = float((foot - state[:3]) @ state[3:])
    turn = 1.0 if direction @ state[3:] > 0 else -1.0
    rows = np.zeros((OF_POSE, 4))
    rows[:3, 0], rows[:3, 1], rows[:3, 2], rows[:3, 3] = one, other, lever * one, lever * other
    for i, axis in enumerate(axes):
        rows[3 + i, 2:] = turn * (one @ axis), turn * (other @ axis)
    whole = np.asarray(rows @ covariance @ rows.T)
    whole[:3, :3] += along**2 * np.outer(direction, direction)
    whole[:3, :3] += _BESIDE_M**2 * (np.eye(3) - np.outer(direction, direction))
    whole[3:, 3:] += _TURNED**2 * np.eye(2)
    return whole


def _rays(marks: Mapping[Key, Entered], thing: str) -> dict[str, Ray]:
    return {
        key.camera: Ray(np.array(entered.xy), covariance_of(entered))
        for key, entered in marks.items()
        if key.thing == thing and entered.xy is not None and entered.state is MarkState.MEASURED
    }
