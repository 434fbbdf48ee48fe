"""Begins recordings at marks: a person's or a program's, motion in an image, the light barrier."""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from typing import Final

from rig.api.automatic import AutomaticChange, JumpMark, Marked
from rig.api.recordings import Recording, RecordingOrder
from rig.api.status import AutomaticStatus, Status
from rig.clocks import NS_PER_S, HostNs, UtcAnchor
from rig.errors import BadInputError, StateForbidsError, SvevError
from rig.events import Event, Level
from rig.phrase import Phrase, phrase
from rig.transport.preview import PreviewSlot
from service.automatic.barrier import BarrierWatch
from service.automatic.watch import MotionWatch
from service.supervision.messages import MotionSeen, NotBegun, Note
from service.supervision.supervisor import Supervisor

#: A mark may be so old, and so far in the future, because clocks differ.
_OLDEST_MARK_S: Final = 60.0
_CLOCKS_DIFFER_S: Final = 1.0


class Marks:
    """Any thread may call any method. What the rig file says of motion and of the barrier is watched from `watch` on.

    Args:
        supervisor: owns the rig.
        slot: shared memory with the newest triplet.
        status: gives the present status.
        record: starts a recording; returns when its log is open.
    """

    def __init__(
        self,
        supervisor: Supervisor,
        slot: PreviewSlot,
        status: Callable[[], Status],
        record: Callable[[RecordingOrder], Recording],
    ) -> None:
        self._supervisor, self._status, self._record = supervisor, status, record
        self._settings = settings = supervisor.rig.automatic
        self._motion = self._barrier = None
        if settings.motion is not None:
            self._motion = MotionWatch(
                lambda: supervisor.rig, settings.motion, slot, lambda: supervisor.status.state, self._moved
            )
        if settings.barrier is not None:
            failed = partial(self._tell, Level.WARNING, "mark")
            self._barrier = BarrierWatch(settings.barrier, lambda: supervisor.status.state, self._crossed, failed)

    @property
    def automatic(self) -> AutomaticStatus | None:
        """Whether motion begins recordings; None: nothing is watched for motion."""
        if self._motion is None or self._settings.motion is None:
            return None
        return AutomaticStatus(on=self._motion.on, camera=self._settings.motion.camera)

    def beam_interrupted(self) -> bool | None:
        """Whether the beam of the light barrier is interrupted; None: there is none, or it is not known."""
        return None if self._barrier is None else self._barrier.interrupted()

    def mark(self, mark: JumpMark) -> Marked:
        """Begin a recording at the mark, with the seconds before; one that runs already only gets the mark.

        Raises:
            BadInputError: the mark is in the future, or too old.
            StateForbidsError: no recording may begin now.
        """
        age_s = _age_s(mark)
        source, age = mark.source or "?", f"{age_s:.1f}"
        said = phrase("event_marked", "a jump is marked by {source}, {age} s ago", source=source, age=age)
        self._supervisor.ask(partial(Note, event=Event.now(Level.INFO, "mark", said)))
        if (running := self._status().recording) is not None:
            return Marked(started=False, recording=running)
        settings = self._settings
        order = RecordingOrder(preroll_s=settings.before_s + age_s, duration_s=max(0.0, settings.after_s - age_s))
        try:
            return Marked(started=True, recording=self._record(order))
        except StateForbidsError:  # another mark came at the same time
            if (running := self._status().recording) is None:
                raise
            return Marked(started=False, recording=running)

    def change(self, change: AutomaticChange) -> None:
        """Let motion begin recordings, or not.

        Raises:
            StateForbidsError: nothing is watched for motion.
        """
        if self._motion is None:
            raise StateForbidsError(
                phrase("motion_unwatched", "nothing is watched for motion: add [automatic.motion] to the rig file")
            )
        if self._motion.on != change.on:
            self._motion.on = change.on
            on = phrase("event_motion_on", "recordings begin by themselves when something moves")
            off = phrase("event_motion_off", "recordings do not begin by themselves any more")
            self._tell(Level.INFO, "motion", on if change.on else off)

    def watch(self) -> None:
        """Begin to watch; `close` ends it."""
        for watch in (self._motion, self._barrier):
            if watch is not None:
                watch.start()

    def close(self) -> None:
        """End the watching."""
        for watch in (self._motion, self._barrier):
            if watch is not None:
                watch.close()

    def _moved(self, time: HostNs) -> None:
        """Begin a recording, because something moves in an image; the thread that watches goes on whatever happens."""
        try:
            if self._motion is not None and self._motion.on:
                self.mark(_mark("motion", time))
                return
            self._supervisor.ask(MotionSeen)
        except SvevError as error:
            self._not_begun("motion", error.said)

    def _crossed(self, time: HostNs) -> None:
        """Begin a recording, because the light barrier is interrupted; its thread goes on whatever happens."""
        try:
            self.mark(_mark("light barrier", time))
        except SvevError as error:
            self._not_begun("mark", error.said)

    def _not_begun(self, name: str, why: Phrase) -> None:
        """Say that a jump came and no recording could begin: an alarm, until the next one begins."""
        try:
            self._supervisor.ask(partial(NotBegun, why=why))
        except SvevError:  # the service ends, or does not answer: then the log alone can say it
            self._tell(Level.WARNING, name, phrase("event_unrecorded", "no recording could begin: {why}", why=why))

    def _tell(self, level: Level, name: str, said: Phrase) -> None:
        self._supervisor.hub.tell(Event.now(level, name, said))


def _mark(source: str, time: HostNs) -> JumpMark:
    return JumpMark(source=source, time=datetime.fromtimestamp(UtcAnchor.take().utc(time) / NS_PER_S, UTC))


def _age_s(mark: JumpMark) -> float:
    """How long ago it happened, s.

    Raises:
        BadInputError: in the future, or too long ago.
    """
    if mark.time is None:
        return 0.0
    age_s = (datetime.now(UTC) - mark.time).total_seconds()
    if not -_CLOCKS_DIFFER_S < age_s < _OLDEST_MARK_S:
        raise BadInputError(
            phrase(
                "mark_old",
                "the mark is {age:.1f} s old: give a time of the last {most:g} s, by a clock that "
                "agrees with this computer's to a second, or none",
                age=age_s,
                most=_OLDEST_MARK_S,
            )
        )
    return max(0.0, age_s)
