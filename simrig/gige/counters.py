"""What a simulated camera counts, and what it reports of it."""

from collections import deque
from dataclasses import dataclass, field

from rig.clocks import HostNs

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
class CameraStatistics:
    """A camera's report; the counts are those of `Counters`.

    Attributes:
        packets: packets handed to the network, resent ones included.
        bytes: their bytes on the network layer.
        cpu_s: CPU time of the camera's process, s.
        acquiring: whether it exposes at triggers.
        controlled: whether a program controls it.
        block_id: id of the last frame exposed, 0 if none.
        last_packets: host time at which the last packet of a frame was handed to the network, by hill pulse.
    """

    triggers: int
    missed: int
    overruns: int
    frames: int
    resend_requests: int
    resent_packets: int
    packets: int
    bytes: int
    cpu_s: float
    acquiring: bool
    controlled: bool
    block_id: int
    last_packets: dict[int, HostNs]
