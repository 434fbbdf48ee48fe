"""Orients the cameras of a log that is measured by hand: by its own balls, or by those that a person clicked.

A program of its own does it, so that measuring goes on as fast as before; while a recording runs it stands still.
"""

import pickle
import tempfile
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np

from analysis.cameras.poses_file import Calibration
from analysis.cameras.source import Source
from analysis.digitizing.journal import Entered, Key
from analysis.digitizing.opened_log import OpenedLog
from analysis.digitizing.space import inside, predicted
from analysis.digitizing.things import BALL
from analysis.scene.camera_system import CameraSystem
from analysis.scene.survey import KnownPoints, Survey
from rig.api.digitizing import OrientationState, PredictedPoint
from rig.background.child import run_child
from rig.errors import BadInputError
from rig.phrase import Phrase, from_plain, phrase, plain

_NO_SOURCE: Final = phrase(
    "hand_no_source", "nobody told where the balls are: name the survey with --survey, or in [analysis] of the rig file"
)
_RECORDING: Final = phrase("hand_orient_waits", "a recording runs: the cameras are oriented when it has ended")
#: Why there is nothing yet, where nothing else is to be said.
WAIT: Final = phrase("hand_wait", "wait for it")
_PROGRAM: Final = "analysis.digitizing.orienting_program"


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
        self._log, self._source, self._busy = log, source, busy
        self._closed = False
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

    def close(self) -> None:
        """End what is being done."""
        self._closed = True
        if (thread := self._thread) is not None:
            thread.join()

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
                self._known = _Known(OrientationState(state="failed", message=error.said))
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
            found = self._oriented(source, marks)
        except ChildProcessError:
            self._fail(
                before,
                phrase("hand_orient_ended", "the program that orients was ended by something else: orient again"),
            )
        except OSError as error:
            self._fail(
                before, plain(f"{tempfile.gettempdir()}: {error.strerror or error}; make room, and orient again")
            )
        except BadInputError as error:
            text = "{why}; or click four or more balls in each image, and orient by them"
            self._fail(before, error.said if marks is not None else phrase("hand_or_click", text, why=error.said))
        else:
            if found is not None:
                self._known = found

    def _fail(self, before: _Known, message: Phrase) -> None:
        self._known = replace(before, state=OrientationState(state="failed", message=message))

    def _oriented(self, source: Source, marks: Mapping[Key, Entered] | None) -> _Known | None:
        """The cameras; None if nobody wants them any more.

        Raises:
            BadInputError: they cannot be oriented so.
            OSError: the program cannot be started, or something else has ended it.
        """
        with tempfile.TemporaryDirectory(prefix="svev-") as folder:
            order, answer = Path(folder, "order"), Path(folder, "answer")
            order.write_bytes(pickle.dumps((source, marks)))
            end = run_child(
                _PROGRAM,
                {"log": str(self._log.path), "order": str(order), "answer": str(answer)},
                busy=self._busy or (lambda: False),
                wanted=lambda: not self._closed,
                tell=lambda _: None,
                hold=self._hold,
                yielding=self._busy is not None,
            )
            if end is None:
                return None
            if "problem" in end:
                raise BadInputError(from_plain(end["problem"]))
            system = pickle.loads(answer.read_bytes())  # noqa: S301 - our program wrote it just now
        lacking = [name for name in self._log.facts.cameras if name not in system.names]
        message = phrase("hand_lacking", "not oriented: {cameras}", cameras=", ".join(lacking)) if lacking else None
        state = OrientationState(state="done", message=message, findings=tuple(map(from_plain, end["findings"])))
        return _Known(state, system, marks is not None, _proposals(system, self.balls))

    def _hold(self, held: bool) -> None:
        message = _RECORDING if held else None
        self._known = replace(self._known, state=OrientationState(state="working", message=message))


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
