"""Says of each point and ski in each pulse of a jump what became of it."""

from collections.abc import Collection, Mapping, Sequence
from typing import Final

from analysis.measurements.model import BINDING_OF, POINTS, SIDES, JumpMeasurements, PulseMeasurements
from analysis.motion.smoother import Motion
from analysis.pulses.least_squares import Condition
from analysis.result.fates import Fate, ImageFate, PartFate
from analysis.result.model import JumperState, SmoothedState
from analysis.scene.camera_system import CameraSystem
from rig.pulse import PulseNumber

_REFUSED: Final = {
    Condition.UNDETERMINED: Fate.UNDETERMINED,
    Condition.IMPOSSIBLE: Fate.DISAGREE,
    Condition.UNCONTROLLED: Fate.MOTION,
}


def fates_of(
    jump: JumpMeasurements,
    raw: Sequence[JumperState],
    conditions: Sequence[Mapping[str, Condition]],
    motion: Motion,
    system: CameraSystem,
) -> list[dict[str, PartFate]]:
    """What became of points and skis, pulse by pulse.

    Args:
        jump: everything that was measured in its images.
        raw: its raw states.
        conditions: of points and skis in the adjustment of each pulse; one that is in order and has no raw state is
            not given, as its name is uncertain.
        motion: the model over time: its left-out measurements, and places that say what is in sight.
        system: the oriented cameras.
    """
    left_out = {(test.pulse, test.camera, test.what) for test in motion.removed}
    return [
        {
            what: _fate(what, pulse, _solved(state, what), of_pulse[what], smoothed, left_out, system)
            for what in (*POINTS, *SIDES)
        }
        for pulse, state, of_pulse, smoothed in zip(jump.pulses, raw, conditions, motion.states, strict=True)
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
    system: CameraSystem,
) -> PartFate:
    # A ski is in sight where its binding is.
    place = None if smoothed is None else smoothed.points.get(BINDING_OF.get(what, what))
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
    return PartFate(_of_part(used, condition, images), images)


def _of_part(used: Collection[str], condition: Condition, images: Mapping[str, ImageFate]) -> Fate:
    if used:
        return Fate.USED
    if condition is Condition.OK:
        return Fate.NAME
    if condition in _REFUSED:
        return _REFUSED[condition]
    fates = list(images.values())
    if fates.count(ImageFate.NOT_USED) > 1:
        return Fate.UNDETERMINED  # what was measured of a ski is too short
    within = sum(fate in (ImageFate.NOT_USED, ImageFate.NOT_FOUND) for fate in fates)
    return Fate.NOT_FOUND if within > 1 else Fate.OUT_OF_SIGHT
