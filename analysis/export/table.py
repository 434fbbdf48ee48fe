"""Writes all jumps of a recording as `jumper.csv`: one row a pulse, value and sigma in neighbouring columns.

The header names the units. Columns with the ending `_s` are from the model over time, the others from the pulse alone.
A cell is empty where nothing was measured.
"""

import csv
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import numpy as np

from analysis.measurements.model import POINTS, SIDES
from analysis.result.model import (
    JumperState,
    MeasuredRecording,
    PointState,
    PulseState,
    Quantity,
    SkiState,
    SmoothedState,
    Vector,
)
from photogrammetry.jumper.stick_model import ANGLES

Cell = str | int
#: Values with their column's name.
Cells = Iterator[tuple[str, Cell]]
_SMOOTHED: Final = "_s"


def write(result: MeasuredRecording, path: Path) -> None:
    """Write the table.

    Raises:
        OSError: the disk refuses.
    """
    rows = [{"jump": jump.number, **dict(pulse_cells(pulse))} for jump in result.jumps for pulse in jump.pulses]
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, ["jump", *(name for name, _ in pulse_cells(None))])
        table.writeheader()
        table.writerows(rows)


def pulse_cells(pulse: PulseState | None) -> Cells:
    """The cells of a pulse, with the names of their columns; without one, empty ones, for their names."""
    yield "pulse", "" if pulse is None else int(pulse.pulse)
    yield "time_utc_ns", "" if pulse is None else int(pulse.time)
    yield "since_takeoff_s", "" if pulse is None else _text(pulse.since_takeoff_s, 6)
    yield "phase", "" if pulse is None else str(pulse.phase)
    yield from _state(None if pulse is None else pulse.raw, "")
    smoothed = None if pulse is None else pulse.smoothed
    yield from _state(smoothed, _SMOOTHED)
    yield from _only_smoothed(smoothed)


def _state(state: JumperState | None, ending: str) -> Cells:
    for name in ANGLES:
        yield from _pair(f"{name}{ending}", "deg", None if state is None else state.angles.get(name))
    yield from _pair(f"height{ending}", "m", None if state is None else state.height)
    yield from _pair(f"speed{ending}", "m_per_s", None if state is None else state.speed)
    for name in POINTS:
        yield from _point(f"{name}{ending}", None if state is None else state.points.get(name))
    for side in SIDES:
        yield from _ski(f"{side}{ending}", None if state is None else state.skis.get(side))


def _only_smoothed(state: SmoothedState | None) -> Cells:
    yield from _pair(f"angle_of_attack{_SMOOTHED}", "deg", None if state is None else state.angle_of_attack)
    yield from _vector(f"O{_SMOOTHED}", "m", None if state is None else state.origin)
    yield from _vector(f"velocity{_SMOOTHED}", "m_per_s", None if state is None else state.velocity)


def _point(name: str, point: PointState | None) -> Cells:
    yield from _vector(name, "m", None if point is None else Vector(point.xyz, point.covariance))
    yield f"{name}_cameras", "" if point is None else " ".join(point.cameras)
    yield f"{name}_status", "" if point is None else str(point.status)


def _ski(name: str, ski: SkiState | None) -> Cells:
    yield from _pair(f"{name}_slope", "deg", None if ski is None else ski.slope)
    yield from _pair(f"{name}_heading", "deg", None if ski is None else ski.heading)
    yield f"{name}_cameras", "" if ski is None else " ".join(ski.cameras)
    yield f"{name}_status", "" if ski is None else str(ski.status)


def _vector(name: str, unit: str, vector: Vector | None) -> Cells:
    sigmas = np.full(3, np.nan) if vector is None else np.sqrt(np.diagonal(vector.covariance))
    for index, axis in enumerate("XYZ"):
        found = None if vector is None else Quantity(float(vector.value[index]), float(sigmas[index]))
        yield from _pair(f"{name}_{axis}", unit, found)


def _pair(name: str, unit: str, quantity: Quantity | None) -> Cells:
    yield f"{name}_{unit}", "" if quantity is None else _text(quantity.value, 5)
    yield f"{name}_sigma_{unit}", "" if quantity is None else _text(quantity.sigma, 5)


def _text(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else ""
