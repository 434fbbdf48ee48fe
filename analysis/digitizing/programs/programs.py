"""What programs beside the service do for one log: they orient its cameras, follow what was marked, compute jumps."""

from collections.abc import Callable

from analysis.cameras.source import Source
from analysis.digitizing.files import DeskFiles
from analysis.digitizing.marks.automatic import Automatic
from analysis.digitizing.marks.effective import effective
from analysis.digitizing.marks.sessions import Sessions
from analysis.digitizing.marks.things import BALL
from analysis.digitizing.opened_log import OpenedLog
from analysis.digitizing.programs.computing import Computing
from analysis.digitizing.programs.curves import Curves, CurvesOrder
from analysis.digitizing.programs.orienting import WAIT, Orienting
from analysis.digitizing.programs.tracking import Follower
from analysis.measurements.model import Measurements
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import HandCurves, HandResult, OrientationState, Tracking, TrackOrder
from rig.errors import StateForbidsError
from rig.phrase import phrase


class Programs:
    """Any thread may call any method.

    Args:
        files: the log and what lies beside it.
        log: the log.
        sessions: of its operators.
        automatic: what was measured automatically.
        source: reads survey or poses; gives None if nobody named any.
        busy: whether a recording runs, so that programs stand still; None: nothing is recorded on this computer.
    """

    def __init__(
        self, files: DeskFiles, log: OpenedLog, sessions: Sessions, automatic: Automatic,
        source: Callable[[], Source | None], busy: Callable[[], bool] | None,
    ) -> None:  # fmt: skip
        self._log, self._sessions, self._automatic = log, sessions, automatic
        self.orienting = Orienting(log, source, busy)
        self.computing = Computing(files.log, files.folder, busy)
        self._curves = Curves(busy)
        self.follower = Follower(files.log, sessions.of, busy)

    def close(self) -> None:
        """End what is being done."""
        self.orienting.close()
        self.computing.close()
        self._curves.close()
        self.follower.close()

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

    def orient(self, operator: str | None) -> OrientationState:
        """Orient the cameras again: by the balls that an operator clicked, or by those that the images show."""
        if operator is None:
            return self.orienting.begin()
        marks = self._sessions.of(operator).everything()
        return self.orienting.begin({key: entered for key, entered in marks if key.thing.startswith(BALL)})

    def follow(self, operator: str, order: TrackOrder) -> Tracking:
        """Begin to follow things from a pulse at which they are marked.

        Raises:
            UnknownRecordingError: the log has no such pulse.
            BadInputError: none of the things is marked there.
            StateForbidsError: skis are to be found more exactly, and the cameras are not oriented.
        """
        self._log.index(order.pulse)
        system = self.oriented() if order.most == 0 else self.orienting.system
        return self.follower.begin(operator, order, system, self._automatic.all())

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

    def curves(self, operator: str) -> HandCurves:
        """The curves of an operator's marks as far as they are known; if there are newer marks, they follow."""
        session, system, automatic = self._sessions.of(operator), self.orienting.system, self._automatic.all()
        revision = session.revision
        if system is None or (automatic is None and not revision):
            return HandCurves(state="none")
        # Marks of other pulses, be they many, would only delay the clicks meanwhile.
        return self._curves.of(operator, (revision, automatic, system), lambda: CurvesOrder(
            revision, automatic or self._log.unmeasured,
            tuple(item for pulse in self._log.pulses for item in session.at(pulse).items()), self._log.times, system,
        ))  # fmt: skip

    def measurements(self, operator: str) -> Measurements:
        """What counts of the automatic measurement and of an operator's marks."""
        automatic = self._automatic.all() or self._log.unmeasured
        return effective(automatic, self._sessions.of(operator).everything(), self._log.times)
