"""What a simulated camera counts, and what it reports of it."""

from collections import deque
from dataclasses import dataclass, field

from rig.clocks import HostNs
from simrig.statistics import CameraStatistics

_RECENT = 4096  # frames


@dataclass(slots=True)
class Counters:
    """Counts since the camera process began. Each field is written by one thread only.

    Attributes:
        triggers: triggers that the sensor saw while it acquired, overruns included.
        missed: triggers that it did not see, by a fault or because the process was frozen.
        overruns: triggers that came before the sensor or the frame memory was ready for them.
        frames: frames sent, whole or not.
        frame_triggers: value of the counter that a controller can read and reset.
        last_packets: hill pulse and host time of the last packet, per frame.
    """

    triggers: int = 0
    missed: int = 0
    overruns: int = 0
    frames: int = 0
    frame_triggers: int = 0
    resend_requests: int = 0
    resent_packets: int = 0
    last_packets: deque[tuple[int, HostNs]] = field(default_factory=lambda: deque(maxlen=_RECENT))


@dataclass(frozen=True, slots=True)
class GigeStatistics(CameraStatistics):
    """A GigE Vision camera's report: the counts are those of `Counters`.

    Attributes:
        block_id: id of the last frame exposed, 0 if none.
    """

    resend_requests: int
    resent_packets: int
    block_id: int
