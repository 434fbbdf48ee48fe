"""Orients the cameras of a log that is measured by hand: by its own balls, or by those that a person clicked.

A program of its own does it, so that measuring goes on as fast as before; while a recording runs it stands still.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from analysis.cameras.poses_file import Calibration
from analysis.cameras.source import Source
from analysis.digitizing.geometry.space import inside, predicted
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import BALL
from analysis.digitizing.opened_log import OpenedLog
from analysis.scene.camera_system import CameraSystem
from analysis.scene.survey import KnownPoints, Survey
from rig.api.digitizing import OrientationState, PredictedPoint
from rig.background.errands import Errands
from rig.background.messages import Progress
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase

_NO_SOURCE: Final = phrase(
    "hand_no_source", "nobody told where the balls are: name the survey with --survey, or in [analysis] of the rig file"
)
_RECORDING: Final = phrase("hand_orient_waits", "a recording runs: the cameras are oriented when it has ended")
#: Why there is nothing yet, where nothing else is to be said.
WAIT: Final = phrase("hand_wait", "wait for it")
#: The cameras belong to all operators.
_EVERYBODY: Final = ""


@dataclass(frozen=True, slots=True, eq=False)
class OrientingOrder:
    """What to orient: the cameras of a log, by a survey or poses, and by clicked balls.

    No clicked balls (None): by those that the images show.
    """

    log: Path
    source: Source
    marks: Mapping[Key, Entered] | None


@dataclass(frozen=True, slots=True, eq=False)
class OrientedCameras:
    """The cameras, what a person should know of them, and whether they were oriented by clicked balls."""

    system: CameraSystem
    findings: tuple[Phrase, ...]
    by_clicks: bool


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    state: OrientationState
    system: CameraSystem | None = None
    by_clicks: bool = False
    proposals: dict[str, dict[str, PredictedPoint]] = field(default_factory=dict)


class Orienting:
    """The orientation of one log. Any thread may call any method.

    Args:
        log: the log.
        source: reads survey or poses; None of it: there is neither.
        busy: whether a recording runs, so that the work has to stand still; None: nothing is recorded on this computer.
    """

    def __init__(
        self, log: OpenedLog, source: Callable[[], Source | None], busy: Callable[[], bool] | None = None
    ) -> None:
        self._log, self._source = log, source
        self._given: Source | None = None
        self._errands = Errands(
            "analysis.digitizing.programs.orienting_program",
            _Known(OrientationState(state="none", message=_NO_SOURCE)),
            busy,
            heard=_heard,
            done=lambda _, cameras, __: self._done(cameras),
            failed=_failed,
        )

    @property
    def _known(self) -> _Known:
        return self._errands.state(_EVERYBODY)

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
        return None if self.survey is None else self.survey.surveyed()

    @property
    def survey(self) -> Survey | None:
        """The survey; None: there is none."""
        return self._given if isinstance(self._given, Survey) else None

    def close(self) -> None:
        """End what is being done."""
        self._errands.close()

    def begin(self, marks: Mapping[Key, Entered] | None = None) -> OrientationState:
        """Begin to orient; while it works, nothing else begins.

        Args:
            marks: the clicked balls to orient by; None: the balls that the log's images show by themselves.
        """
        if self._errands.works(_EVERYBODY):
            return self.state
        try:
            source = self._source()
        except BadInputError as error:
            return self._errands.adopt(_EVERYBODY, _Known(OrientationState(state="failed", message=error.said))).state
        self._given = source
        if source is None:
            without = _Known(OrientationState(state="none", message=_NO_SOURCE))
            return self._errands.adopt(_EVERYBODY, without).state
        working = replace(self._known, state=OrientationState(state="working"))
        order = OrientingOrder(self._log.path, source, marks)
        return self._errands.begin(_EVERYBODY, working, lambda: order).state

    @property
    def for_analysis(self) -> Source | None:
        """From what an analysis gets the same cameras; None: nobody told where the balls are."""
        known = self._known
        if known.by_clicks and known.system is not None:
            return Calibration("the balls that were clicked", known.system, {}, "m", ())
        return self._given

    def wait(self, timeout_s: float) -> None:
        """Wait until it is done."""
        self._errands.wait(_EVERYBODY, timeout_s)

    def proposals(self) -> dict[str, dict[str, PredictedPoint]]:
        """Where each camera should show the surveyed balls, by camera and thing."""
        return self._known.proposals

    def _done(self, cameras: OrientedCameras) -> _Known:
        system = cameras.system
        lacking = [name for name in self._log.facts.cameras if name not in system.names]
        message = phrase("hand_lacking", "not oriented: {cameras}", cameras=", ".join(lacking)) if lacking else None
        state = OrientationState(state="done", message=message, findings=cameras.findings)
        return _Known(state, system, cameras.by_clicks, _proposals(system, self.balls))


def _heard(known: _Known, news: Progress | bool) -> _Known:
    message = _RECORDING if news is True else None
    return replace(known, state=OrientationState(state="working", message=message))


def _failed(before: _Known, why: Phrase) -> _Known:
    return replace(before, state=OrientationState(state="failed", message=why))


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
