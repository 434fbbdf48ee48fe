"""The messages between the service and the process that makes the pulses, where svev makes them.

What the recorder is told of the pulses goes by way of the service.
"""

from typing import ClassVar

from rig.clocks import HostNs
from rig.events import Event
from rig.health import Health
from rig.settings.model import RigSettings
from rig.transport.message import Message, Quit
from rig.transport.recorder_commands import PulsesFired, TellActions, TellPulses


class TriggerBoxConfig(Message):
    """Configuration of the process that drives a trigger box.

    Attributes:
        rig: the rig.
        port: device file of the serial line: the rig file's, or that of an emulated box.
        still: pulses are made on request only.
    """

    rig: RigSettings
    port: str
    still: bool = False


class TriggerConfig(Message):
    """Configuration of the process that sends action commands, or makes the pulses of a line.

    Attributes:
        rig: the rig.
        epoch: as the grabbers have it.
        still: pulses are made on request only.
    """

    rig: RigSettings
    epoch: HostNs
    still: bool = False


class CamerasSeen(Message):
    """To the process that sends the pulses: what the recorder knows of the cameras.

    Attributes:
        connected: whether each is.
        offsets_ns: device minus host time of each, None: not known.
    """

    is_state: ClassVar[bool] = True
    connected: tuple[bool, ...]
    offsets_ns: tuple[int | None, ...]

    @classmethod
    def of(cls, health: Health) -> "CamerasSeen":
        """What a health record says of the cameras."""
        cameras = health.pairing.cameras
        return cls(
            connected=tuple(camera.connected for camera in cameras),
            offsets_ns=tuple(-camera.clock_offset_ns if camera.clock_known else None for camera in cameras),
        )


class LetPulses(Message):
    """To the process that makes the pulses: make so many from now on.

    Attributes:
        pulses: 0: none; None: without end.
    """

    pulses: int | None


class TriggerTold(Message):
    """Something that people should know of the pulses that are sent."""

    event: Event


TriggerCommand = CamerasSeen | LetPulses | Quit
TriggerReport = TellActions | TellPulses | PulsesFired | TriggerTold
