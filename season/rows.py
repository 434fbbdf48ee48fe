"""The rows that a measured log gives to the tables of a season, and the columns of these tables.

The worker writes them beside the log as CSV without a header, so that one table of ten thousand logs is made by joining
files. Names of columns end in their unit; a cell is empty where nothing was measured.
"""

import csv
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Final

from analysis.export.table import Cell, pulse_cells
from analysis.measurements.model import POINTS
from analysis.procedure.analyze import Analysis
from analysis.report.course import NAMES, course_of
from analysis.result.model import Jump, MeasuredRecording, PulseState, Quantity
from rig.arrays import Floats
from rig.clocks import NS_PER_S

#: Distances from the take-off at which the quantities of a jump are taken, m.
DISTANCES_M: Final = (0, 5, 10, 15, 20)
_UNITS: Final = {"height": "m", "speed": "m_per_s"}
_PAIRS: Final = (("XY", 0, 1), ("XZ", 0, 2), ("YZ", 1, 2))


@dataclass(frozen=True, slots=True)
class Table:
    """A table.

    Attributes:
        name: of the table; its rows stand in `season-NAME.csv`.
        columns: DuckDB's type by name, in the order of the cells.
    """

    name: str
    columns: dict[str, str]

    @property
    def file(self) -> str:
        """Name of the file with the rows of one log."""
        return f"season-{self.name}.csv"


def unit_of(name: str) -> str:
    """The unit of a quantity, as names of columns have it."""
    return _UNITS.get(name, "deg")


def column_of(name: str, distance_m: int, *, sigma: bool = False) -> str:
    """The column of a quantity at a distance from the take-off, or of its standard deviation."""
    return f"{name}_at_{distance_m}_m_{'sigma_' if sigma else ''}{unit_of(name)}"


@cache
def tables() -> tuple[Table, ...]:
    """The tables: `jumps`, `pulses`, `cameras`."""
    jumps = {
        "key": "VARCHAR", "jump": "INTEGER", "recording": "VARCHAR", "time_utc": "TIMESTAMP", "athlete": "VARCHAR",
        "bib": "VARCHAR", "gate": "VARCHAR", "wind": "VARCHAR", "ok": "BOOLEAN", "verdict": "VARCHAR",
        "rate_hz": "DOUBLE", "pulses": "INTEGER", "takeoff_pulse": "DOUBLE", "takeoff_sigma_pulses": "DOUBLE",
        "perpendicular_m_per_s": "DOUBLE", "perpendicular_sigma_m_per_s": "DOUBLE", "calibration": "VARCHAR",
    }  # fmt: skip
    for distance in DISTANCES_M:
        for name in NAMES:
            jumps[column_of(name, distance)] = "DOUBLE"
            jumps[column_of(name, distance, sigma=True)] = "DOUBLE"
    cameras = {"key": "VARCHAR", "recording": "VARCHAR", "camera": "VARCHAR"}
    cameras |= {f"X0_{axis}_m": "DOUBLE" for axis in "XYZ"} | {f"X0_{axis}_sigma_m": "DOUBLE" for axis in "XYZ"}
    cameras |= {f"R{row}{column}": "DOUBLE" for row in "123" for column in "123"}
    cameras |= {f"angle_{axis}_sigma_deg": "DOUBLE" for axis in "xyz"}
    cameras |= {"offset_ms": "DOUBLE", "offset_sigma_ms": "DOUBLE", "moved": "VARCHAR"}
    pulses = {"key": "VARCHAR", "jump": "INTEGER"} | {name: _type(name) for name, _ in _pulse(None)}
    return Table("jumps", jumps), Table("pulses", pulses), Table("cameras", cameras)


def write_rows(key: str, found: Analysis, folder: Path) -> None:
    """Write the rows of all tables.

    Args:
        key: of the result.
        found: what was measured in a log.
        folder: of the result.

    Raises:
        OSError: the disk refuses.
    """
    result = found.result
    rows: dict[str, Iterable[list[Cell]]] = {
        "jumps": [_jump(key, result, jump, found.perpendicular.get(jump.number)) for jump in result.jumps],
        "pulses": [
            [key, jump.number, *(cell for _, cell in _pulse(pulse))] for jump in result.jumps for pulse in jump.pulses
        ],
        "cameras": _cameras(key, result),
    }
    for table in tables():
        with (folder / table.file).open("w", encoding="utf-8", newline="") as file:
            csv.writer(file).writerows(rows[table.name])


def _jump(key: str, result: MeasuredRecording, jump: Jump, perpendicular: Quantity | None) -> list[Cell]:
    session, takeoff = result.session, jump.takeoff
    course = course_of(jump, result.rate_hz)
    time = jump.pulses[0].time if takeoff is None else takeoff.time
    utc = datetime.fromtimestamp(time / NS_PER_S, UTC).replace(tzinfo=None).isoformat(" ", "milliseconds")
    cells: list[Cell] = [key, jump.number, result.recording, utc]
    cells += [session.get(field, "") for field in ("athlete", "bib", "gate", "wind")]
    cells += [str(bool(jump.verdict.ok)).lower(), jump.verdict.message, _number(result.rate_hz), len(jump.pulses)]
    cells += ["", ""] if takeoff is None else [_number(takeoff.pulse), _number(takeoff.sigma_pulses)]
    cells += [*_both(perpendicular), result.orientation.source]
    for distance in DISTANCES_M:
        for name in NAMES:
            cells += _both(course.at_distance(name, distance))
    return cells


def _cameras(key: str, result: MeasuredRecording) -> Iterator[list[Cell]]:
    moved = {move.camera: move.message for move in result.orientation.moved}
    for name, image in result.orientation.images.items():
        offset = result.synchrony.get(name)
        cells: list[Cell] = [key, result.recording, name]
        for values in (image.position, image.sigma_position, image.rotation, image.sigma_angles):
            cells += _numbers(values)
        cells += ["", ""] if offset is None else [_number(offset.offset_ms), _number(offset.sigma_ms)]
        yield [*cells, moved.get(name, "")]


def _pulse(pulse: PulseState | None) -> Iterator[tuple[str, Cell]]:
    """The cells of `jumper.csv`, and covariances of the points between their axes (the sigmas stand there)."""
    yield from pulse_cells(pulse)
    smoothed = None if pulse is None else pulse.smoothed
    for name in POINTS:
        raw = None if pulse is None else pulse.raw.points.get(name)
        point = None if smoothed is None else smoothed.points.get(name)
        yield from _covariance(name, "m2", None if raw is None else raw.covariance)
        yield from _covariance(f"{name}_s", "m2", None if point is None else point.covariance)
    yield from _covariance("O_s", "m2", None if smoothed is None else smoothed.origin.covariance)
    yield from _covariance("velocity_s", "m2_per_s2", None if smoothed is None else smoothed.velocity.covariance)


def _covariance(name: str, unit: str, covariance: Floats | None) -> Iterator[tuple[str, Cell]]:
    for axes, row, column in _PAIRS:
        yield (
            f"{name}_covariance_{axes}_{unit}",
            "" if covariance is None else _number(float(covariance[row, column])),
        )


def _type(name: str) -> str:
    if name in {"pulse", "time_utc_ns"}:
        return "BIGINT"
    return "VARCHAR" if name == "phase" or name.endswith(("_status", "_cameras")) else "DOUBLE"


def _both(quantity: Quantity | None) -> list[Cell]:
    return ["", ""] if quantity is None else [_number(quantity.value), _number(quantity.sigma)]


def _numbers(values: Floats) -> list[Cell]:
    return [_number(value) for value in values.ravel().tolist()]


def _number(value: float) -> str:
    return f"{value:.9g}" if math.isfinite(value) else ""
