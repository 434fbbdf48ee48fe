"""A printed board, or a frame of targets, that somebody holds before the cameras: still, then in another pose."""

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Final

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError

from rig.arrays import Floats
from rig.errors import BadInputError
from simrig.world.conditions.effects import FiniteModel, Vector
from simrig.world.projection import Projection

MM_PER_M: Final = 1000.0


class BoardPose(FiniteModel):
    """Where the board is held, as seen from the camera that it is held before."""

    away_m: float = Field(gt=0.05, le=100, description="of its middle, along the optical axis")
    right_m: float = Field(0.0, description="of its middle, in the direction r1 of the camera")
    up_m: float = Field(0.0, description="likewise, r2")
    turn_deg: float = Field(0.0, ge=-80, le=80, description="about r2, its right side towards the camera if negative")
    tilt_deg: float = Field(0.0, ge=-80, le=80, description="about r1, its upper side towards the camera if positive")
    roll_deg: float = Field(0.0, ge=-180, le=180, description="in its own plane, anticlockwise")


class HeldBoard(FiniteModel):
    """The board. While there is one, the cameras see it before a plain wall, and nothing of the hill."""

    pattern: Path = Field(description="board.json or targets.json of `svev target`, relative to the scenario file")
    before: str = Field(description="name of the camera that it is held before")
    still_s: float = Field(2.0, gt=0, le=60, description="it is held still for so long ...")
    moving_s: float = Field(1.0, gt=0, le=60, description="... and takes so long to the next pose; the first one last")
    poses: Annotated[tuple[BoardPose, ...], Field(min_length=1, max_length=100)]

    def at(self, time_s: float) -> tuple[BoardPose, bool]:
        """The pose at a scene time, and whether the board is still."""
        turns, within = divmod(time_s, self.still_s + self.moving_s)
        here = self.poses[int(turns) % len(self.poses)]
        if within <= self.still_s:
            return here, True
        there = self.poses[(int(turns) + 1) % len(self.poses)]
        u = (within - self.still_s) / self.moving_s
        part = u * u * (3.0 - 2.0 * u)
        values = {
            name: (1.0 - part) * getattr(here, name) + part * getattr(there, name) for name in BoardPose.model_fields
        }
        return BoardPose(**values), False


class Sheet(FiniteModel):
    """What is printed on a sheet: black boxes, x to the right and y downwards from its upper left corner."""

    width_mm: float = Field(gt=0)
    height_mm: float = Field(gt=0)
    cell_mm: float = Field(gt=0, description="all edges lie on a grid of cells of this size")
    margin_mm: float = Field(ge=0, description="white paper around it")
    black: tuple[tuple[float, float, float, float], ...] = Field(description="x, y, width, height of each box, mm")
    middle_mm: Vector = Field((0.0, 0.0, 0.0), description="on the frame: to its right, upwards, towards the reader")
    turn_deg: float = Field(0.0, description="on the frame, as `BoardPose`")
    tilt_deg: float = 0.0
    roll_deg: float = 0.0

    def raster(self) -> Floats:
        """(rows, columns) 1 where a cell is white, 0 where it is black; with the margin."""
        edge = round(self.margin_mm / self.cell_mm)
        columns, rows = round(self.width_mm / self.cell_mm), round(self.height_mm / self.cell_mm)
        white = np.ones((rows + 2 * edge, columns + 2 * edge))
        for box in self.black:
            x, y, width, height = (round(part / self.cell_mm) for part in box)
            white[edge + y : edge + y + height, edge + x : edge + x + width] = 0.0
        return white


_SHEETS: Final = TypeAdapter(Annotated[tuple[Sheet, ...], Field(min_length=1, max_length=200)])


def load_sheets(path: Path) -> tuple[Sheet, ...]:
    """Read `board.json` or `targets.json` of `svev target`.

    Raises:
        BadInputError: the file is missing, or something else.
    """
    try:
        return _SHEETS.validate_python(json.loads(path.read_text(encoding="utf-8"))["sheets"])
    except OSError as error:
        raise BadInputError(f"{path}: cannot be read ({error.strerror}); make it with svev target") from error
    except (ValueError, KeyError, TypeError, ValidationError):
        raise BadInputError(
            f"{path}: is no board.json or targets.json of svev target; make it anew with svev target"
        ) from None


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A board in space, or one of its sheets.

    Attributes:
        middle: (3,) m.
        axes: (3, 3), columns: to its right, upwards, towards the reader.
    """

    middle: Floats
    axes: Floats

    def sheet(self, sheet: Sheet) -> "Placed":
        """Where a sheet of it is."""
        middle = self.middle + self.axes @ (np.array(sheet.middle_mm) / MM_PER_M)
        return Placed(middle, self.axes @ _turned(sheet))


def placed(pose: BoardPose, camera: Projection) -> Placed:
    """Where a pose before a camera is in space."""
    middle = camera.X0 + camera.R @ np.array([pose.right_m, pose.up_m, -pose.away_m])
    return Placed(middle, camera.R @ _turned(pose))


def _turned(by: BoardPose | Sheet) -> Floats:
    """(3, 3) rotation about the directions up and right, then in the plane."""
    turn, tilt, roll = (math.radians(each) for each in (by.turn_deg, by.tilt_deg, by.roll_deg))
    about_up = np.array([[math.cos(turn), 0, math.sin(turn)], [0, 1, 0], [-math.sin(turn), 0, math.cos(turn)]])
    about_right = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    in_plane = np.array([[math.cos(roll), -math.sin(roll), 0], [math.sin(roll), math.cos(roll), 0], [0, 0, 1]])
    return np.asarray(about_up @ about_right @ in_plane, float)
