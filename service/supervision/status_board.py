"""The status that other threads read: renewed when something has changed, and once a second."""

import time
from collections.abc import Sequence
from typing import Final

from rig.api.jump import LastJump
from rig.api.status import State, Status
from rig.events import Event, Level
from rig.health import Health
from rig.host.disk import free_bytes
from rig.phrase import Phrase
from service.alarms.unrecorded import Unrecorded
from service.jumpers.book import JumperBook
from service.processes.rig_processes import RECORDER
from service.processes.rig_session import RigSession
from service.recordings import live_results
from service.recordings.storage import room_for
from service.status.event_hub import EventHub
from service.status.statements import measured
from service.supervision.fault import Fault
from service.supervision.picture import Facts, picture
from service.supervision.recording_control import RecordingControl
from service.supervision.state_machine import StateMachine
from service.supervision.watching import RecorderWatch

_RENEWED_S: Final = 1.0


class StatusBoard:
    """Only the supervisor's thread uses it; any thread may read `status` and `health`.

    Args:
        hub: is woken when the status is new.
        jumpers: the jumper of the next recording.
        machine: the state machine.
        session: the rig and its processes.
        recordings: the recording in progress.
        fault: the fault of the rig.
        watch: the alarms, and what the recorder reports.

    Attributes:
        status: the latest status, at most a second old.
        health: the recorder's last health record, None if there is none.
    """

    def __init__(
        self,
        hub: EventHub,
        jumpers: JumperBook,
        machine: StateMachine,
        session: RigSession,
        recordings: RecordingControl,
        fault: Fault,
        watch: RecorderWatch,
    ) -> None:
        self._hub, self._jumpers, self._machine, self._session = hub, jumpers, machine, session
        self._recordings, self._fault, self._watch = recordings, fault, watch
        self._unrecorded = Unrecorded()
        self._last_jump = live_results.latest(session.recorder.directory) if session.rig.analysis else None
        self._changed, self._renewed_at = True, 0.0
        self.health: Health | None = None
        self.status = self._picture()

    def change(self) -> None:
        """Note that something has changed, so that the status is renewed at the end of the turn."""
        self._changed = True

    def renew_if_due(self) -> None:
        """Renew the status if something has changed, or a second has passed."""
        if self._changed or time.monotonic() >= self._renewed_at + _RENEWED_S:
            self.renew()

    def renew(self) -> Status:
        """Renew the status now."""
        self._changed, self._renewed_at = False, time.monotonic()
        recording = self._recordings.current is not None
        waits = self._machine.state is State.ARMED and not recording
        said = self._unrecorded.look(self._jumpers.view(), waits=waits, recording=recording, now=self._renewed_at)
        self._watch.alarms.unrecorded(said)
        self.status = self._picture()
        if not self._recordings.opening:
            self._jumpers.announce()
        self._hub.wake()
        return self.status

    def moved(self) -> None:
        """Note that somebody has come into sight, and that no recording begins."""
        self._unrecorded.moved(time.monotonic())

    def not_begun(self, why: Phrase) -> None:
        """Note that a jump came, and why no recording could begin for it."""
        self._unrecorded.refused(why)
        self.renew()

    def jump_measured(self, jump: LastJump) -> None:
        """Take a jump that was measured live."""
        self._last_jump = jump
        self.change()
        self._session.tell(_event(jump))

    def know_jumps(self, jumps: Sequence[LastJump]) -> None:
        """Take the results of a whole log in place of those that were measured live."""
        for jump in jumps:
            self._hub.tell(_event(jump))
        known, last = self._last_jump, jumps[-1]
        if known is None or known.recording == last.recording or known.time <= last.time:
            self._last_jump = last
            self.renew()

    def _picture(self) -> Status:
        session, recordings, phase = self._session, self._recordings, self._machine.phase
        processes, current = session.processes, recordings.current
        self.health = None if processes is None else processes.health
        # The recorder asks the disk in its own time; asking here as well might wait for a disk that hangs.
        free = self.health.disk.free_bytes if self.health else free_bytes(session.recorder.directory)
        facts = Facts(
            phase=phase,
            fault=self._fault.statement if phase.state is State.FAULT else None,
            notice=recordings.notice if phase.state in {State.ARMED, State.RECORDING} else None,
            heard=None if processes is None else tuple(processes.cameras),
            health=self.health,
            warm=processes is not None and processes.warm,
            pulses=self._watch.pulses,
            still=processes is not None and processes.still,
            alarms=self._watch.alarms.present,
            overloaded=self._watch.overload.cameras,
            room=room_for(session.rig, free or 0),
            preroll_s=session.recorder.preroll_s,
            holding_s=time.monotonic() - recordings.emptied_at,
            recording=current.view() if current is not None and not current.opening else None,
            last_recording=recordings.last,
            last_jump=self._last_jump,
            next_jumper=self._jumpers.shown if recordings.opening else self._jumpers.view().next,
            pids={} if processes is None else processes.pids,
            restarts={RECORDER: self._fault.deaths, **(processes.restarts if processes else {})},
        )
        return picture(session.rig, facts)


def _event(jump: LastJump) -> Event:
    level = Level.INFO if jump.ok or jump.live else Level.WARNING
    return Event.now(level, "analysis", measured(jump))
