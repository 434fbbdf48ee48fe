"""The kinogram of one jump, with everything that page, picture and file show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from analysis.measurements.model import JumpMeasurements
from analysis.report.course import course_of
from analysis.report.kinogram.earlier import EarlierJump
from analysis.report.kinogram.figures import Mark, Reference, figures_of, marks_of, reference_of
from analysis.report.kinogram.shots import Shot, shots_of
from analysis.result.model import Jump, Quantity
from analysis.scene.camera_system import CameraSystem
from rig.clocks import NS_PER_S


@dataclass(frozen=True, slots=True, eq=False)
class Kinogram:
    """The kinogram of one jump.

    Attributes:
        jump: the jump.
        time: take-off, or first pulse where that was not found, UTC.
        shots: the five pictures.
        figures: by name; None where not measured.
        marks: by name, of those figures that can be compared; none of a jump that cannot be trusted.
        reference: the earlier jumps that it is compared with.
    """

    jump: Jump
    time: datetime
    shots: Sequence[Shot]
    figures: Mapping[str, Quantity | None]
    marks: Mapping[str, Mark]
    reference: Reference


def kinogram_of(
    jump: Jump,
    rate_hz: float,
    measured: JumpMeasurements | None,
    system: CameraSystem,
    log: Path,
    *,
    perpendicular: Quantity | None = None,
    earlier: Sequence[EarlierJump] = (),
) -> Kinogram:
    """Make the kinogram of a jump.

    Args:
        jump: the jump.
        rate_hz: pulses per second.
        measured: what was measured in its images.
        system: the oriented cameras.
        log: where the images are.
        perpendicular: velocity perpendicular to the table at the take-off, m/s.
        earlier: jumps of the same athlete.

    Raises:
        BadInputError: the log cannot be read.
    """
    course = course_of(jump, rate_hz)
    figures = figures_of(course, perpendicular)
    time = datetime.fromtimestamp((jump.pulses[0].time if jump.takeoff is None else jump.takeoff.time) / NS_PER_S, UTC)
    reference = reference_of(earlier, time)
    marks = marks_of(figures, reference) if jump.verdict.ok else {}
    return Kinogram(jump, time, shots_of(course, measured, system, log), figures, marks, reference)


def to_json(kinogram: Kinogram) -> dict[str, Any]:
    """The jump as it stands in `kinogram.json`."""
    return {
        "number": kinogram.jump.number,
        "time": kinogram.time.isoformat(),
        "ok": kinogram.jump.verdict.ok,
        "figures": {
            name: None if quantity is None else {"value": quantity.value, "sigma": quantity.sigma}
            for name, quantity in kinogram.figures.items()
        },
        "marks": {
            name: {"word": mark.word.value, "difference": mark.difference, "mean": mark.mean, "jumps": mark.jumps}
            for name, mark in kinogram.marks.items()
        },
        "places": [
            {
                "place_m": shot.place_m,
                "missing": None if shot.missing is None else shot.missing.value,
                "pulse": None if shot.moment is None else shot.moment.pulse,
                "distance_m": None if shot.moment is None else shot.moment.distance_m,
                "camera": shot.camera,
            }
            for shot in kinogram.shots
        ],
    }
