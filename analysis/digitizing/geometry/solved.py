"""What was computed of pulses is kept for as long as the marks that it came from stand.

A click changes a point or a ski of one pulse: all else that its view shows is what it was, and so it is after undo.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from analysis.digitizing.geometry.pulse_marks import MarksPart, PulseMarks
from analysis.digitizing.geometry.space import (
    PointsInSpace,
    Ray,
    SkisInSpace,
    checked_points,
    intersected,
    intersected_skis,
)
from analysis.digitizing.marks.things import LANDMARK, LINES
from analysis.measurements.model import POINTS
from analysis.pulses.gross_errors import Checked
from analysis.scene.camera_system import CameraSystem

#: So many pulses are kept: those of a jump.
_KEPT: Final = 400


@dataclass(frozen=True, slots=True, eq=False)
class SolvedPoints:
    """The points of a pulse.

    Attributes:
        found: P1 to P4 first, whether they are marked or not.
        good: P1 to P4 from the images that are in order.
    """

    found: PointsInSpace
    good: Checked


class Solved:
    """Points and skis of pulses in space. Any thread may call any method."""

    def __init__(self) -> None:
        self._points = lru_cache(_KEPT)(_solved_points)
        self._skis = lru_cache(_KEPT)(_solved_skis)

    def points(self, system: CameraSystem, now: PulseMarks) -> SolvedPoints:
        """The points of a pulse."""
        return self._points(system, now.part(lambda thing: thing in POINTS or thing.startswith(LANDMARK)))

    def skis(self, system: CameraSystem, now: PulseMarks) -> SkisInSpace:
        """The skis of a pulse."""
        return self._skis(system, now.part(LINES.__contains__))


def _solved_points(system: CameraSystem, part: MarksPart) -> SolvedPoints:
    nothing: dict[str, dict[str, Ray]] = {name: {} for name in POINTS}
    found = intersected(system, nothing | part.whole().rays())
    return SolvedPoints(found, checked_points(system, found.some(range(len(POINTS)))))


def _solved_skis(system: CameraSystem, part: MarksPart) -> SkisInSpace:
    return intersected_skis(system, part.whole().effective())
