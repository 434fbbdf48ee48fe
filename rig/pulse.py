"""Numbers of trigger pulses, one type per counter, so that the type checker tells one from another.

- `PulseNumber`: in one recording, from 1; the key of everything in a log and on ZeroMQ.
- `RigPulse`: since the recorder process was started, from 1; several recordings share this counter.
- `HillPulse`: index in the simulated hill's train of pulses, from 0; only the simulated hill and its judges know it.
"""

from typing import NewType

PulseNumber = NewType("PulseNumber", int)
RigPulse = NewType("RigPulse", int)
HillPulse = NewType("HillPulse", int)
