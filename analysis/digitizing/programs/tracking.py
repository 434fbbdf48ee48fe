"""Follows what operators marked through the pulses, and keeps what was found as tracked marks by one action.

A program of its own follows, so that measuring goes on as fast as before; while a recording runs it stands still.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from analysis.digitizing.following.follow import require_marked
from analysis.digitizing.following.pursuit import Found
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.session import Session
from analysis.measurements.model import Measurements
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import MarkSource, Tracking, TrackOrder
from rig.background.errands import Errands
from rig.background.messages import Progress


@dataclass(frozen=True, slots=True, eq=False)
class TrackingOrder:
    """What to follow, as `analysis.digitizing.following.pursuit.Pursuit` has it."""

    log: Path
    system: CameraSystem | None
    marks: list[tuple[Key, Entered]]
    measured: Measurements | None
    order: TrackOrder


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """What was ordered, and what was found."""

    order: TrackOrder
    found: Found


class Follower:
    """The following of one log's things, for one operator at a time. Any thread may call any method.

    Args:
        log: the log.
        session: gives the marks of an operator.
        busy: whether a recording runs, so that the work has to stand still; None: nothing is recorded on this computer.
    """

    def __init__(self, log: Path, session: Callable[[str], Session], busy: Callable[[], bool] | None) -> None:
        self._log, self._session = log, session
        self._errands = Errands(
            "analysis.digitizing.programs.tracking_program",
            Tracking(state="none"),
            busy,
            heard=_heard,
            done=lambda operator, followed, _: self._done(operator, followed),
            failed=lambda _, why: Tracking(state="failed", problem=why),
        )

    def begin(
        self, operator: str, order: TrackOrder, system: CameraSystem | None, measured: Measurements | None
    ) -> Tracking:
        """Begin to follow; if something of the operator's is followed already, nothing begins.

        Args:
            operator: whose marks.
            order: what, from where, and how far.
            system: the oriented cameras; None: there are none.
            measured: automatically; None: nothing.

        Raises:
            BadInputError: none of the things is marked there.
        """
        marks = self._session(operator).everything()
        require_marked(order, marks)
        ordered = TrackingOrder(self._log, system, marks, measured, order)
        return self._errands.begin(operator, Tracking(state="tracking"), lambda: ordered)

    def state(self, operator: str) -> Tracking:
        """How far it is, and what it gave."""
        return self._errands.state(operator)

    def wait(self, operator: str, timeout_s: float) -> Tracking:
        """How far it is when it has ended, or after a time."""
        self._errands.wait(operator, timeout_s)
        return self.state(operator)

    def cancel(self, operator: str) -> Tracking:
        """Follow no further, and keep nothing of it."""
        return self._errands.cancel(operator)

    def close(self) -> None:
        """End what is being followed."""
        self._errands.close()

    def _done(self, operator: str, followed: Followed) -> Tracking:
        """Keep what was found; of what a person marked, only skis that were to be refined give way."""
        session, order, found = self._session(operator), followed.order, followed.found
        kept, cleared = list(found.marks.items()), []
        if order.most:
            here = {pulse: session.at(pulse) for pulse in {key.pulse for key, _ in kept}}
            kept = [
                (key, entered)
                for key, entered in kept
                if (now := here[key.pulse].get(key)) is None or now.source is MarkSource.TRACKED
            ]
        else:
            told = {(key.camera, key.thing) for key in found.marks}
            cleared = [
                key for key in session.at(order.pulse) if (key.camera, key.thing) in told and key not in found.marks
            ]
        session.put(kept, cleared)
        pulses = {thing: sorted({key.pulse for key, _ in kept if key.thing == thing}) for thing in found.stopped}
        return Tracking(state="done", share=1.0, tracked=pulses, stopped=found.stopped)


def _heard(state: Tracking, news: Progress | bool) -> Tracking:
    return state.model_copy(update={"paused": news} if isinstance(news, bool) else {"share": news.share})
