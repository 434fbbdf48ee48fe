"""What a process of simulated cameras is told, and what it answers.

The first message is its configuration. The process answers it and each command with one message, and ends at `Quit`.
"""

from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from rig.settings.strict_toml import StrictModel
from rig.transport.message import Message, Quit
from simrig.firewire.bus_state import BusState
from simrig.firewire.camera.advanced import Signature
from simrig.firewire.camera.geometry import MARLIN, Deep
from simrig.gige.configuration import CameraConfig
from simrig.world.faults import Fault
from simrig.world.statistics import CameraStatistics

_GUID_DIGITS = 16


def _guid(text: str) -> str:
    try:
        number = int(text, 16)
    except ValueError:
        number = -1
    if number < 0 or len(text) != _GUID_DIGITS:
        raise ValueError(f'"{text}" is no GUID: give its 16 hexadecimal digits, e.g. 000a4701011b0001')
    return f"{number:016x}"


class BusConfig(StrictModel):
    """What the emulated FireWire bus is told when its process starts."""

    cameras: dict[str, Annotated[str, AfterValidator(_guid)]] = Field(
        min_length=1, max_length=16, description="GUID by name in the scenario, in the order of the bus"
    )
    socket: str = Field(min_length=2, max_length=100, description="name of the socket for the shim; @name: abstract")
    scenario: Path
    rate_hz: float = Field(gt=0, le=10_000, description="rate of the hill's trigger pulses")
    epoch: int = Field(description="host time of hill pulse 0, ns")
    test_pattern: bool = Field(False, description="show a plain pattern instead of the hill: costs nothing")
    signature: Signature = Field("big", description="byte order of the secure image signature; none: old firmware")
    deep: Deep = Field(MARLIN, description="how pixels of more than 8 bits are sent")
    permitted: bool = Field(True, description="whether programs may open /dev/fw*")
    cable: bool = Field(True, description="whether the hill's pulses reach the cameras' inputs")


class GigeCamera(Message):
    """Configuration of one GigE Vision camera."""

    config: CameraConfig


class FireWireBus(Message):
    """Configuration of the emulated FireWire bus with its cameras."""

    config: BusConfig


# Commands


class Inject(Message):
    """Add a fault."""

    fault: Fault


class AskStatistics(Message):
    """Report what a camera did since the process began."""

    camera: str


class Unplug(Message):
    """Take a camera off the bus."""

    camera: str


class Plug(Message):
    """Put a camera on the bus, with default settings; unplug it before if need be."""

    camera: str


class Freeze(Message):
    """Let a camera answer nothing and send nothing."""

    camera: str


class Thaw(Message):
    """Let a frozen camera go on."""

    camera: str


class ResetBus(Message):
    """Reset the bus."""


class AskBusState(Message):
    """Report the state of the bus."""


CameraCommand = Inject | AskStatistics | Quit
BusCommand = Inject | AskStatistics | Unplug | Plug | Freeze | Thaw | ResetBus | AskBusState | Quit


# Answers


class Done(Message):
    """The process is ready, or has carried out the command."""


class Refused(Message):
    """The process cannot carry out the command, or cannot start, for a reason that a person can remove."""

    reason: str


class Statistics(Message):
    """Answer to `AskStatistics`."""

    statistics: CameraStatistics


class State(Message):
    """Answer to `AskBusState`."""

    state: BusState


Answer = Done | Refused | Statistics | State
