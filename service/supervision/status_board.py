"""The status that other threads read: renewed when something has changed, and once a second."""

import time
from collections.abc import Callable, Sequence
from typing import Final

from rig.api.jump import LastJump
from rig.api.status import State, Status
from rig.events import COMPUTER, Event, Level
from rig.health import Health
from rig.host.disk import free_bytes
from rig.transport.analysis_messages import JumpMeasured, Measuring
from rig.transport.recorder_commands import RecorderOptions
from rig.transport.recorder_reports import RecorderHealth
from service.alarms.keeper import AlarmKeeper
from service.alarms.unrecorded import Unrecorded
from service.jumpers.book import JumperBook
from service.processes.rig_programs import ANALYSIS, TRIGGER
from service.processes.seen import Processes
from service.recordings import live_results
from service.status.event_hub import EventHub
from service.status.statements import measured, too_slow
from service.supervision.messages import (
    Acknowledge,
    JumpsKnown,
    Message,
    MotionSeen,
    NotBegun,
    TurnBegins,
    TurnEnds,
)
from service.supervision.overload import Overload
from service.supervision.picture import Beside, picture
from service.supervision.situation import Moment, Situation

_RENEWED_S: Final = 1.0


class StatusBoard:
    """Only the supervisor's thread uses it; any thread may read `status`.

    Args:
        hub: is woken when the status is new.
        jumpers: the jumper of the next recording.
        recorder: the folder of the recordings, and what is to be held in memory.
        tell: takes an event for the live log and for the log of a recording.
        now: the situation.

    Attributes:
        status: the latest status, at most a second old.
    """

    def __init__(
        self,
        hub: EventHub,
        jumpers: JumperBook,
        recorder: RecorderOptions,
        tell: Callable[[Event], None],
        now: Situation,
    ) -> None:
        self._hub, self._jumpers, self._recorder, self._tell = hub, jumpers, recorder, tell
        self._shown, self._changed, self._renewed_at = now, False, 0.0
        self._alarms, self._overload = AlarmKeeper(now.in_use.rig, tell), Overload(now.in_use.rig.trigger.period_ns)
        self._unrecorded = Unrecorded()
        self._last_jump = live_results.latest(recorder.directory) if now.in_use.rig.analysis else None
        self.status = self._picture(now)

    def note(self, message: Message, now: Situation) -> None:
        """Note what a message says of alarms and jumps.

        Raises:
            UnknownAlarmError: an alarm that somebody has seen is over.
        """
        self._changed = self._changed or not isinstance(message, TurnBegins | TurnEnds)
        match message:
            case TurnBegins():
                self._forget(now)
            case RecorderHealth():
                self._look(message.health, now)
            case Measuring():
                self._alarms.measuring(message.refused)
            case JumpMeasured():
                self._last_jump = message.jump
                self._tell(_event(message.jump))
            case JumpsKnown():
                self._know(message.jumps)
            case Acknowledge():
                self._alarms.acknowledge(message.alarm)
            case MotionSeen():
                self._unrecorded.moved(time.monotonic())
            case NotBegun():
                self._unrecorded.refused(message.why)

    def renew(self, now: Situation, *, at_once: bool = False) -> None:
        """Renew the status if something has changed, or a second has passed."""
        moment = time.monotonic()
        moved = now.phase is not self._shown.phase or now.recordings is not self._shown.recordings
        if not (at_once or self._changed or moved or moment >= self._renewed_at + _RENEWED_S):
            return
        self._shown, self._changed, self._renewed_at = now, False, moment
        recording = now.recordings.current is not None
        waits = now.state is State.ARMED and not recording
        said = self._unrecorded.look(self._jumpers.view(), waits=waits, recording=recording, now=moment)
        self._alarms.unrecorded(said)
        self.status = self._picture(now)
        if not now.recordings.opening:
            self._jumpers.announce()
        self._hub.wake()

    def _forget(self, now: Situation) -> None:
        """Forget what was wrong with processes that do not run any more, or were of another rig."""
        if now.in_use.rig is not self._shown.in_use.rig:
            self._alarms.use(now.in_use.rig)
            self._overload = Overload(now.in_use.rig.trigger.period_ns)
        if now.seen.processes is not Processes.ALL:
            self._alarms.forget()
            self._overload.forget()
        if now.seen.processes is Processes.NONE:
            self._alarms.end()

    def _look(self, health: Health, now: Situation) -> None:
        """Look what is wrong, and whether the computer is too slow; say so when that begins."""
        before = self._overload.cameras
        fetching = {name: pid for name, pid in now.seen.pids.items() if name not in {ANALYSIS, TRIGGER}}
        self._overload.look(health, fetching, time.monotonic())
        if self._overload.cameras and not before:
            late = [now.in_use.rig.cameras[index].name for index in self._overload.cameras]
            self._tell(Event.now(Level.WARNING, COMPUTER, too_slow(late)))
        self._alarms.look(health, self._overload.cameras, still=now.seen.still)

    def _know(self, jumps: Sequence[LastJump]) -> None:
        """Take the results of a whole log in place of those that were measured live."""
        for jump in jumps:
            self._hub.tell(_event(jump))
        known, last = self._last_jump, jumps[-1]
        if known is None or known.recording == last.recording or known.time <= last.time:
            self._last_jump = last

    def _picture(self, now: Situation) -> Status:
        # The recorder asks the disk in its own time; asking here as well might wait for a disk that hangs.
        health = now.seen.health
        free = health.disk.free_bytes if health else free_bytes(self._recorder.directory)
        beside = Beside(
            at=Moment.now(),
            alarms=self._alarms.present,
            overloaded=self._overload.cameras,
            free_bytes=free or 0,
            preroll_s=self._recorder.preroll_s,
            last_jump=self._last_jump,
            next_jumper=self._jumpers.shown if now.recordings.opening else self._jumpers.view().next,
        )
        return picture(now, beside)


def _event(jump: LastJump) -> Event:
    level = Level.INFO if jump.ok or jump.live else Level.WARNING
    return Event.now(level, "analysis", measured(jump))
