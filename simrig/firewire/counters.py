"""What an emulated FireWire camera counts."""

from collections import deque
from dataclasses import dataclass, field

from rig.clocks import HostNs

_RECENT = 4096  # frames


@dataclass(slots=True)
class Counters:
    """Counts since the bus process began; unlike those in the camera's registers nobody can reset them.

    Attributes:
        triggers: triggers that the camera saw while it transmitted, overruns included.
        missed: triggers that it did not see, by a fault or because it was frozen.
        overruns: triggers that came before the sensor was ready for them.
        frames: frames sent, whole or not.
        packets: isochronous packets sent and not lost.
        bytes: their bytes on the bus, without headers.
        last_packets: hill pulse and host time of the end of the last packet, per frame.
    """

    triggers: int = 0
    missed: int = 0
    overruns: int = 0
    frames: int = 0
    packets: int = 0
    bytes: int = 0
    last_packets: deque[tuple[int, HostNs]] = field(default_factory=lambda: deque(maxlen=_RECENT))
