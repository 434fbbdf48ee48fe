"""Says whether a measured jump can be trusted, in words for people, with the figures by phase that it rests on."""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from analysis.measurements.model import POINTS
from analysis.procedure.contradictions import told
from analysis.result.model import (
    CameraMove,
    CameraOffset,
    JumperState,
    Phase,
    PointState,
    PulseState,
    RayTest,
    SkiState,
    SmoothedState,
    TakeOff,
    Verdict,
)
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from rig.arrays import Flags, Floats

#: Share of the pulses in flight in which all points, and both skis, must be measured.
_MEASURED: Final = 0.5
#: Share of the pulses in sight in which a third camera must control all points.
_CONTROLLED: Final = 0.8
#: Share of the pulses at the edge and in flight in which a point may be less accurate than required.
_COARSE: Final = 0.25
#: More gross errors among the rays than this say that something is wrong with the whole recording.
_MANY_REMOVED: Final = 0.1
#: The paper's requirement for coordinates, m (0.2 dm).
REQUIRED_SIGMA_M: Final = 0.02
#: A camera that has so many points of the jumper in its images must contribute this share of them.
_ENOUGH, _FITTING = 20, 0.25
#: Sigmas in the images that had to be enlarged by more than this are mentioned.
_ENLARGED: Final = 1.2
#: Fewest cameras that must have a point in their image for the pulse to count as in sight.
_CAMERAS: Final = 2


def judge(
    pulses: Sequence[PulseState],
    frames: Sequence[Collection[str]],
    system: CameraSystem,
    takeoff: TakeOff | None,
    tests: Sequence[RayTest],
    synchrony: Mapping[str, CameraOffset],
    moved: Iterable[CameraMove] = (),
    troubles: Iterable[str] = (),
    scale: Mapping[str, float] | None = None,
    cameras: Iterable[str] = (),
) -> Verdict:
    """The verdict on a jump.

    Args:
        pulses: of the jump.
        frames: for each pulse the cameras that delivered a frame.
        system: the oriented cameras.
        takeoff: None where it was not found.
        tests: of all rays.
        synchrony: by camera.
        moved: cameras that moved and whose pose was not corrected for it.
        troubles: what else speaks against the jump, one line each.
        scale: by what factors the sigmas of points and skis in the images were too small; they were enlarged.
        cameras: all of the recording, those that are not oriented among them.
    """
    found = [*troubles]
    delivered = [(pulse, there) for pulse, there in zip(pulses, frames, strict=True) if in_sight(pulse, system)]
    seen = [pulse for pulse, _ in delivered]
    phases = {phase: figures([pulse for pulse in seen if pulse.phase is phase]) for phase in Phase}
    found += [offset.message for offset in synchrony.values() if offset.message is not None]
    found += [move.message for move in moved]
    if takeoff is None:
        found.append("the take-off was not found, so times are counted from the first pulse")
    unexplained = [name for name in system.names if name not in synchrony or synchrony[name].message is None]
    found += _contradicting(delivered, {name: system[name] for name in unexplained}, tests)
    everything = figures(seen)
    # Without a take-off nobody knows which pulses are in flight: all are judged together.
    flight, where = (everything, "") if takeoff is None else (phases[Phase.FLIGHT], " in flight")
    found += _too_few(flight, "points", f"all points{where}")
    found += _too_few(flight, "skis", f"both skis{where}")
    if everything["points_controlled"] < _CONTROLLED * len(seen):
        found.append(
            f"only in {everything['points_controlled']} of {len(seen)} pulses in sight do three cameras or more see "
            "each point: elsewhere nothing controls what two see"
        )
    around = [] if takeoff is None else [(phases[Phase.EDGE], " around the edge")]
    for of_phase, words in (*around, (flight, where)):
        coarse, count = of_phase["coarse"], of_phase["pulses"]
        if coarse > _COARSE * count:
            found.append(f"in {coarse} of {count} pulses{words} a point is uncertain by more than {REQUIRED_SIGMA_M} m")
    removed = sum(test.removed for test in tests)
    if tests and removed > _MANY_REMOVED * len(tests):
        found.append(f"{removed} of {len(tests)} rays were taken out as gross errors; see the protocol")
    if not seen:
        found.append("the jumper is never in sight of two cameras")
    counted = f"all points in {everything['points']} of {len(seen)} pulses in sight"
    if everything["points_controlled"]:
        counted += f", controlled by a third camera in {everything['points_controlled']}"
    contradicted = told(pulses)
    if contradicted is not None:
        counted += f"; {contradicted}"
    enlarged = [f"{what} {factor:.1f} times" for what, factor in (scale or {}).items() if factor > _ENLARGED]
    if enlarged:
        counted += f"; sigmas in the images were too small and are enlarged: {', '.join(enlarged)}"
    unused = _unused(cameras, system, delivered)
    if found:
        message = f"{'; '.join((*unused, *found))} ({counted})"
    else:
        message = "; ".join((f"measured well: {counted}", *unused))
    return Verdict(not found, message, phases)


def figures(pulses: Sequence[PulseState]) -> dict[str, Any]:
    """The figures of some pulses, ready for JSON.

    `points` counts pulses in which all points were measured, `points_controlled` those in which three cameras or more
    saw each of them, `skis` those in which both skis were measured, `solved` those in which all of it was;
    `controlled` those of the last in which each was seen by three cameras or more.
    `median_sigma_m` is that of the coordinates of all smoothed points (raw ones where there are none), `coarse` the
    number of pulses in which one is larger than 0.02 m.
    """
    states: list[JumperState | SmoothedState] = [pulse.smoothed or pulse.raw for pulse in pulses]
    sigmas = [
        [np.sqrt(np.diagonal(point.covariance)) for point in state.points.values() if point is not None]
        for state in states
    ]
    everything = [value for of_pulse in sigmas for sigma in of_pulse for value in sigma.tolist()]
    points = [all(point is not None for point in pulse.raw.points.values()) for pulse in pulses]
    skis = [all(ski is not None for ski in pulse.raw.skis.values()) for pulse in pulses]
    both = [one and other for one, other in zip(points, skis, strict=True)]
    controlled = [whole and _controlled(pulse.raw.points) for whole, pulse in zip(points, pulses, strict=True)]
    return {
        "pulses": len(pulses),
        "points": sum(points),
        "points_controlled": sum(controlled),
        "skis": sum(skis),
        "solved": sum(both),
        "controlled": sum(
            solved and sure and _controlled(pulse.raw.skis)
            for solved, sure, pulse in zip(both, controlled, pulses, strict=True)
        ),
        "median_sigma_m": float(np.median(everything)) if everything else None,
        "coarse": sum(any((sigma > REQUIRED_SIGMA_M).any() for sigma in of_pulse) for of_pulse in sigmas),
    }


def in_sight(pulse: PulseState, system: CameraSystem) -> bool:
    """Whether all points, measured or predicted, lie within the images of two cameras, as far as they are known."""
    places = _places(pulse)
    if not len(places):
        return True  # nothing is known: it counts as a pulse that was not solved
    seen = sum(_inside(placed, places).astype(int) for placed in system.cameras.values())
    return bool((np.asarray(seen) >= _CAMERAS).all())


def _contradicting(
    delivered: Sequence[tuple[PulseState, Collection[str]]],
    cameras: Mapping[str, PlacedCamera],
    tests: Sequence[RayTest],
) -> list[str]:
    """A line for each camera that has the jumper in its image and hardly any point where the others see it.

    Args:
        delivered: pulses with the cameras that delivered a frame: one that was gone contradicts nobody.
        cameras: by name.
        tests: of all rays.
    """
    used = Counter(test.camera for test in tests if not test.removed and test.what in POINTS)
    lines = []
    for name, placed in cameras.items():
        places = [_places(pulse) for pulse, frames in delivered if name in frames]
        there = sum(int(_inside(placed, of_pulse).sum()) for of_pulse in places if len(of_pulse))
        if there >= _ENOUGH and used[name] < _FITTING * there:
            lines.append(
                f"camera {name} has the jumper's points in its images {there} times, and only {used[name]} times where "
                "the other cameras see them: check its trigger, and whether it was moved"
            )
    return lines


def _places(pulse: PulseState) -> Floats:
    """(n, 3) the points of a pulse, measured or predicted."""
    state = pulse.smoothed or pulse.raw
    return np.array([point.xyz for point in state.points.values() if point is not None]).reshape(-1, 3)


def _inside(placed: PlacedCamera, places: Floats) -> Flags:
    """(n,) which points lie within a camera's image."""
    xy = placed.project(places)
    with np.errstate(invalid="ignore"):
        return np.asarray(((xy >= 0) & (xy <= placed.size - 1)).all(axis=1))


def _too_few(of_phase: Mapping[str, Any], what: str, words: str) -> list[str]:
    """A line if too few pulses of a phase show something."""
    if of_phase[what] >= _MEASURED * of_phase["pulses"]:
        return []
    return [f"only {of_phase[what]} of {of_phase['pulses']} pulses show {words}"]


def _controlled(parts: Mapping[str, PointState | None] | Mapping[str, SkiState | None]) -> bool:
    """Whether three cameras or more saw each of the points, or skis, that were measured."""
    return all(len(part.cameras) > _CAMERAS for part in parts.values() if part is not None)


def _unused(
    cameras: Iterable[str], system: CameraSystem, delivered: Sequence[tuple[PulseState, Collection[str]]]
) -> list[str]:
    """A line for each camera that has no part in the jump.

    Args:
        cameras: all of the recording.
        system: those that are oriented.
        delivered: pulses in sight with the cameras that delivered a frame.
    """
    lines = [
        f"camera {name} is left out: it has no frames in this recording, or is not oriented; see the protocol"
        for name in cameras
        if name not in system.cameras
    ]
    there = {name for _, frames in delivered for name in frames}
    return lines + [
        f"camera {name} has no frame of this jump" for name in system.names if delivered and name not in there
    ]
