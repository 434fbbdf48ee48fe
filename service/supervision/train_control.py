"""Stops and starts the train of pulses while the rig is armed, and has a number of pulses made on request."""

from collections.abc import Callable

from rig.api.recordings import RecordingOrder
from rig.api.status import State
from rig.errors import StateForbidsError
from rig.events import TRIGGER, Event, Level
from rig.phrase import phrase
from service.processes.rig_session import RigSession
from service.status.forbidden import FORBIDDEN
from service.supervision.recording_control import RecordingControl
from service.supervision.state_machine import StateMachine


class TrainControl:
    """Only the supervisor's thread uses it.

    Args:
        machine: the state machine.
        session: the rig and its processes.
        recordings: while one runs, the train does.
        changed: called when pulses begin or stop.
    """

    def __init__(
        self,
        machine: StateMachine,
        session: RigSession,
        recordings: RecordingControl,
        changed: Callable[[], object],
    ) -> None:
        self._machine, self._session, self._recordings = machine, session, recordings
        self._changed = changed

    @property
    def still(self) -> bool:
        """Whether pulses are made on request only."""
        return self._session.processes is not None and self._session.processes.still

    def run(self, *, running: bool) -> None:
        """Command: start or stop the train; if it is so already, nothing changes.

        Raises:
            StateForbidsError: not armed, or a recording runs.
        """
        self._check()
        if running == self.still:
            self._run(running=running)

    def burst(self, pulses: int) -> None:
        """Command: make so many pulses while the train stands still.

        Raises:
            StateForbidsError: it does not, or the rig is not armed.
        """
        self._check()
        if not self.still:
            raise StateForbidsError(phrase("pulses_run", "the pulses run: stop them, then ask for a number of pulses"))
        self._let(pulses)
        said = phrase("event_burst", "is to make {pulses} pulses", pulses=pulses)
        self._session.tell(Event.now(Level.INFO, TRIGGER, said))

    def needed(self, order: RecordingOrder) -> None:
        """Start the train, if it stands still, for a recording that was just begun; not for one of the past alone."""
        if self.still and order.duration_s != 0:
            self._run(running=True)

    def _run(self, *, running: bool) -> None:
        self._let(None if running else 0)
        started = phrase("event_train_started", "the pulses are started again")
        stopped = phrase("event_train_stopped", "the pulses are stopped on request; a recording starts them again")
        self._session.tell(Event.now(Level.INFO, TRIGGER, started if running else stopped))
        self._changed()

    def _check(self) -> None:
        state = self._machine.state
        if state is not State.ARMED or self._recordings.current is not None:
            raise StateForbidsError(FORBIDDEN["pulses", State.RECORDING if state is State.ARMED else state])

    def _let(self, pulses: int | None) -> None:
        if self._session.processes is not None:
            self._session.processes.let_pulses(pulses)
