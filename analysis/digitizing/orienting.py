"""Orients the cameras of a log that is measured by hand: by its own balls, or by those that a person clicked."""

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from analysis.cameras.frames import LogFrames
from analysis.cameras.poses_file import Calibration
from analysis.cameras.source import Source
from analysis.digitizing.effective import sigma_of
from analysis.digitizing.journal import Entered, Key
from analysis.digitizing.opened_log import OpenedLog
from analysis.digitizing.space import inside, predicted
from analysis.digitizing.things import BALL, ball_of
from analysis.procedure.orienting import oriented
from analysis.scene.camera_system import CameraSystem, camera_system
from analysis.scene.survey import KnownPoints, Survey
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import Image, ImageObservations
from photogrammetry.procedures.orientation import orient
from rig.api.digitizing import MarkState, OrientationState, PredictedPoint
from rig.errors import BadInputError, LogDamagedError

#: Clicked balls without which a camera is left out.
_FEWEST_BALLS: Final = 4
_FAILURES: Final = (BadInputError, LogDamagedError, NotSolvableError, NotConvergedError, RefusedError)
_NO_SOURCE: Final = "nobody told where the balls are: name the survey with --survey, or in [analysis] of the rig file"
_RECORDING: Final = "a recording runs: orient the cameras when it has ended"


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    state: OrientationState
    system: CameraSystem | None = None
    by_clicks: bool = False
    proposals: dict[str, dict[str, PredictedPoint]] = field(default_factory=dict)


class Orienting:
    """The orientation of one log, found in a thread. Any thread may call any method.

    Args:
        log: the log.
        source: reads survey or poses; None of it: there is neither.
    """

    def __init__(self, log: OpenedLog, source: Callable[[], Source | None]) -> None:
        self._log, self._source = log, source
        self._lock = threading.Lock()
        self._known = _Known(OrientationState(state="none", message=_NO_SOURCE))
        self._given: Source | None = None
        self._thread: threading.Thread | None = None

    @property
    def state(self) -> OrientationState:
        """How far it is."""
        return self._known.state

    @property
    def system(self) -> CameraSystem | None:
        """The oriented cameras; None: not yet."""
        return self._known.system

    @property
    def balls(self) -> KnownPoints | None:
        """The surveyed balls; None: no survey."""
        return self._given.surveyed() if isinstance(self._given, Survey) else None

    def wait_for_order(self) -> None:
        """Say that nothing begins by itself, since a recording runs."""
        self._known = _Known(OrientationState(state="none", message=_RECORDING))

    def begin(self, marks: Mapping[Key, Entered] | None = None) -> OrientationState:
        """Begin to orient; while it works, nothing else begins.

        Args:
            marks: the clicked balls to orient by; None: the balls that the log's images show by themselves.
        """
        with self._lock:
            if self._thread is not None and self._thread.is_alive():
                return self.state
            try:
                self._given = self._source()
            except BadInputError as error:
                self._known = _Known(OrientationState(state="failed", message=str(error)))
                return self.state
            if self._given is None:
                self._known = _Known(OrientationState(state="none", message=_NO_SOURCE))
                return self.state
            self._known = replace(self._known, state=OrientationState(state="working"))
            self._thread = threading.Thread(target=self._work, args=(self._given, marks), name="orienting", daemon=True)
            self._thread.start()
            return self.state

    @property
    def for_analysis(self) -> Source | None:
        """From what an analysis gets the same cameras; None: nobody told where the balls are."""
        known = self._known
        if known.by_clicks and known.system is not None:
            return Calibration("the balls that were clicked", known.system, {}, "m", ())
        return self._given

    def wait(self, timeout_s: float) -> None:
        """Wait until it is done."""
        if (thread := self._thread) is not None:
            thread.join(timeout_s)

    def proposals(self) -> dict[str, dict[str, PredictedPoint]]:
        """Where each camera should show the surveyed balls, by camera and thing."""
        return self._known.proposals

    def _work(self, source: Source, marks: Mapping[Key, Entered] | None) -> None:
        before = self._known
        try:
            if marks is None:
                found = oriented(self._log.static(), source, LogFrames(self._log.path))
                moved = tuple(move.message for move in found.steadiness.moved)
                system, findings = found.scene.system, [*found.scene.messages, *moved]
            else:
                system, findings = self._by_clicks(source, marks)
            lacking = [name for name in self._log.facts.cameras if name not in system.names]
            message = f"not oriented: {', '.join(lacking)}" if lacking else None
            state = OrientationState(state="done", message=message, findings=tuple(findings))
            self._known = _Known(state, system, marks is not None, _proposals(system, self.balls))
        except _FAILURES as error:
            advice = "" if marks is not None else "; or click four or more balls in each image, and orient by them"
            self._known = replace(before, state=OrientationState(state="failed", message=f"{error}{advice}"))

    def _by_clicks(self, source: Source, marks: Mapping[Key, Entered]) -> tuple[CameraSystem, list[str]]:
        """Orient by the clicked balls alone (paper, step 2, alternative 1)."""
        if not isinstance(source, Survey):
            raise BadInputError(
                "the cameras' poses are given: to orient by clicked balls, give the survey of the balls"
            )
        network = source.network
        names = {point.name: i for i, point in enumerate(network.points)}
        sizes = {name: camera.size for name, camera in self._log.facts.cameras.items()}
        cameras, _ = source.cameras_of(sizes)
        clicked: dict[str, dict[str, Entered]] = {name: {} for name in cameras}
        for key, entered in marks.items():
            ball = ball_of(key.thing)
            if ball in names and key.camera in clicked and entered.state is MarkState.MEASURED and entered.xy:
                clicked[key.camera][ball] = entered
        used = [name for name, balls in clicked.items() if len(balls) >= _FEWEST_BALLS]
        if not used:
            most = max((len(balls) for balls in clicked.values()), default=0)
            raise BadInputError(
                f"an image needs {_FEWEST_BALLS} clicked balls or more, five to be sure; most have {most}"
            )
        seen = sorted({ball for name in used for ball in clicked[name]}, key=names.__getitem__)
        rows = [
            (i, seen.index(ball), entered) for i, name in enumerate(used) for ball, entered in clicked[name].items()
        ]
        size = np.array([sizes[used[i]] for i, _, _ in rows], float)
        xy = np.array([entered.xy for _, _, entered in rows], float)
        observations = ImageObservations(
            np.array([i for i, _, _ in rows], np.intp),
            np.array([p for _, p, _ in rows], np.intp),
            np.stack([pixel_to_metric(place, s) for place, s in zip(xy, size, strict=True)]),
            np.array([sigma_of(entered) for _, _, entered in rows], float),
            np.zeros(len(rows), np.intp),
        )
        chosen = replace(
            network,
            cameras=tuple(cameras[name] for name in used),
            images=tuple(Image(name, i) for i, name in enumerate(used)),
            points=tuple(network.points[names[ball]] for ball in seen),
            observations=observations,
            distances=(),
            differences=(),
        )
        orientation = orient(chosen, uncertain_interior=True)
        return camera_system(orientation, tuple(sizes)), list(orientation.notes)


def _proposals(system: CameraSystem, known: KnownPoints | None) -> dict[str, dict[str, PredictedPoint]]:
    result: dict[str, dict[str, PredictedPoint]] = {}
    if known is None:
        return result
    for name, camera in system.cameras.items():
        px = camera.project(known.xyz)
        _, by_point, by_camera = camera.linearised(known.xyz, np.nan_to_num(px))
        own = system.covariance[np.ix_(camera.columns, camera.columns)]
        for i, ball in enumerate(known.names):
            if inside(px[i], camera.size):
                covariance = by_point[i] @ known.covariance[i] @ by_point[i].T + by_camera[i] @ own @ by_camera[i].T
                result.setdefault(name, {})[BALL + ball] = predicted(px[i], covariance, "rays")
    return result
