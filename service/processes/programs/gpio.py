"""The program of the process that makes the pulses of a line of the computer."""

import gc
import itertools
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Final

from rig.clocks import HostNs
from rig.errors import TriggerError
from rig.events import TRIGGER, Event, Level
from rig.phrase import Phrase, phrase
from rig.settings.trigger import GpioTrigger
from rig.transport.child import ChildContext, begin
from rig.transport.recorder_commands import PulsesFired, TellPulses
from rig.transport.trigger_messages import LetPulses, TriggerCommand, TriggerConfig, TriggerTold
from service.processes.priority import MAKING_PULSES, allowed_priority, prefer_this_process
from triggering.sources.gate import Gate
from triggering.sources.gpio.lines import InputLine, OutputLine
from triggering.sources.gpio.pulser import Pulser
from triggering.sources.gpio.telling import LatenessTeller
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
    trigger = child.config.rig.trigger
    if not isinstance(trigger, GpioTrigger):
        raise SystemExit(f'trigger: source "{trigger.source}" is no line of the computer')
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
            with (
                _outer_gate(trigger) as is_open,
                OutputLine(trigger.chip, trigger.line, active_low=trigger.active_low) as line,
                Timer() as timer,
            ):
                maker = _Maker(line, timer, trigger, child.config.epoch, gate, is_open)
                maker.make(child, realtime=realtime)
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


@contextmanager
def _outer_gate(trigger: GpioTrigger) -> Iterator[Callable[[], bool] | None]:
    """What says whether the gate outside is open; None: there is no gate."""
    if trigger.gate is None:
        yield None
        return
    with InputLine(trigger.chip, trigger.gate.line, active_low=trigger.gate.active_low) as line:
        yield line.active


class _Maker:
    """A line and the thread that makes its pulses."""

    def __init__(
        self,
        line: OutputLine,
        timer: Timer,
        trigger: GpioTrigger,
        origin: HostNs,
        gate: Gate,
        is_open: Callable[[], bool] | None,
    ) -> None:
        self._line, self._timer = line, timer
        self._pulser = Pulser(line.set, timer, origin, trigger.rate_hz, trigger.width_ns, gate, is_open)
        self._failure: TriggerError | None = None

    def make(self, child: ChildContext[TriggerConfig], *, realtime: bool) -> None:
        """Make pulses until told to quit.

        Raises:
            TriggerError: the line fails.
        """
        thread = threading.Thread(target=self._run, name="pulses")
        thread.start()
        teller, turns, stopping = LatenessTeller(self._line.name), itertools.count(1), False
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
