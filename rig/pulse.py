"""Numbers of trigger pulses, one type per counter so that the type checker tells them apart, and pauses of the pulses.

- `PulseNumber`: in one recording, from 1; the key of everything in a log and on ZeroMQ.
- `RigPulse`: since the recorder process was started, from 1; several recordings share this counter.
- `HillPulse`: index in the simulated hill's train of pulses, from 0; only the simulated hill and its judges know it.
"""

from typing import NewType

import msgspec

PulseNumber = NewType("PulseNumber", int)
RigPulse = NewType("RigPulse", int)
HillPulse = NewType("HillPulse", int)


class Pause(msgspec.Struct, frozen=True):
    """A stretch of time in which a recording has no pulse.

    Attributes:
        after_pulse: the last pulse before it; 0: it is the beginning of the recording.
        before_pulse: the first pulse after it; None: it lasts until the end of the recording.
        seconds: its length: time between the pulses around it, s.
        pulses: how many pulses would have fired in it, had the train run on.
        idle: cameras whose frame numbers prove that they took no frame in it.
    """

    after_pulse: PulseNumber
    before_pulse: PulseNumber | None
    seconds: float
    pulses: int
    idle: tuple[str, ...] = ()

    @property
    def between_logs(self) -> bool:
        """Whether its pulses were counted, but are in no log: those between two logs of a recording."""
        return self.before_pulse is not None and self.pulses == self.before_pulse - self.after_pulse - 1 > 0

    def in_words(self) -> str:
        """One line: where, how long, and what the frame numbers say."""
        if self.after_pulse == 0 and self.before_pulse is None:
            where = f"in the {self.seconds:.3g} s of the recording"
        elif self.before_pulse is None:
            where = f"in the last {self.seconds:.3g} s of the recording"
        elif self.after_pulse == 0:
            where = f"in the first {self.seconds:.3g} s of the recording"
        else:
            where = f"for {self.seconds:.3g} s after pulse {self.after_pulse}"
        if self.before_pulse is not None and self.between_logs:
            where = f"in the {self.seconds:.3g} s between the log before this one and its first pulse"
            first, last = self.after_pulse + 1, self.before_pulse - 1
            what = f"pulse {first} is" if first == last else f"pulses {first}-{last} are"
            return f"{what} in no log: nothing was recorded {where}"
        line = f"no pulses {where} ({self.pulses} at the rate of the others)"
        if self.idle:
            return f"{line}: {', '.join(self.idle)} took no frame in it, so the trigger paused or did not reach them"
        return f"{line}: the frame numbers do not tell whether the trigger paused"
