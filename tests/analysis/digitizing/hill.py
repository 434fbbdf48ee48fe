"""A jump on the simulated hill to measure by hand, with its truth, and an operator who clicks with scatter."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from analysis.cameras.source import read_source
from analysis.digitizing.desk import Desk
from analysis.digitizing.files import DeskFiles
from analysis.digitizing.programs.orienting import Orienting
from analysis.measurements.model import POINTS
from bench.analysis.hill_logs import HillLog, write_hill_log
from rig.api.digitizing import PlaceAction, Tracking, TrackOrder
from simrig.world.conditions.effects import MissingMarker
from simrig.world.scenario import load_scenario

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


def write_jump(folder: Path, *, markers: bool = True, seed: int | None = None) -> HillLog:
    """The log, of a jumper with markers or without; of the hill's own seed if none is given."""
    scenario = load_scenario(Path("config/scenarios/training.toml")).model_copy(update={"stamp": False})
    if not markers:
        bare = tuple(MissingMarker(marker=name) for name in POINTS)
        jumper = scenario.jumper.model_copy(update={"missing_markers": bare})
        scenario = scenario.model_copy(update={"jumper": jumper})
    if seed is not None:
        scenario = scenario.model_copy(update={"seed": seed})
    return write_hill_log(folder / "jump", scenario, HILL_PULSES)


def opened(log: HillLog, *, survey: bool = True) -> Desk:
    """The desk at which it is measured, with the cameras oriented."""
    source = read_source(log.survey, None) if survey else None
    files = DeskFiles(log.path, log.path.with_suffix(".digitized"), log.path.with_suffix(".measured"))
    desk = Desk(files, lambda: source)
    desk.programs.orienting.wait(60)
    return desk


def adopt(desk: Desk, orientation: Orienting) -> None:
    """Let a desk have cameras that were oriented before."""
    desk.programs.orienting._errands.adopt("", orientation._known)
    desk.programs.orienting._given = orientation._given


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
