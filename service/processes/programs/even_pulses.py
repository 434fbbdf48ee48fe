"""The program of the process that makes pulses at even times: on a line of the computer, or as commands on a bus."""

import gc
import itertools
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Final

from rig.clocks import HostNs
from rig.errors import CameraError, CameraNotFoundError, TriggerError
from rig.events import TRIGGER, Event, Level
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from rig.settings.trigger import GpioTrigger, IidcBroadcastTrigger
from rig.transport.child import ChildContext, begin
from rig.transport.recorder_commands import PulsesFired, TellPulses
from rig.transport.trigger_messages import LetPulses, TriggerCommand, TriggerConfig, TriggerTold
from service.processes.priority import MAKING_PULSES, allowed_priority, prefer_this_process
from triggering.alarms.notices import LatenessTeller
from triggering.sources.gate import Gate
from triggering.sources.gpio.pulser import Pulser
from triggering.sources.gpio.timer import Timer

#: A pulse and the line that is made inactive.
_GRACE_S: Final = 2.0
#: The recorder hears of pulses as often as of those of a trigger box, and of the figures every so many times.
_TELL_EVERY_S: Final = 0.1
_FIGURES_EVERY: Final = 5
_RETRY_S: Final = 2.0
#: Python hands over to a thread that waits for it after so long: a pulse does not wait longer for a report.
_SWITCH_S: Final = 1e-4


def main() -> None:
    """Make pulses until told to quit; a line that cannot be had is tried again."""
    child = begin(TriggerConfig, TriggerCommand, _GRACE_S)
    rig = child.config.rig
    if not isinstance(rig.trigger, GpioTrigger | IidcBroadcastTrigger):
        raise SystemExit(f'trigger: source "{rig.trigger.source}" makes no pulses at even times of this computer')
    sys.setswitchinterval(_SWITCH_S)
    gc.freeze()  # a collection looks only at what comes from now on
    realtime = prefer_this_process(allowed_priority(), MAKING_PULSES)
    if not realtime:
        text = (
            "pulses are made without real-time priority, so other programs delay them: run svev as a service, or "
            "allow it in this shell with sudo prlimit --rtprio=20 --pid $$"
        )
        _tell(child, Level.WARNING, phrase("gpio_no_realtime", text))
    said, gate = "", Gate(still=child.config.still)
    child.on_command = partial(_obey, gate)
    while True:
        try:
            with _output(rig) as output, Timer() as timer:
                _Maker(output, timer, rig.trigger, child.config.epoch, gate).make(child, realtime=realtime)
                return
        except TriggerError as error:
            if str(error) != said:
                said = str(error)
                _tell(child, Level.ERROR, error.said)
        if child.stops_within(_RETRY_S):
            return


def _obey(gate: Gate, command: TriggerCommand) -> None:
    if isinstance(command, LetPulses):
        gate.let(command.pulses)


@dataclass(frozen=True, slots=True)
class _Output:
    """What makes a pulse.

    Attributes:
        name: for people.
        set: begins a pulse (True), ends it (False).
        is_open: whether a gate outside lets pulses through; None: there is none.
    """

    name: str
    set: Callable[[bool], None]
    is_open: Callable[[], bool] | None = None


@contextmanager
def _output(rig: RigSettings) -> Iterator[_Output]:
    """What makes the pulses of a rig, while it can be had; only one of the libraries need be there.

    Raises:
        TriggerError: it cannot be had.
    """
    with _line(rig.trigger) if isinstance(rig.trigger, GpioTrigger) else _broadcast(rig) as output:
        yield output


@contextmanager
def _line(trigger: GpioTrigger) -> Iterator[_Output]:
    from triggering.sources.gpio.lines import InputLine, OutputLine  # noqa: PLC0415

    with ExitStack() as gates:
        is_open = None
        if (gate := trigger.gate) is not None:
            is_open = gates.enter_context(InputLine(trigger.chip, gate.line, active_low=gate.active_low)).active
        with OutputLine(trigger.chip, trigger.line, active_low=trigger.active_low) as line:
            yield _Output(line.name, line.set, is_open)


@contextmanager
def _broadcast(rig: RigSettings) -> Iterator[_Output]:
    from capture.iidc.broadcast import Broadcast  # noqa: PLC0415

    def fire(active: bool) -> None:
        if active:
            with _as_trigger_error():
                broadcast.fire()

    with _as_trigger_error():
        broadcast = Broadcast([int(camera.address, 16) for camera in rig.cameras])
    with broadcast:
        yield _Output(broadcast.name, fire)


@contextmanager
def _as_trigger_error() -> Iterator[None]:
    try:
        yield
    except (CameraError, CameraNotFoundError) as error:
        text = "commands cannot be given to the FireWire cameras: {why}"
        raise TriggerError(phrase("broadcast_fails", text, why=str(error))) from error


class _Maker:
    """What makes pulses, and the thread that has it do so."""

    def __init__(
        self, output: _Output, timer: Timer, trigger: GpioTrigger | IidcBroadcastTrigger, origin: HostNs, gate: Gate
    ) -> None:
        self._name, self._timer = output.name, timer
        self._pulser = Pulser(output.set, timer, origin, trigger.rate_hz, trigger.width_ns, gate, output.is_open)
        self._failure: TriggerError | None = None

    def make(self, child: ChildContext[TriggerConfig], *, realtime: bool) -> None:
        """Make pulses until told to quit.

        Raises:
            TriggerError: the line fails.
        """
        thread = threading.Thread(target=self._run, name="pulses")
        thread.start()
        teller, turns, stopping = LatenessTeller(self._name), itertools.count(1), False
        try:
            while not stopping and thread.is_alive():
                stopping = child.stops_within(_TELL_EVERY_S)
                self._tell_fired(child)
                if next(turns) % _FIGURES_EVERY:
                    continue
                made = self._pulser.figures(realtime=realtime)
                child.control.send(TellPulses(made=made))
                for level, said in teller.tell(made):
                    _tell(child, level, said)
        finally:
            self._timer.end()
            thread.join()
            self._tell_fired(child)
        if self._failure is not None:
            raise self._failure

    def _tell_fired(self, child: ChildContext[TriggerConfig]) -> None:
        fired, until = self._pulser.fetch()
        child.control.send(
            PulsesFired(
                first=fired[0].number if fired else 0,
                times=tuple(pulse.time for pulse in fired),
                uncertainty_ns=max((pulse.uncertainty_ns for pulse in fired), default=0),
                until=until,
            )
        )

    def _run(self) -> None:
        try:
            self._pulser.run()
        except TriggerError as error:
            self._failure = error


def _tell(child: ChildContext[TriggerConfig], level: Level, said: Phrase) -> None:
    child.control.send(TriggerTold(event=Event.now(level, TRIGGER, said)))


if __name__ == "__main__":
    main()
