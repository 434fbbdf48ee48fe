"""Says whether a measured jump can be trusted, in words for people, with the figures by phase that it rests on."""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
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
from rig.arrays import Floats
from rig.phrase import NOTHING, Phrase, phrase
from rig.phrases import enumerated, in_turn

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
_POINTS_LEAST, _FITTING_SHARE = 20, 0.25
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
    troubles: Iterable[Phrase] = (),
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
        troubles: what else speaks against the jump.
        scale: by what factors the sigmas of points and skis in the images were too small; they were enlarged.
        cameras: all of the recording, those that are not oriented among them.
    """
    found = [*troubles]
    delivered = [(pulse, there) for pulse, there in zip(pulses, frames, strict=True) if in_sight(pulse, system)]
    seen = [pulse for pulse, _ in delivered]
    phases = {phase: figures([pulse for pulse in seen if pulse.phase is phase]) for phase in Phase}
    found += [offset.said for offset in synchrony.values() if offset.said is not None]
    found += [move.said for move in moved]
    if takeoff is None:
        text = (
            "the take-off was not found, so times are counted from the first pulse: two cameras must see the edge of "
            "the table, and him some metres before it"
        )
        found.append(phrase("jump_no_takeoff", text))
    unexplained = [name for name in system.names if name not in synchrony or synchrony[name].said is None]
    found += _contradicting(delivered, {name: system[name] for name in unexplained}, tests)
    everything = figures(seen)
    # Without a take-off nobody knows which pulses are in flight: all are judged together.
    flight = everything if takeoff is None else phases[Phase.FLIGHT]
    where = NOTHING if takeoff is None else phrase("jump_in_flight", " in flight")
    found += _never_found(seen, found)
    found += _too_few(flight, "points", phrase("jump_all_points", "all points"), where)
    found += _too_few(flight, "skis", phrase("jump_both_skis", "both skis"), where)
    if everything["points_controlled"] < _CONTROLLED * len(seen):
        text = (
            "only in {count} of {pulses} pulses in sight do three cameras or more see each point: elsewhere nothing "
            "controls what two see"
        )
        count = everything["points_controlled"]
        found.append(phrase("jump_uncontrolled", text, count=count, pulses=len(seen)))
    around = [] if takeoff is None else [(phases[Phase.EDGE], phrase("jump_around_edge", " around the edge"))]
    for of_phase, there in (*around, (flight, where)):
        coarse, count = of_phase["coarse"], of_phase["pulses"]
        if coarse > _COARSE * count:
            text = "in {coarse} of {pulses} pulses{where} a point is uncertain by more than {limit} m"
            found.append(phrase("jump_coarse", text, coarse=coarse, pulses=count, where=there, limit=REQUIRED_SIGMA_M))
    removed = sum(test.removed for test in tests)
    if tests and removed > _MANY_REMOVED * len(tests):
        text = "{removed} of {rays} rays were taken out as gross errors; see the protocol"
        found.append(phrase("jump_gross_errors", text, removed=removed, rays=len(tests)))
    if not seen:
        found.append(phrase("jump_never_in_sight", "the jumper is never in sight of two cameras"))
    counted = [_counted(everything, len(seen)), *_noted(pulses, scale or {})]
    unused = _unused(cameras, system, delivered)
    if found:
        message, said = f"{in_turn((*unused, *found))} ({in_turn(counted)})", (*unused, *found, *counted)
    else:
        said = (*counted, *unused)
        message = f"measured well: {in_turn(said)}"
    return Verdict(not found, message, phases, said)


def _counted(everything: Mapping[str, Any], seen: int) -> Phrase:
    """In how many pulses all points were measured, and controlled."""
    count, controlled = everything["points"], everything["points_controlled"]
    text = "all points in {count} of {pulses} pulses in sight"
    if not controlled:
        return phrase("jump_counted", text, count=count, pulses=seen)
    text = "all points in {count} of {pulses} pulses in sight, controlled by a third camera in {controlled}"
    return phrase("jump_counted_controlled", text, count=count, pulses=seen, controlled=controlled)


def _noted(pulses: Sequence[PulseState], scale: Mapping[str, float]) -> Iterator[Phrase]:
    """What whoever uses the figures should know, and what does not speak against them."""
    contradicted = told(pulses)
    if contradicted is not None:
        yield contradicted
    enlarged = []
    if (factor := scale.get("points", 1.0)) > _ENLARGED:
        enlarged.append(phrase("jump_enlarged_points", "points {factor:.1f} times", factor=float(factor)))
    if (factor := scale.get("skis", 1.0)) > _ENLARGED:
        enlarged.append(phrase("jump_enlarged_skis", "skis {factor:.1f} times", factor=float(factor)))
    if enlarged:
        text = "sigmas in the images were too small and are enlarged: {what}"
        yield phrase("jump_enlarged", text, what=enumerated(enlarged))


def figures(pulses: Sequence[PulseState]) -> dict[str, Any]:
    """The figures of some pulses, ready for JSON.

    `points` counts pulses with all points measured, `points_controlled` those with each of them seen by three cameras
    or more, `skis` those with both skis measured, `solved` those with all of it; `controlled` those of the last with
    each seen by three cameras or more. `median_sigma_m` is that of the coordinates of all smoothed points (raw ones
    where there are none), `coarse` the number of pulses in which one is larger than 0.02 m.
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
    seen = sum(placed.shows(places).astype(int) for placed in system.cameras.values())
    return bool((np.asarray(seen) >= _CAMERAS).all())


def _contradicting(
    delivered: Sequence[tuple[PulseState, Collection[str]]],
    cameras: Mapping[str, PlacedCamera],
    tests: Sequence[RayTest],
) -> list[Phrase]:
    """A sentence for each camera that has the jumper in its image and hardly any point where the others see it.

    Args:
        delivered: pulses with the cameras that delivered a frame: one that was gone contradicts nobody.
        cameras: by name.
        tests: of all rays.
    """
    used = Counter(test.camera for test in tests if not test.removed and test.what in POINTS)
    lines = []
    for name, placed in cameras.items():
        places = [_places(pulse) for pulse, frames in delivered if name in frames]
        there = sum(int(placed.shows(of_pulse).sum()) for of_pulse in places if len(of_pulse))
        if there >= _POINTS_LEAST and used[name] < _FITTING_SHARE * there:
            text = (
                "camera {camera} has the jumper's points in its images {there} times, and only {used} times where the "
                "other cameras see them: check its trigger, and whether it was moved"
            )
            lines.append(phrase("jump_contradicting", text, camera=name, there=there, used=used[name]))
    return lines


def _never_found(seen: Sequence[PulseState], said: Sequence[Phrase]) -> list[Phrase]:
    """A sentence on points that no pulse shows, while it shows others, and of which nothing is said yet."""
    spoken = " ".join(map(str, said))
    never = [name for name in POINTS if all(pulse.raw.points[name] is None for pulse in seen)]
    unspoken = [name for name in never if name not in spoken]
    if not unspoken or len(never) == len(POINTS):
        return []
    text = "no pulse shows {points}: its marker is not worn, always covered, or hardly differs from what is around it"
    return [phrase("jump_never_found", text, points=", ".join(unspoken))]


def _places(pulse: PulseState) -> Floats:
    """(n, 3) the points of a pulse, measured or predicted."""
    state = pulse.smoothed or pulse.raw
    return np.array([point.xyz for point in state.points.values() if point is not None]).reshape(-1, 3)


def _too_few(of_phase: Mapping[str, Any], what: str, words: Phrase, where: Phrase) -> list[Phrase]:
    """A sentence if too few pulses of a phase show something."""
    count, pulses = of_phase[what], of_phase["pulses"]
    if count >= _MEASURED * pulses:
        return []
    text = "only {count} of {pulses} pulses show {what}{where}"
    return [phrase("jump_too_few", text, count=count, pulses=pulses, what=words, where=where)]


def _controlled(parts: Mapping[str, PointState | None] | Mapping[str, SkiState | None]) -> bool:
    """Whether three cameras or more saw each of the points, or skis, that were measured."""
    return all(len(part.cameras) > _CAMERAS for part in parts.values() if part is not None)


def _unused(
    cameras: Iterable[str], system: CameraSystem, delivered: Sequence[tuple[PulseState, Collection[str]]]
) -> list[Phrase]:
    """A sentence for each camera that has no part in the jump.

    Args:
        cameras: all of the recording.
        system: those that are oriented.
        delivered: pulses in sight with the cameras that delivered a frame.
    """
    out = "camera {camera} is left out: it has no frames in this recording, or is not oriented; see the protocol"
    gone = "camera {camera} has no frame of this jump"
    there = {name for _, frames in delivered for name in frames}
    return [
        *(phrase("jump_left_out", out, camera=name) for name in cameras if name not in system.cameras),
        *(phrase("jump_no_frame", gone, camera=name) for name in system.names if delivered and name not in there),
    ]
