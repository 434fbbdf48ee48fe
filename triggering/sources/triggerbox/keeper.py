"""Keeps the train of a trigger box going while a rig is armed, and tells which pulses it has fired.

```
            open, answers                 clock known
 connecting ─────────────► starting ──────────────────► running
     ▲                         ▲                           │
     │ line gone, silent       │ counts contradict: it began anew or its clock jumped
     └─────────────────────────┴───────────────────────────┘
```
Whoever stops it stops the pulses.
"""

import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import TriggerError
from rig.events import Level
from rig.phrase import Phrase, phrase
from triggering.sources.gate import Gate
from triggering.sources.triggerbox.box import TriggerBox
from triggering.sources.triggerbox.clock import BoxClock, ClockLine
from triggering.sources.triggerbox.line import SerialLine
from triggering.sources.triggerbox.protocol import Rate

#: Time between two questions while the clock is not known, and then.
_HURRY_S: Final = 0.02
_EVERY_S: Final = 0.1
#: So many questions in a row without an answer: the box hangs, or somebody has pulled it from its converter.
_UNANSWERED: Final = 10
#: Time from a fault to the next try.
_AGAIN_S: Final = 2.0
#: A burst whose counts are not answered is ended so long after its time.
_ANSWERS_S: Final = 1.0
_HALF_PERIOD: Final = 0.5
#: A rate that differs by more than this share from the wanted one is told as a warning.
_OFF: Final = 1e-3


@dataclass(frozen=True, slots=True)
class Fired:
    """What the box says it has fired since the last time.

    Attributes:
        first: number of the first pulse; where a new train begins, a number is left out.
        times: when each edge rose.
        uncertainty_ns: largest error of the times.
        until: all pulses up to here have been told.
    """

    first: int
    times: tuple[HostNs, ...]
    uncertainty_ns: int
    until: HostNs


class TrainKeeper:
    """Runs one box.

    Args:
        port: its device file.
        rate: of the pulses.
        wanted_hz: the rate of the rig file.
        gate: lets pulses through.
        tell: called with level and words of what people should know.
        fired: called with what the box has fired.
        wait: waits so many seconds; tells whether to stop.
    """

    def __init__(
        self,
        port: str,
        rate: Rate,
        wanted_hz: float,
        gate: Gate,
        *,
        tell: Callable[[Level, Phrase], None],
        fired: Callable[[Fired], None],
        wait: Callable[[float], bool],
    ) -> None:
        self._port, self._rate, self._wanted_hz = port, rate, wanted_hz
        self._tell, self._fired, self._wait, self._gate = tell, fired, wait, gate
        self._fault: Phrase | None = None
        self._sent = 0
        self.line: ClockLine | None = None

    def run(self) -> None:
        """Keep the train going until told to stop; the pulses have stopped then."""
        while not self._wait(0):
            try:
                with SerialLine(self._port) as line:
                    self._drive(TriggerBox(line, self._port, lambda: self._wait(0)))
            except TriggerError as error:
                self.line = None
                if error.said != self._fault:  # a fault that lasts is told once
                    self._fault = error.said
                    self._tell(Level.ERROR, error.said)
                self._wait(_AGAIN_S)

    def _drive(self, box: TriggerBox) -> None:
        """Drive a box whose port is open, until told to stop.

        Raises:
            TriggerError: it does not answer, or the line is gone.
        """
        box.wake()
        try:
            while not self._wait(0):
                pulses = self._gate.take()
                if pulses is None:
                    box.start(self._rate)
                    self._run_train(box)
                    box.stop()
                elif pulses:
                    self._run_burst(box, pulses)
                else:
                    self._wait(_HURRY_S)
        finally:
            with suppress(TriggerError):  # where the line is gone nothing can be stopped
                box.stop()

    def _run_train(self, box: TriggerBox) -> None:
        """Tell the pulses of one train, until it is contradicted, closed by the gate, or we are told to stop."""
        clock, told, unanswered = BoxClock(self._rate.period_ns), None, 0
        before = self._sent + 1
        while not self._wait(_HURRY_S if clock.line is None else _EVERY_S):
            if not self._gate.open:
                self.line = None
                return
            read = box.read()
            unanswered = unanswered + 1 if read is None else 0
            if unanswered >= _UNANSWERED:
                text = "the trigger box at {port} no longer answers: unplug it and plug it in again"
                raise TriggerError(phrase("trigger_unanswered", text, port=self._port))
            if read is None:
                continue
            reading, last = read
            agrees = clock.add(reading)
            if clock.broken:
                self.line = None
                text = "the trigger box has begun anew: its pulses have stopped for a moment; check its power"
                self._tell(Level.ERROR, phrase("trigger_anew", text))
                return
            if not agrees or clock.line is None:
                continue
            self.line = clock.line
            if told is None:
                told = last
                self._say_running()
                continue
            numbers = range(told + 1, last + 1)
            times = tuple(clock.line.at(number) for number in numbers)
            self._fired(Fired(before + told + 1, times, round(clock.line.uncertainty_ns), reading.asked))
            told, self._sent = last, before + last

    def _run_burst(self, box: TriggerBox, pulses: int) -> None:
        """Make so many pulses, or one more or less where the box is asked too late; they are not told.

        The box knows no number of pulses (protocol 14), so it is stopped half a period after the last one.
        """
        box.start(self._rate)
        end = time.monotonic() + _ANSWERS_S + (pulses + 1) * self._rate.period_ns / NS_PER_S
        while time.monotonic() < end and not self._wait(0):
            if (read := box.read()) is None:
                continue
            reading, _ = read
            left_s = (pulses + _HALF_PERIOD - reading.phase) * self._rate.period_ns / NS_PER_S
            left_s -= (host_now() - reading.middle) / NS_PER_S
            if left_s <= _EVERY_S:
                self._wait(max(0.0, left_s))
                break
            self._wait(left_s - _EVERY_S / 2)
        box.stop()
        made = box.read()
        if made is not None and made[1] != pulses:
            text = "the trigger box has made {made} pulses, {wanted} were wanted: ask for them again"
            self._tell(Level.WARNING, phrase("trigger_burst", text, made=made[1], wanted=pulses))

    def _say_running(self) -> None:
        """Tell that the train runs, and how far its rate is from the wanted one."""
        self._fault = None
        hz = self._rate.hz
        off = hz / self._wanted_hz - 1
        text = "makes {hz} pulses per second, {ppm} ppm off trigger.rate_hz"
        said = phrase("trigger_running", text, hz=round(hz, 4), ppm=round(off * 1e6))
        self._tell(Level.WARNING if abs(off) > _OFF else Level.INFO, said)
