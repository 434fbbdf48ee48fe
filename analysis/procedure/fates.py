"""Says of each point and ski in each pulse of a jump what became of it."""

from collections.abc import Collection, Mapping, Sequence
from typing import Final

from analysis.measurements.model import POINTS, SIDES, JumpMeasurements, PulseMeasurements
from analysis.pulses.least_squares import Condition
from analysis.pulses.solution import RawJump
from analysis.result.fates import Fate, ImageFate, PartFate
from analysis.result.model import JumperState, RayTest, SmoothedState
from analysis.scene.camera_system import CameraSystem
from rig.pulse import PulseNumber

_BINDINGS: Final = {"right": "P3", "left": "P4"}  # a ski is in sight where its binding is
_REFUSED: Final = {
    Condition.UNDETERMINED: Fate.UNDETERMINED,
    Condition.IMPOSSIBLE: Fate.DISAGREE,
    Condition.UNCONTROLLED: Fate.MOTION,
}


def fates_of(
    jump: JumpMeasurements,
    raw: RawJump,
    smoothed: Sequence[SmoothedState | None],
    removed: Collection[RayTest],
    uncertain: Collection[str],
    system: CameraSystem,
) -> list[dict[str, PartFate]]:
    """What became of points and skis, pulse by pulse.

    Args:
        jump: everything that was measured in its images.
        raw: its raw solution.
        smoothed: its states from the model over time, whose places say what is in sight.
        removed: what the model over time left out as gross errors.
        uncertain: points and skis that were measured, but not given, as their names are uncertain.
        system: the oriented cameras.
    """
    left_out = {(test.pulse, test.camera, test.what) for test in removed}
    return [
        {
            what: _fate(what, pulse, _solved(state, what), conditions[what], model, left_out, uncertain, system)
            for what in (*POINTS, *SIDES)
        }
        for pulse, state, conditions, model in zip(jump.pulses, raw.states, raw.conditions, smoothed, strict=True)
    ]


def _solved(state: JumperState, what: str) -> Collection[str]:
    """The cameras of a raw solution; none where there is no solution."""
    part = state.points.get(what) or state.skis.get(what)
    return () if part is None else part.cameras


def _fate(
    what: str,
    pulse: PulseMeasurements,
    used: Collection[str],
    condition: Condition,
    smoothed: SmoothedState | None,
    left_out: Collection[tuple[PulseNumber, str, str]],
    uncertain: Collection[str],
    system: CameraSystem,
) -> PartFate:
    place = None if smoothed is None else smoothed.points.get(_BINDINGS.get(what, what))
    images: dict[str, ImageFate] = {}
    for name, camera in system.cameras.items():
        if name in used:
            images[name] = ImageFate.RAW_ONLY if (pulse.pulse, name, what) in left_out else ImageFate.USED
        elif name not in pulse.images:
            images[name] = ImageFate.NO_FRAME
        elif what in pulse.images[name].points or what in pulse.images[name].skis:
            images[name] = ImageFate.GROSS_ERROR if used else ImageFate.NOT_USED
        else:
            shown = place is None or bool(camera.shows(place.xyz))
            images[name] = ImageFate.NOT_FOUND if shown else ImageFate.OUT_OF_SIGHT
    return PartFate(_of_part(what, used, condition, images, uncertain), images)


def _of_part(
    what: str,
    used: Collection[str],
    condition: Condition,
    images: Mapping[str, ImageFate],
    uncertain: Collection[str],
) -> Fate:
    if used:
        return Fate.USED
    fates = list(images.values())
    if what in uncertain and ImageFate.NOT_USED in fates:
        return Fate.NAME
    if condition in _REFUSED:
        return _REFUSED[condition]
    if fates.count(ImageFate.NOT_USED) > 1:
        return Fate.UNDETERMINED  # what was measured of a ski is too short
    within = sum(fate in (ImageFate.NOT_USED, ImageFate.NOT_FOUND) for fate in fates)
    return Fate.NOT_FOUND if within > 1 else Fate.OUT_OF_SIGHT
