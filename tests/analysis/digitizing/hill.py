"""A jump on the simulated hill to measure by hand, with its truth, and an operator who clicks with scatter."""

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from analysis.cameras.source import Source, read_source
from analysis.digitizing.desk import Desk
from analysis.digitizing.files import DeskFiles
from analysis.digitizing.programs.orienting import _Known
from analysis.measurements.model import POINTS
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import PlaceAction, Tracking, TrackOrder
from simrig.world.conditions.effects import MissingMarker
from simrig.world.scenario import load_scenario
from tests.support.kept import kept_hill_log, kept_object

#: Scatter of a click, px.
SCATTER_PX = 0.3
#: For programs that take only what others leave of the processors, which beside other tests may be little for long.
PATIENCE_S = 500.0
#: Pulses of the log, numbered from 1, and those in which the jumper is measured.
HILL_PULSES = range(20, 58)
MEASURED = range(8, 28)


@dataclass(frozen=True, slots=True)
class Click:
    """A click of an operator."""

    pulse: int
    camera: str
    thing: str
    xy: tuple[float, float]

    def action(self) -> PlaceAction:
        """What it asks for."""
        return PlaceAction(
            do="place", pulse=self.pulse, camera=self.camera, thing=self.thing, xy=self.xy,
            sigma=(SCATTER_PX, SCATTER_PX),
        )  # fmt: skip


def rendered_jump(*, markers: bool = True, seed: int | None = None) -> HillLog:
    """The log, of a jumper with markers or without; of the hill's own seed if none is given. Not to be changed."""
    scenario = load_scenario(Path("config/scenarios/training.toml")).model_copy(update={"stamp": False})
    if not markers:
        bare = tuple(MissingMarker(marker=name) for name in POINTS)
        jumper = scenario.jumper.model_copy(update={"missing_markers": bare})
        scenario = scenario.model_copy(update={"jumper": jumper})
    if seed is not None:
        scenario = scenario.model_copy(update={"seed": seed})
    return kept_hill_log(scenario, HILL_PULSES)


def placed(log: HillLog, folder: Path) -> HillLog:
    """A log in a folder of its own, so that what is kept beside it is this test's."""
    for file in (log.path, log.survey):
        (folder / file.name).symlink_to(file)
    return replace(log, path=folder / log.path.name, survey=folder / log.survey.name)


def opened(log: HillLog, *, survey: bool = True) -> Desk:
    """The desk at which it is measured, with the cameras oriented."""
    source = read_source(log.survey, None) if survey else None
    files = DeskFiles(log.path, log.path.with_suffix(".digitized"), log.path.with_suffix(".measured"))
    desk = Desk(files, lambda: source)
    desk.programs.orienting.wait(60)
    return desk


@dataclass(frozen=True, slots=True, eq=False)
class Oriented:
    """The cameras of a log as they were oriented, and by what."""

    known: _Known
    given: Source | None

    @classmethod
    def of(cls, desk: Desk) -> "Oriented":
        """Those of a desk."""
        return cls(desk.programs.orienting._known, desk.programs.orienting._given)


def orientation_of(log: HillLog) -> Oriented:
    """The cameras of a kept log, oriented once by its survey."""

    def orient() -> Oriented:
        with tempfile.TemporaryDirectory() as folder:
            desk = opened(placed(log, Path(folder)))
            found = Oriented.of(desk)
            desk.close()
        return found

    found: Oriented = kept_object("oriented", orient, log.path.parent.name)
    return found


def adopt(desk: Desk, orientation: Oriented) -> None:
    """Let a desk have cameras that were oriented before."""
    desk.programs.orienting._errands.adopt("", orientation.known)
    desk.programs.orienting._given = orientation.given


def followed(desk: Desk, operator: str, order: TrackOrder) -> Tracking:
    """Follow to the end."""
    desk.programs.follow(operator, order)
    told = desk.programs.follower.wait(operator, 120)
    assert told.state == "done", told.problem
    return told


def clicks(desk: Desk, log: HillLog, seed: int, pulses: range = MEASURED, *, markers: bool = True) -> Iterator[Click]:
    """Clicks of an operator on the points that he sees, and on two places of each ski.

    Of a jumper without markers he sees helmet, hip and bindings themselves.
    """
    random = np.random.default_rng(seed)
    for pulse in pulses:
        truth = log.truth[pulse]
        for camera in desk.programs.oriented().cameras.values():
            for thing, xyz, seen in _things(truth, camera.name):
                px = camera.project(np.array(xyz))
                if (seen or not markers) and np.isfinite(px).all() and (px > 0).all() and (px < camera.size - 1).all():
                    x, y = px + random.normal(0, SCATTER_PX, 2)
                    yield Click(pulse, camera.name, thing, (float(x), float(y)))


def _things(truth: dict, camera: str) -> Iterator[tuple[str, np.ndarray, bool]]:  # type: ignore[type-arg]
    for name in POINTS:
        yield name, np.array(truth["points"][name]), bool(truth["in_sight"][camera][name])
    for side in ("right", "left"):
        ski = truth["skis"][side]
        for along in (-0.9, 0.9):
            yield f"{side} ski", np.array(ski["point"]) + along * np.array(ski["direction"]), True
