"""The desk at which a log is measured by hand: its frames, its operators' sessions, and the geometry between images."""

import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Final

import numpy as np

from analysis.cameras.source import Source
from analysis.digitizing.computing import Computing
from analysis.digitizing.effective import covariance_of, effective
from analysis.digitizing.epipolar import epipolar_curves
from analysis.digitizing.files import DeskFiles
from analysis.digitizing.journal import SUFFIX, Entered, Journal, Key, operators
from analysis.digitizing.landmarks import NAME, Template, read_landmarks
from analysis.digitizing.misfits import Misfits
from analysis.digitizing.next_mark import next_mark
from analysis.digitizing.opened_log import OpenedLog
from analysis.digitizing.orienting import WAIT, Orienting
from analysis.digitizing.pulse_marks import PulseMarks
from analysis.digitizing.pulse_view import as_mark, pulse_view
from analysis.digitizing.repeatability import repeatability
from analysis.digitizing.session import Session
from analysis.digitizing.solved import Solved
from analysis.digitizing.space import Ray, intersected, predicted_points, space_points
from analysis.digitizing.things import BALL, things
from analysis.measurements.file import read_measurements
from analysis.measurements.model import Measurements, PulseMeasurements
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import (
    Action,
    Changed,
    Changes,
    Curve,
    Estimate,
    Geometry,
    HandResult,
    JumpSpan,
    Mark,
    Opening,
    OrientationState,
    PulseView,
    Repeatability,
    SessionView,
    Suggestion,
    TapeOrder,
    Touched,
    ViewedCamera,
    Worst,
)
from rig.arrays import Floats
from rig.errors import BadInputError, StateForbidsError, UnknownCameraError, UnknownRecordingError
from rig.phrase import phrase

#: So many pulses are looked at for the next click; a jump has a hundred or two.
_SUGGESTED_PULSES: Final = 300


class Desk:
    """One log. Any thread may call any method.

    Args:
        files: the log and what lies beside it.
        source: reads survey or poses; gives None if nobody named any.
        busy: whether a recording runs, which nothing here may disturb: what takes seconds is refused then, or waits;
            None: nothing is recorded on this computer.

    Raises:
        BadInputError: no such log, or it holds no pulse.
    """

    def __init__(
        self, files: DeskFiles, source: Callable[[], Source | None], busy: Callable[[], bool] | None = None
    ) -> None:
        self.files, self._busy = files, busy or (lambda: False)
        self.log = OpenedLog(files.log)
        self.orienting = Orienting(self.log, source, busy)
        self.computing = Computing(files.log, files.folder, busy)
        self._sessions: dict[str, Session] = {}
        self._solved = Solved()
        self._misfits: dict[str, Misfits] = {}
        self._lock = threading.Lock()
        self._automatic: tuple[tuple[int, int] | None, Measurements | None] = (None, None)
        self._by_pulse: dict[int, PulseMeasurements] = {}
        self.orienting.begin()

    def require_idle(self) -> None:
        """Refuse what takes seconds while a recording runs.

        Raises:
            StateForbidsError: one runs.
        """
        if self._busy():
            raise StateForbidsError(
                phrase(
                    "hand_recording_runs",
                    "a recording runs, and this would take the computer's time: try again after it",
                )
            )

    def close(self) -> None:
        """Let other programs measure in this log."""
        self.orienting.close()
        self.computing.close()
        with self._lock:
            for session in self._sessions.values():
                session.close()
            self._sessions.clear()
            self._misfits.clear()

    def opening(self) -> Opening:
        """What a page needs to begin.

        Raises:
            BadInputError: the file of further landmarks is wrong.
        """
        system = self.orienting.system
        facts, known = self.log.facts, self.orienting.balls
        return Opening(
            recording=facts.recording,
            rate_hz=facts.rate_hz,
            cameras=[
                ViewedCamera(name=name, size=camera.size, oriented=system is not None and name in system.names)
                for name, camera in facts.cameras.items()
            ],
            pulses=self.log.pulses,
            status=self.log.status,
            things=things(() if known is None else known.names, self._templates()),
            orientation=self.orienting.state,
            operators=operators(self.files.folder),
            jump=self._span(),
        )

    def orient(self, operator: str | None) -> OrientationState:
        """Orient the cameras again: by the balls that an operator clicked, or by those that the images show."""
        if operator is None:
            return self.orienting.begin()
        marks = {key: entered for key, entered in self.session(operator).everything() if key.thing.startswith(BALL)}
        return self.orienting.begin(marks)

    def session(self, operator: str) -> Session:
        """The session of an operator, opened at the first call.

        Raises:
            BadInputError, StorageError: of its journal.
        """
        with self._lock:
            if operator not in self._sessions:
                path = self.files.folder / f"{operator}{SUFFIX}"
                self._sessions[operator] = Session(Journal(path, self.log.facts.recording, operator))
            return self._sessions[operator]

    def session_view(self, operator: str) -> SessionView:
        """The state of an operator's session."""
        session = self.session(operator)
        balls: dict[str, dict[str, Mark]] = {}
        coverage = session.coverage()
        for thing, cameras in coverage.items():
            if thing.startswith(BALL):
                for camera, pulses in cameras.items():
                    for pulse in pulses:
                        key = Key(pulse, camera, thing)
                        balls.setdefault(camera, {})[thing] = as_mark(key, session.at(pulse)[key])
        return SessionView(
            revision=session.revision,
            undo=session.undo_depth,
            redo=session.redo_depth,
            coverage=coverage,
            worst=self._worst(operator, session),
            balls=balls,
        )

    def view(self, operator: str, pulse: int) -> PulseView:
        """Everything about one pulse.

        Raises:
            UnknownRecordingError: the log has no such pulse.
        """
        session = self.session(operator)
        at = self._index(pulse)
        before = tuple(self._marks(session, self.log.pulses[k]) for k in (at - 1, at - 2) if k >= 0)
        return pulse_view(
            session.revision, self._marks(session, pulse), before,
            self.orienting.system, self.orienting.proposals(), self._solved,
        )  # fmt: skip

    def act(self, operator: str, action: Action) -> Changed:
        """Do what an operator asked for; it is on the disk when this returns.

        Raises:
            UnknownRecordingError, UnknownCameraError: the log has no such pulse or camera.
            BadInputError: the action does not fit, such as a vertex of a point.
            StorageError: the disk refuses; nothing was changed.
        """
        session = self.session(operator)
        if action.do in {"place", "state", "remove"}:
            self._index(action.pulse)
            self._camera(action.camera)
        touched = session.act(action)
        return self._changed(operator, session, touched)

    def put(self, operator: str, marks: Iterable[tuple[Key, Entered]], clear: Collection[Key] = ()) -> Changed:
        """Set many marks by one action, such as those of a track or a file; one undo takes all back.

        Raises:
            StorageError: the disk refuses; nothing was changed.
        """
        session = self.session(operator)
        return self._changed(operator, session, session.put(marks, clear))

    def suggestion(self, operator: str) -> Suggestion | None:
        """Where one more click lowers the sigmas most; None: nowhere, or no point is known in space yet.

        Raises:
            StateForbidsError: no camera is oriented.
        """
        system, session = self.oriented(), self.session(operator)
        span = self._span()
        ends = [*session.pulses(), *((span.first, span.last) if span else ())]
        if not ends:
            return None
        pulses = self.log.pulses[self._index(min(ends)) : self._index(max(ends)) + 1][:_SUGGESTED_PULSES]
        marks = [self._marks(session, pulse) for pulse in pulses]
        return next_mark(system, marks, self.log.has, self.log.facts.rate_hz)

    def changes(self, operator: str, since: int, wait_s: float) -> Changes:
        """What changed after a revision; waits for a change if there is none yet."""
        revision, touched = self.session(operator).changes(since, wait_s)
        return Changes(revision=revision, touched=touched)

    def geometry(self, operator: str, pulse: int, camera: str, thing: str, xy: tuple[float, float]) -> Geometry:
        """What one place in one image means for the others.

        Raises:
            UnknownRecordingError, UnknownCameraError: the log has no such pulse or camera.
            StateForbidsError: the camera is not oriented.
        """
        self._index(pulse)
        self._camera(camera)
        system = self.oriented()
        if camera not in system.names:
            return Geometry(curves={}, space=None, predicted={})
        place, covariance = np.array(xy, float), covariance_of(Entered(xy=xy))
        curves = epipolar_curves(system, camera, place, covariance)
        others = self._marks(self.session(operator), pulse).rays().get(thing, {})
        found = intersected(system, {thing: {**others, camera: Ray(place, covariance)}})
        return Geometry(
            curves={
                name: Curve(line=_list(curve.line), low=_list(curve.low), high=_list(curve.high))
                for name, curve in curves.items()
                if len(curve.line)
            },
            space=space_points(system, found)[thing],
            predicted={name: points[thing] for name, points in predicted_points(system, found).items()},
        )

    def tape(self, order: TapeOrder) -> Estimate:
        """The distance between two things that were clicked in two images or more each.

        Raises:
            BadInputError: their rays do not give both places.
            StateForbidsError: no camera is oriented.
        """
        system = self.oriented()
        clicks = {
            end: {camera: Ray(np.array(xy), covariance_of(Entered(xy=xy))) for camera, xy in places.items()}
            for end, places in (("start", order.start), ("end", order.end))
        }
        found = intersected(system, clicks).adjusted
        if not found.ok.all():
            raise BadInputError(
                phrase("hand_ends", "the clicks do not give both ends: click each in two images or more")
            )
        way = found.state[1] - found.state[0]
        length = float(np.linalg.norm(way))
        if not length:
            return Estimate(value=0.0, sigma=float(np.sqrt(np.trace(found.image_covariance.sum(axis=0)))))
        along = way / length
        influence = along @ (found.by_calibration[1] - found.by_calibration[0])
        variance = along @ found.image_covariance.sum(axis=0) @ along + influence @ system.covariance @ influence
        return Estimate(value=length, sigma=float(np.sqrt(variance)))

    def measurements(self, operator: str) -> Measurements:
        """What counts of the automatic measurement and of an operator's marks."""
        return effective(self.automatic() or self.log.unmeasured, self.session(operator).everything(), self.log.times)

    def repeatability(self, names: Sequence[str]) -> Repeatability:
        """How operators agree in what all of them measured.

        Raises:
            BadInputError: too few operators, one who has measured nothing, or too little in common.
        """
        known = operators(self.files.folder)
        if strange := [name for name in names if name not in known]:
            raise BadInputError(
                phrase(
                    "hand_strangers",
                    "{names} measured nothing here; these did: {known}",
                    names=", ".join(strange),
                    known=", ".join(known) or "-",
                )
            )
        sessions = {name: self.session(name) for name in names}
        marks = {name: session.everything() for name, session in sessions.items()}
        return repeatability(marks, {name: self._figures(session) for name, session in sessions.items()})

    def compute(self, operator: str) -> HandResult:
        """Begin to compute from an operator's marks.

        Raises:
            StateForbidsError: nobody told where the balls are.
        """

        def order() -> tuple[Measurements, Source]:
            source = self.orienting.for_analysis
            if source is None:
                raise StateForbidsError(
                    phrase(
                        "hand_no_space",
                        "nothing can be computed in space: {why}",
                        why=self.orienting.state.message or WAIT,
                    )
                )
            return self.measurements(operator), source

        return self.computing.begin(operator, order)

    def automatic(self) -> Measurements | None:
        """What was measured automatically in this log; None: nothing yet."""
        path = self.files.measured / "measurements.json"
        try:
            state = path.stat()
        except OSError:
            return None
        stamp = state.st_mtime_ns, state.st_ino
        with self._lock:
            if self._automatic[0] != stamp:
                found = read_measurements(path)
                self._automatic = stamp, found
                self._by_pulse = {int(pulse.pulse): pulse for jump in found.jumps for pulse in jump.pulses}
            return self._automatic[1]

    def automatic_at(self, pulse: int) -> PulseMeasurements | None:
        """What was measured automatically at a pulse; None: nothing."""
        self.automatic()
        return self._by_pulse.get(pulse)

    def oriented(self) -> CameraSystem:
        """The oriented cameras.

        Raises:
            StateForbidsError: there are none yet.
        """
        if (system := self.orienting.system) is None:
            raise StateForbidsError(
                phrase(
                    "hand_not_oriented", "the cameras are not oriented: {why}", why=self.orienting.state.message or WAIT
                )
            )
        return system

    def _templates(self) -> tuple[Template, ...]:
        path = self.files.landmarks or self.files.log.parent / NAME
        return read_landmarks(path) if self.files.landmarks or path.exists() else ()

    def _changed(self, operator: str, session: Session, touched: Touched | None) -> Changed:
        view = None
        if touched is not None:
            view = self.view(operator, touched.pulse)
        return Changed(
            revision=session.revision, undo=session.undo_depth, redo=session.redo_depth, touched=touched, view=view
        )

    def _marks(self, session: Session, pulse: int) -> PulseMarks:
        return PulseMarks(pulse, self.log.times[pulse], session.at(pulse), self.automatic_at(pulse))

    def _worst(self, operator: str, session: Session) -> list[Worst]:
        system = self.orienting.system
        if system is None:
            return []
        with self._lock:
            misfits = self._misfits.setdefault(operator, Misfits(session))
        return misfits.worst(
            system,
            self.automatic(),
            lambda pulses: [self._marks(session, pulse) for pulse in pulses if pulse in self.log.times],
        )

    def _figures(self, session: Session) -> dict[int, dict[str, float]]:
        """Angles and height that follow from an operator's marks alone, by pulse."""
        system = self.orienting.system
        if system is None:
            return {}
        return {
            pulse: {name: estimate.value for name, estimate in view.figures.items()}
            for pulse in session.pulses()
            if pulse in self.log.times
            and (
                view := pulse_view(
                    0, PulseMarks(pulse, self.log.times[pulse], session.at(pulse), None), (), system, {}, self._solved
                )
            )
        }

    def _span(self) -> JumpSpan | None:
        found = self.automatic()
        if found is None or not found.jumps:
            return None
        pulses = found.jumps[0].pulses
        return JumpSpan(first=int(pulses[0].pulse), last=int(pulses[-1].pulse), takeoff=None)

    def _index(self, pulse: int) -> int:
        at = int(np.searchsorted(self.log.pulses, pulse))
        if at == len(self.log.pulses) or self.log.pulses[at] != pulse:
            first, last = self.log.pulses[0], self.log.pulses[-1]
            raise UnknownRecordingError(
                phrase(
                    "hand_no_pulse",
                    "the log has no pulse {pulse}: it goes from {first} to {last}",
                    pulse=pulse,
                    first=first,
                    last=last,
                )
            )
        return at

    def _camera(self, name: str) -> None:
        if name not in self.log.facts.cameras:
            raise UnknownCameraError(
                phrase(
                    "hand_no_camera",
                    "the log has no camera {camera}: choose among {cameras}",
                    camera=name,
                    cameras=", ".join(self.log.facts.cameras),
                )
            )


def _list(line: Floats) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in np.round(line, 3)]
