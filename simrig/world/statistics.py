"""What a simulated camera counts, and the report that it gives of itself, on either bus."""

from collections import deque
from dataclasses import dataclass, field

from rig.clocks import HostNs
from rig.pulse import HillPulse

_RECENT = 4096  # frames


@dataclass(frozen=True, slots=True)
class CameraStatistics:
    """Counts since the camera's process began.

    Attributes:
        triggers: triggers that the sensor saw while it acquired, overruns included.
        missed: triggers that it did not see, by a fault or because it was frozen.
        overruns: triggers that came before it was ready for them.
        frames: frames sent, whole or not.
        packets: packets handed to the network or the bus, resent ones included, lost ones not.
        bytes: bytes of these packets (on FireWire without headers).
        resend_requests: requests to send packets again (GigE Vision).
        resent_packets: packets sent again.
        cpu_s: CPU time of the camera's process, s; cameras that share a process share it in equal parts.
        acquiring: whether it exposes at triggers.
        controlled: whether a program controls it.
        last_packets: host time at which the last packet of a frame was sent, by hill pulse.
    """

    triggers: int
    missed: int
    overruns: int
    frames: int
    packets: int
    bytes: int
    resend_requests: int
    resent_packets: int
    cpu_s: float
    acquiring: bool
    controlled: bool
    last_packets: dict[HillPulse, HostNs]


@dataclass(slots=True)
class Counters:
    """The counters behind `CameraStatistics`. Each field is written by one thread only; nothing resets them."""

    triggers: int = 0
    missed: int = 0
    overruns: int = 0
    frames: int = 0
    packets: int = 0
    bytes: int = 0
    resend_requests: int = 0
    resent_packets: int = 0
    last_packets: deque[tuple[HillPulse, HostNs]] = field(default_factory=lambda: deque(maxlen=_RECENT))

    def report(self, *, cpu_s: float, acquiring: bool, controlled: bool) -> CameraStatistics:
        """The counts so far."""
        last_packets = dict(self.last_packets.copy())  # in one step, since another thread appends
        return CameraStatistics(
            self.triggers, self.missed, self.overruns, self.frames, self.packets, self.bytes, self.resend_requests,
            self.resent_packets, cpu_s, acquiring, controlled, last_packets,
        )  # fmt: skip
