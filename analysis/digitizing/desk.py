"""The desk at which a log is measured by hand: its frames, its operators' sessions, and the geometry between images."""

import threading
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import Final

from analysis.cameras.source import Source
from analysis.digitizing.files import DeskFiles
from analysis.digitizing.geometry.at_pointer import geometry_of, length_of
from analysis.digitizing.geometry.misfits import Misfits
from analysis.digitizing.geometry.next_mark import next_mark
from analysis.digitizing.geometry.pulse_marks import PulseMarks
from analysis.digitizing.geometry.pulse_view import balls_of, figures_of, pulse_view
from analysis.digitizing.geometry.repeatability import repeatability
from analysis.digitizing.geometry.solved import Solved
from analysis.digitizing.marks.automatic import Automatic
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.landmarks import NAME, Template, read_landmarks
from analysis.digitizing.marks.session import Session
from analysis.digitizing.marks.sessions import Sessions
from analysis.digitizing.marks.things import things
from analysis.digitizing.opened_log import OpenedLog
from analysis.digitizing.programs.programs import Programs
from rig.api.digitizing import (
    Action,
    Changed,
    Changes,
    Estimate,
    Geometry,
    Opening,
    PulseView,
    Repeatability,
    SessionView,
    Suggestion,
    TapeOrder,
    Touched,
    ViewedCamera,
    Worst,
)

#: So many pulses are looked at for the next click; a jump has a hundred or two.
_SUGGESTED_PULSES: Final = 300


class Desk:
    """One log. Any thread may call any method.

    Args:
        files: the log and what lies beside it.
        source: reads survey or poses; gives None if nobody named any.
        busy: whether a recording runs, so that what takes seconds stands still; None: nothing is recorded on this
            computer.

    Raises:
        BadInputError: no such log, or it holds no pulse.
    """

    def __init__(
        self, files: DeskFiles, source: Callable[[], Source | None], busy: Callable[[], bool] | None = None
    ) -> None:
        self.files = files
        self.log = OpenedLog(files.log)
        self.automatic = Automatic(files.measured)
        self.sessions = Sessions(files.folder, self.log.facts.recording)
        self.programs = Programs(files, self.log, self.sessions, self.automatic, source, busy)
        self._solved = Solved()
        self._misfits: dict[str, Misfits] = {}
        self._lock = threading.Lock()
        self.programs.orient(None)

    def close(self) -> None:
        """Let other programs measure in this log."""
        self.programs.close()
        self.sessions.close()
        with self._lock:
            self._misfits.clear()

    def opening(self) -> Opening:
        """What a page needs to begin.

        Raises:
            BadInputError: the file of further landmarks is wrong.
        """
        system = self.programs.orienting.system
        facts, known = self.log.facts, self.programs.orienting.balls
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
            orientation=self.programs.orienting.state,
            operators=self.sessions.names(),
            jump=self.automatic.span(),
        )

    def session(self, operator: str) -> Session:
        """The session of an operator, opened at the first call.

        Raises:
            BadInputError, StorageError: of its journal.
        """
        return self.sessions.of(operator)

    def session_view(self, operator: str) -> SessionView:
        """The state of an operator's session."""
        session = self.session(operator)
        return SessionView(
            revision=session.revision,
            undo=session.undo_depth,
            redo=session.redo_depth,
            coverage=session.coverage(),
            worst=self._worst(operator, session),
            balls=balls_of(session),
        )

    def view(self, operator: str, pulse: int) -> PulseView:
        """Everything about one pulse.

        Raises:
            UnknownRecordingError: the log has no such pulse.
        """
        session = self.session(operator)
        at = self.log.index(pulse)
        before = tuple(self._marks(session, self.log.pulses[k]) for k in (at - 1, at - 2) if k >= 0)
        return pulse_view(
            session.revision, self._marks(session, pulse), before,
            self.programs.orienting.system, self.programs.orienting.proposals(), self._solved,
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
            self.log.index(action.pulse)
            self.log.require_camera(action.camera)
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
        system, session = self.programs.oriented(), self.session(operator)
        span = self.automatic.span()
        ends = [*session.pulses(), *((span.first, span.last) if span else ())]
        if not ends:
            return None
        pulses = self.log.pulses[self.log.index(min(ends)) : self.log.index(max(ends)) + 1][:_SUGGESTED_PULSES]
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
            StateForbidsError: no camera is oriented.
        """
        self.log.index(pulse)
        self.log.require_camera(camera)
        others = self._marks(self.session(operator), pulse).rays().get(thing, {})
        return geometry_of(self.programs.oriented(), camera, thing, xy, others)

    def tape(self, order: TapeOrder) -> Estimate:
        """The distance between two things that were clicked in two images or more each.

        Raises:
            BadInputError: their rays do not give both places.
            StateForbidsError: no camera is oriented.
        """
        return length_of(self.programs.oriented(), order)

    def repeatability(self, names: Sequence[str]) -> Repeatability:
        """How operators agree in what all of them measured.

        Raises:
            BadInputError: too few operators, one who has measured nothing, or too little in common.
        """
        self.sessions.require(names)
        sessions = {name: self.session(name) for name in names}
        marks = {name: session.everything() for name, session in sessions.items()}
        return repeatability(marks, {name: self._figures(session) for name, session in sessions.items()})

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
        return PulseMarks(pulse, self.log.times[pulse], session.at(pulse), self.automatic.at(pulse))

    def _worst(self, operator: str, session: Session) -> list[Worst]:
        system = self.programs.orienting.system
        if system is None:
            return []
        with self._lock:
            misfits = self._misfits.setdefault(operator, Misfits(session))
        return misfits.worst(
            system,
            self.automatic.all(),
            lambda pulses: [self._marks(session, pulse) for pulse in pulses if pulse in self.log.times],
        )

    def _figures(self, session: Session) -> dict[int, dict[str, float]]:
        """Angles and height that follow from an operator's marks alone, by pulse."""
        system = self.programs.orienting.system
        if system is None:
            return {}
        pulses = [pulse for pulse in session.pulses() if pulse in self.log.times]
        alone = (PulseMarks(pulse, self.log.times[pulse], session.at(pulse), None) for pulse in pulses)
        return {each.pulse: figures_of(each, system, self._solved) for each in alone}
