"""What a simulated camera reports of itself, whatever bus it is on."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from rig.clocks import HostNs


@dataclass(frozen=True, slots=True)
class CameraStatistics:
    """Counts since the camera's process began.

    Attributes:
        triggers: triggers that the sensor saw while it acquired, overruns included.
        missed: triggers that it did not see, by a fault or because it was frozen.
        overruns: triggers that came before it was ready for them.
        frames: frames sent, whole or not.
        packets: packets handed to the network or the bus, resent ones included.
        bytes: their bytes.
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
    cpu_s: float
    acquiring: bool
    controlled: bool
    last_packets: dict[int, HostNs]

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Self:
        """Read what a camera's process answers; JSON has turned pulse numbers into text."""
        last = {int(pulse): HostNs(moment) for pulse, moment in data["last_packets"].items()}
        return cls(**{**data, "last_packets": last})
