"""Puts together what a page shows of one pulse: marks, the automatic measurement, and what follows in space."""

from collections.abc import Mapping
from typing import Final

import numpy as np

from analysis.digitizing.geometry.pulse_marks import PulseMarks
from analysis.digitizing.geometry.solved import Solved
from analysis.digitizing.geometry.space import (
    PointsInSpace,
    Stick,
    inside,
    predicted,
    predicted_points,
    space_points,
    stick,
)
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.session import Session
from analysis.digitizing.marks.things import BALL, LINES
from analysis.digitizing.marks.two_points import as_two_points
from analysis.measurements.model import POINTS, PulseMeasurements
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import (
    AutomaticLine,
    AutomaticPoint,
    LineMarks,
    Mark,
    PredictedPoint,
    PulseView,
)
from rig.clocks import NS_PER_S

#: Standard deviation of a point's acceleration beside that of free fall, m/s^2: a jumper who rises or lands has 20.
_ACCELERATION: Final = 20.0


def pulse_view(
    revision: int, now: PulseMarks, before: tuple[PulseMarks, ...], system: CameraSystem | None,
    balls: Mapping[str, Mapping[str, PredictedPoint]], solved: Solved,
) -> PulseView:  # fmt: skip
    """The view of a pulse.

    Args:
        revision: of the session.
        now: the pulse.
        before: the pulse before it and the one before that, as far as there are any.
        system: the oriented cameras; None: none are.
        balls: where the surveyed balls should be, by camera and thing.
        solved: what was computed before.
    """
    marks = _marks(now)
    found, sticks = None, Stick({}, {})
    guessed: dict[str, dict[str, PredictedPoint]] = {}
    if system is not None:
        points = solved.points(system, now)
        found, earlier = points.found, [solved.points(system, each).found for each in before]
        sticks = stick(system, now.pulse, found.some(range(len(POINTS))), points.good, solved.skis(system, now))
        found = found.some([i for i in range(len(found.names)) if found.points.seen[i].any()])
        guessed = predicted_points(system, found)
        for source in (_by_time(system, now, before, found, earlier), balls):
            for camera, places in source.items():
                own = marks.get(camera, {})
                there = guessed.setdefault(camera, {})
                there.update({name: place for name, place in places.items() if name not in there and name not in own})
    return PulseView(
        revision=revision,
        pulse=now.pulse,
        marks=marks,
        automatic=_automatic(now.automatic),
        space={} if found is None or system is None else space_points(system, found),
        lines=sticks.lines,
        predicted={camera: points for camera, points in guessed.items() if points},
        previous=_places(before[0].marks) if before else {},
        figures=sticks.figures,
    )


def figures_of(now: PulseMarks, system: CameraSystem, solved: Solved) -> dict[str, float]:
    """Angles and height of a pulse without their sigmas, as `pulse_view` gives them."""
    return {name: estimate.value for name, estimate in pulse_view(0, now, (), system, {}, solved).figures.items()}


def balls_of(session: Session) -> dict[str, dict[str, Mark]]:
    """The balls that were marked, by camera and thing, at whatever pulse."""
    balls: dict[str, dict[str, Mark]] = {}
    for thing, cameras in session.coverage().items():
        if thing.startswith(BALL):
            for camera, pulses in cameras.items():
                for pulse in pulses:
                    key = Key(pulse, camera, thing)
                    balls.setdefault(camera, {})[thing] = _as_mark(key, session.at(pulse)[key])
    return balls


def _by_time(
    system: CameraSystem,
    now: PulseMarks,
    before: tuple[PulseMarks, ...],
    found: PointsInSpace,
    earlier: list[PointsInSpace],
) -> dict[str, dict[str, PredictedPoint]]:
    """Where points should be that two rays do not give now but gave in the two pulses before: constant velocity."""
    if len(before) < 2:
        return {}
    given = {name for i, name in enumerate(found.names) if found.adjusted.ok[i]}
    last, older = earlier
    places = {name: i for i, name in enumerate(older.names) if older.adjusted.ok[i]}
    step = (now.time - before[0].time) / NS_PER_S
    ratio = step * NS_PER_S / max(before[0].time - before[1].time, 1)
    result: dict[str, dict[str, PredictedPoint]] = {}
    for i, name in enumerate(last.names):
        if name in given or name not in places or not last.adjusted.ok[i]:
            continue
        j = places[name]
        xyz = last.adjusted.state[i] + ratio * (last.adjusted.state[i] - older.adjusted.state[j])
        covariance = (
            (1 + ratio) ** 2 * last.adjusted.image_covariance[i]
            + ratio**2 * older.adjusted.image_covariance[j]
            + (_ACCELERATION * step**2) ** 2 * np.eye(3)
        )
        for camera in system.cameras.values():
            px = camera.project(xyz)
            if inside(px, camera.size):
                _, by_point, _ = camera.linearised(xyz[None], px[None])
                ellipse = predicted(px, by_point[0] @ covariance @ by_point[0].T, "time")
                result.setdefault(camera.name, {})[name] = ellipse
    return result


def _marks(now: PulseMarks) -> dict[str, dict[str, Mark | LineMarks]]:
    result: dict[str, dict[str, Mark | LineMarks]] = {}
    lines: dict[tuple[str, str], list[Mark]] = {}
    for key, entered in sorted(now.marks.items()):
        mark = _as_mark(key, entered)
        if key.thing in LINES:
            lines.setdefault((key.camera, key.thing), []).append(mark)
        else:
            result.setdefault(key.camera, {})[key.thing] = mark
    for (camera, thing), vertices in lines.items():
        placed = [mark for mark in vertices if mark.xy is not None]
        result.setdefault(camera, {})[thing] = LineMarks(state=vertices[0].state, vertices=placed)
    return result


def _as_mark(key: Key, entered: Entered) -> Mark:
    """A mark for a page."""
    return Mark(
        pulse=key.pulse,
        camera=key.camera,
        thing=key.thing,
        vertex=None if key.vertex < 0 else key.vertex,
        state=entered.state,
        xy=entered.xy,
        sigma=entered.sigma,
        source=entered.source,
    )


def _automatic(pulse: PulseMeasurements | None) -> dict[str, dict[str, AutomaticPoint | AutomaticLine]]:
    result: dict[str, dict[str, AutomaticPoint | AutomaticLine]] = {}
    for camera, image in ({} if pulse is None else pulse.images).items():
        there: dict[str, AutomaticPoint | AutomaticLine] = {}
        for name in POINTS:
            if (point := image.points.get(name)) is not None:
                sx, sy = np.sqrt(np.diagonal(point.covariance)).tolist()
                there[name] = AutomaticPoint(xy=(float(point.xy[0]), float(point.xy[1])), sigma=(sx, sy))
        for name, side in LINES.items():
            if (ski := image.skis.get(side)) is not None:
                two, across = as_two_points(ski.xy, ski.sigma, ski.common)
                first, last = ((float(x), float(y)) for x, y in two)
                every = [(float(x), float(y)) for x, y in ski.xy]
                there[name] = AutomaticLine(xy=every, vertices=(first, last), across=across)
        if there:
            result[camera] = there
    return result


def _places(marks: Mapping[Key, Entered]) -> dict[str, dict[str, list[tuple[float, float]]]]:
    result: dict[str, dict[str, list[tuple[float, float]]]] = {}
    for key, entered in sorted(marks.items()):
        if entered.xy is not None:
            result.setdefault(key.camera, {}).setdefault(key.thing, []).append(entered.xy)
    return result
