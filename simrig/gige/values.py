"""Numbers that stand in the camera's registers, and what the camera says about itself."""

from dataclasses import dataclass
from enum import IntEnum

VENDOR = "Svev"
MODEL = "SimulatedHillCamera"
XML_ADDRESS = 0x20000
DISCOVERY_BYTES = 0xF8  #: the first bytes of the bootstrap registers answer a discovery
MONO8 = 0x01080001
MIN_WIDTH = 16  #: so that every frame has room for its stamp
FIRE_TEST_PACKET = 1 << 31  #: bits of GevSCPS
DO_NOT_FRAGMENT = 1 << 30
PACKET_SIZE_MASK = 0xFFFF
MIN_PACKET_SIZE, MAX_PACKET_SIZE = 576, 65500
EXTENDED_IDS = 1 << 30  #: bit of GevGVSPConfiguration
HEARTBEAT_DISABLE = 1  #: bit of GevGVCPConfiguration
LATCH, CLOCK_RESET = 2, 1  #: values of GevTimestampControl

RESEND_CAPABILITY = 0x4


class TriggerSource(IntEnum):
    """Values of TriggerSource."""

    LINE0 = 0
    LINE1 = 1
    SOFTWARE = 2
    ACTION0 = 3


class AcquisitionMode(IntEnum):
    """Values of AcquisitionMode."""

    CONTINUOUS = 0
    SINGLE_FRAME = 1


class ExposureMode(IntEnum):
    """Values of ExposureMode."""

    TIMED = 0
    TRIGGER_WIDTH = 1


class PtpStatus(IntEnum):
    """Port states of IEEE 1588 that the camera takes."""

    DISABLED = 3
    UNCALIBRATED = 8
    SLAVE = 9


@dataclass(frozen=True, slots=True)
class Identity:
    """What a camera says about itself.

    Attributes:
        address: IPv4 address, as a number.
        sensor: largest width and height, px.
        tick_hz: ticks of the device clock per second.
        resend: whether lost packets can be asked for again.
    """

    serial: str
    user_name: str
    address: int
    sensor: tuple[int, int]
    tick_hz: int
    resend: bool
