"""Reads the planner's network files: strict TOML or JSON; every error names file, key and remedy."""

from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from photogrammetry.network.entries import Finite, Name, Pixels, Positive, Triple
from photogrammetry.network.strict_text import read_object
from rig.errors import BadInputError
from rig.settings.file_kinds import FileKind, refuse_other
from rig.settings.strict_toml import StrictModel, validate

Parameter = Literal["c", "x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2"]


class ImageEntry(StrictModel):
    """One image: where the camera stands, where it looks, how far it is turned clockwise as seen from behind it."""

    X0: Triple
    look_at: Triple
    roll_deg: Finite = 0.0

    @model_validator(mode="after")
    def _has_a_horizon(self) -> "ImageEntry":
        sight = np.subtract(self.look_at, self.X0)
        if np.hypot(sight[0], sight[1]) <= 1e-6 * np.linalg.norm(sight):
            raise ValueError("looks straight up, straight down or nowhere; move X0 or look_at a little aside")
        return self


class CameraEntry(StrictModel):
    """A camera, its unknown parameters, and its images."""

    name: Name
    size: Annotated[list[Pixels], Field(min_length=2, max_length=2)]
    c: Positive
    estimate: list[Parameter] = Field(default=[])
    images: Annotated[list[ImageEntry], Field(min_length=1)]


class BallEntry(StrictModel):
    """A target: surveyed (control), unknown (tie) or the origin itself (fixed)."""

    name: Name
    role: Literal["control", "tie", "fixed"]
    X: Triple


class RodEntry(StrictModel):
    """A vertical rod with a target at its foot (`NAME-1`) and one `length` above it (`NAME-2`)."""

    name: Name
    foot: Triple
    length: Positive


class DifferenceEntry(StrictModel):
    """A measured coordinate difference of two targets: that of their given coordinates along `axis`, with `sigma`."""

    start: Name
    end: Name
    axis: Literal["X", "Y", "Z"]
    sigma: Positive


class SigmaEntry(StrictModel):
    """Standard deviations of the measurements: image points (px), surveyed targets, rods."""

    image: Positive
    control: Positive | None = None
    rod_length: Positive | None = None
    rod_verticality: Positive | None = None  # shift of the upper target across / length


class SkiEntry(StrictModel):
    """A ski: the point of the jumper that it passes through, its direction and length."""

    point: Name
    direction: Triple
    length: Positive


class ObstacleEntry(StrictModel):
    """A box with faces along the axes that hides what is behind it: two opposite corners."""

    name: Name
    corner: Triple
    opposite: Triple

    @model_validator(mode="after")
    def _has_a_volume(self) -> "ObstacleEntry":
        if not np.all(np.subtract(self.corner, self.opposite)):
            raise ValueError(f'obstacle "{self.name}" is flat; give corners that differ in X, Y and Z')
        return self


class StickEntry(StrictModel):
    """The points and skis that define the angles of Fig. 6; O lies midway between the points of the two skis."""

    helmet: Name
    hip: Name
    right: Name
    left: Name


class JumperEntry(StrictModel):
    """The jumper, carried along the flight without turning.

    Points are relative to the path, which has one place per pulse. `tie` names the points whose places are also tie
    points of step 2 (alternative 2).
    """

    points: Annotated[dict[Name, Triple], Field(min_length=1)]
    skis: dict[Name, SkiEntry] = Field(default={})
    ski_points: Annotated[int, Field(strict=True, ge=2, le=100)] = 4
    tie: list[Name] = Field(default=[])
    stick: StickEntry | None = None
    rate_hz: Positive = 30.0
    path: Annotated[list[Triple], Field(min_length=1)]

    @model_validator(mode="after")
    def _names_are_known(self) -> "JumperEntry":
        points = [("tie", name) for name in self.tie]
        points += [(f"skis.{name}.point", ski.point) for name, ski in self.skis.items()]
        skis = []
        if self.stick is not None:
            points += [("stick.helmet", self.stick.helmet), ("stick.hip", self.stick.hip)]
            skis = [("stick.right", self.stick.right), ("stick.left", self.stick.left)]
        for what, wanted, known in (("points", points, list(self.points)), ("skis", skis, list(self.skis))):
            for key, name in wanted:
                if name not in known:
                    raise ValueError(f'{key} names "{name}"; the jumper\'s {what} are {", ".join(known) or "none"}')
        for name, ski in self.skis.items():
            if abs(ski.direction[0]) < 0.1 * float(np.linalg.norm(ski.direction)):
                raise ValueError(f"skis.{name}.direction runs across the X axis; turn the system so that X runs along")
        return self


class Description(StrictModel):
    """A planned network."""

    name: Name
    length_unit: Name
    datum: Literal["control", "inner"] = "control"
    sigma: SigmaEntry
    cameras: Annotated[list[CameraEntry], Field(min_length=1)]
    balls: list[BallEntry] = Field(default=[])
    rods: list[RodEntry] = Field(default=[])
    differences: list[DifferenceEntry] = Field(default=[])
    obstacles: list[ObstacleEntry] = Field(default=[])
    jumper: JumperEntry | None = None

    def target_names(self) -> list[str]:
        """Balls, then the two targets of each rod."""
        return [ball.name for ball in self.balls] + [f"{rod.name}-{end}" for rod in self.rods for end in (1, 2)]

    @model_validator(mode="after")
    def _hangs_together(self) -> "Description":
        names = self.target_names()
        for kind, taken in (("target", names), ("camera", [camera.name for camera in self.cameras])):
            twice = next((name for name in taken if taken.count(name) > 1), None)
            if twice is not None:
                raise ValueError(f'two {kind}s are called "{twice}"; rename one')
        for difference in self.differences:
            for end in (difference.start, difference.end):
                if end not in names:
                    raise ValueError(f'differences name "{end}"; the targets are {", ".join(names)}')
        if self.sigma.control is None and any(ball.role == "control" for ball in self.balls):
            raise ValueError("sigma.control is missing, but there are control balls; add it")
        if self.rods and (self.sigma.rod_length is None or self.sigma.rod_verticality is None):
            raise ValueError("sigma.rod_length and sigma.rod_verticality are needed with rods; add them")
        return self


def read_description(path: Path) -> Description:
    """Read a network file of the planner.

    Raises:
        BadInputError: one line with file, key and remedy.
    """
    data = read_object(path, "plan")
    refuse_other(data, FileKind.PLAN, path)
    if "format" in data:
        raise BadInputError(f'{path}: has a "format", so it is no plan; svev adjust takes networks')
    return validate(Description, data, path)
