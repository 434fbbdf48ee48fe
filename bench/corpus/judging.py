"""Measures a scene of the corpus and sets what was measured beside the truth: one row of figures per scene."""

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec
import numpy as np

from analysis.cameras.source import read_source
from analysis.measurements.model import POINTS
from analysis.procedure.analyze import analyze
from analysis.result.model import Jump, OrientedImage, PointState, PulseState, SkiState, Status
from bench.analysis.hill_logs import HillLog
from bench.analysis.judge import Judged
from bench.corpus.draws import Scene
from bench.corpus.scenes import render
from bench.corpus.visible_skis import visible_skis
from photogrammetry.jumper.stick_model import slope_and_heading
from rig.arrays import Floats
from rig.errors import SvevError

#: Beyond so many standard deviations a point counts as wrong, if it also lies nearer to another marker, or far off.
_SIGMAS: Final = 5.0
_FAR_M: Final = 0.1
#: A point that is told to be controlled must not be off by more than so many: 1 in 16 000 in each coordinate.
_CONTROLLED_SIGMAS: Final = 4.0
_CAMERAS: Final = 2


class Row(msgspec.Struct, frozen=True):
    """What was found out about a scene.

    Attributes:
        half, number: which scene.
        cameras: number of cameras.
        width: of the images, px.
        marker_px: median radius of the markers, px.
        renderer: what made the pictures.
        error: why it was not measured; "": it was.
        oriented: cameras whose pose is within five sigmas of the truth, of all.
        pose: squares of errors over sigma of the poses (position and rotation), summed, and their number.
        jumps: jumps found; one is to be found.
        well: told to be measured well.
        points, solved, wrong: points that two cameras show, how many of them are measured, how many are wrong.
        controlled, beyond: points that are told to be controlled, and those of them beyond four sigmas.
        skis, skis_solved, skis_wrong: the same of skis, where a person would see them in two images.
        squares: by part, phase and quantity: number and sum of the squares of errors over sigma.
        cpu_s: of the analysis.
    """

    half: str
    number: int
    cameras: int
    width: int
    marker_px: float
    renderer: str
    error: str = ""
    oriented: int = 0
    pose: tuple[float, int] = (0.0, 0)
    jumps: int = 0
    well: bool = False
    points: int = 0
    solved: int = 0
    wrong: int = 0
    controlled: int = 0
    beyond: int = 0
    skis: int = 0
    skis_solved: int = 0
    skis_wrong: int = 0
    squares: dict[str, tuple[int, float]] = {}
    cpu_s: float = 0.0


def judge(scene: Scene, folder: Path) -> Row:
    """Render a scene into a folder, measure it, and judge what was measured.

    What the analysis refuses is a row with the reason; any other exception is a defect and is passed on.
    """
    log = render(scene, folder / f"{scene.half.value}-{scene.number}")
    shown = _shown(scene, log)
    row = Row(
        scene.half.value,
        scene.number,
        len(scene.scenario.cameras),
        scene.size[0],
        scene.marker_px,
        scene.renderer,
        points=sum(len(points) for points, _ in shown.values()),
        skis=sum(len(skis) for _, skis in shown.values()),
    )
    begin = time.process_time()
    try:
        analysis = analyze(log.path, read_source(log.survey, None))
    except SvevError as error:
        return msgspec.structs.replace(row, error=type(error).__name__, cpu_s=time.process_time() - begin)
    cpu_s = time.process_time() - begin
    poses = [_pose_square(scene, name, image) for name, image in analysis.result.orientation.images.items()]
    judged, counts = Judged(), _Counts()
    for jump in analysis.result.jumps:
        judged.jump(jump, log.truth)
        counts.jump(jump, log.truth, shown)
    squares = {" ".join(key): _squares(pairs) for key, pairs in judged.errors.items()}
    return msgspec.structs.replace(
        row,
        oriented=sum(square < 6 * _SIGMAS**2 for square in poses),
        pose=(float(sum(poses)), 6 * len(poses)),
        jumps=len(analysis.result.jumps),
        well=any(jump.verdict.ok for jump in analysis.result.jumps),
        solved=counts.solved,
        wrong=counts.wrong,
        controlled=counts.controlled,
        beyond=counts.beyond,
        skis_solved=counts.skis,
        skis_wrong=counts.skis_wrong,
        squares=squares,
        cpu_s=cpu_s,
    )


def _shown(scene: Scene, log: HillLog) -> dict[int, tuple[set[str], set[str]]]:
    """By pulse: the points that two cameras show, and the skis that a person sees in two images."""
    shown = {}
    skis = visible_skis(scene, log)
    for number, state in log.truth.items():
        if not state.get("points"):
            continue
        seen = [label for of_camera in state["in_sight"].values() for label, inside in of_camera.items() if inside]
        points = {label for label in POINTS if seen.count(label) >= _CAMERAS}
        shown[number] = points, {side for side, images in skis[number].items() if images >= _CAMERAS}
    return shown


class _Counts:
    """Counts what is measured of that which is shown, and what of it is wrong."""

    def __init__(self) -> None:
        self.solved = self.wrong = self.controlled = self.beyond = self.skis = self.skis_wrong = 0

    def jump(
        self, jump: Jump, truth: Mapping[int, Mapping[str, Any]], shown: Mapping[int, tuple[set[str], set[str]]]
    ) -> None:
        """Enter a jump."""
        for pulse in jump.pulses:
            true = truth.get(pulse.pulse)
            if true is not None and true.get("points"):
                self._points(pulse, true, shown[pulse.pulse][0])
                self._skis(pulse, true, shown[pulse.pulse][1])

    def _points(self, pulse: PulseState, true: Mapping[str, Any], shown: set[str]) -> None:
        places = {name: np.array(X) for name, X in true["points"].items()}
        for name, point in pulse.raw.points.items():
            if point is None:
                continue
            self.solved += name in shown
            square = _square(point, places[name])
            off = float(np.linalg.norm(point.xyz - places[name]))
            nearest = min(places, key=lambda label: float(np.linalg.norm(point.xyz - places[label])))
            self.wrong += square > 3 * _SIGMAS**2 and (nearest != name or off > _FAR_M)
            if point.status is Status.CONTROLLED:
                self.controlled += 1
                self.beyond += square > 3 * _CONTROLLED_SIGMAS**2

    def _skis(self, pulse: PulseState, true: Mapping[str, Any], shown: set[str]) -> None:
        for side, ski in pulse.raw.skis.items():
            if ski is not None:
                self.skis += side in shown
                self.skis_wrong += _ski_square(ski, np.array(true["skis"][side]["direction"])) > 2 * _SIGMAS**2


def _square(point: PointState, true: Floats) -> float:
    """Square of the error over sigma, chi-squared of three."""
    off = point.xyz - true
    return float(off @ np.linalg.solve(point.covariance, off))


def _ski_square(ski: SkiState, direction: Floats) -> float:
    """Square of the error over sigma of slope and heading, chi-squared of two."""
    off = np.radians((ski.slope.value, ski.heading.value)) - slope_and_heading(direction)
    return float(off @ np.linalg.solve(ski.covariance, off))


def _pose_square(scene: Scene, name: str, image: OrientedImage) -> float:
    """Squares of the errors of a pose over their sigmas: position and turns about the camera's axes, six numbers."""
    camera = next(camera for camera in scene.scenario.cameras if camera.name == name)
    turn = camera.rotation().T @ image.rotation
    turns = np.degrees((turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1])) / 2
    off = np.concatenate(((image.position - np.array(camera.X0)) / image.sigma_position, turns / image.sigma_angles))
    return float(off @ off)


def _squares(pairs: list[tuple[float, float]]) -> tuple[int, float]:
    """Number of errors beside their sigmas, and the sum of the squares of their quotients."""
    error, sigma = np.array(pairs).T
    return len(pairs), float(np.sum((error / sigma) ** 2))
