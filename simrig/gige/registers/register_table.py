"""The camera's registers by name: what register map and GenICam description are made from, and values in registers.

Names are those of the GenICam Standard Features Naming Convention. Bootstrap addresses are those of GigE Vision 2.0,
chapter 28; the camera's own registers begin at 0x10000.
"""

from dataclasses import dataclass
from enum import IntEnum
from itertools import count

from rig.images.pixels import FORMATS
from simrig.gige.registers.register_map import Kind, Register

VENDOR = "Svev"
MODEL = "SimulatedHillCamera"
XML_ADDRESS = 0x20000
DISCOVERY_BYTES = 0xF8  #: so many bytes of bootstrap registers answer a discovery
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
    """In what one camera differs from another.

    Attributes:
        serial: serial number.
        user_name: name that the user gave it (DeviceUserID).
        address: IPv4 address, as a number.
        sensor: largest width and height, px.
        tick_hz: ticks of the device clock per second.
        resend: whether the camera can send lost packets again.
    """

    serial: str
    user_name: str
    address: int
    sensor: tuple[int, int]
    tick_hz: int
    resend: bool


# GVCP capability: user name, serial number, heartbeat disable, IEEE 1588, status codes of 2.0,
# scheduled action; action, pending ack, packet resend, WRITEMEM, concatenation
_CAPABILITY = 0xE00E0063

_SAME_FOR_ALL = (
    Register("GevVersion", 0x0000, default=0x00020000),
    Register("GevDeviceMode", 0x0004, default=0x80000001),
    Register("GevSupportedIPConfiguration", 0x0010, default=0x7),
    Register("GevCurrentIPConfiguration", 0x0014, default=0x6, writable=True, maximum=7, minimum=4),
    Register("GevCurrentSubnetMask", 0x0034, default=0xFF000000),
    Register("GevCurrentDefaultGateway", 0x0044),
    Register("DeviceVendorName", 0x0048, 32, Kind.TEXT, VENDOR),
    Register("DeviceModelName", 0x0068, 32, Kind.TEXT, MODEL),
    Register("DeviceVersion", 0x0088, 32, Kind.TEXT, "1"),
    Register("DeviceManufacturerInfo", 0x00A8, 48, Kind.TEXT, "simulated"),
    Register("GevSecondURL", 0x0400, 512, Kind.TEXT, ""),
    Register("GevNumberOfInterfaces", 0x0600, default=1),
    Register("GevPersistentIPAddress", 0x064C, writable=True),
    Register("GevPersistentSubnetMask", 0x065C, writable=True),
    Register("GevPersistentDefaultGateway", 0x066C, writable=True),
    Register("GevMessageChannelCount", 0x0900),
    Register("GevStreamChannelCount", 0x0904, default=1),
    Register("GevActionSignalCount", 0x0908, default=1),
    Register("ActionDeviceKey", 0x090C, writable=True),
    Register("GevActiveLinkCount", 0x0910, default=1),
    Register("GevGVSPCapability", 0x092C, default=0x40000000),
    Register("GevHeartbeatTimeout", 0x0938, default=3000, writable=True, minimum=500, maximum=60000),
    Register("GevTimestampControl", 0x0944, writable=True, readable=False, choices=(CLOCK_RESET, LATCH)),
    Register("GevTimestampValue", 0x0948, 8),
    Register("GevGVCPConfiguration", 0x0954, writable=True),
    Register("GevGVCPPendingTimeout", 0x0958, default=1000),
    Register("GevGVSPConfiguration", 0x0960, writable=True, locked=True),
    Register("GevCCP", 0x0A00, writable=True, maximum=7, minimum=0),
    Register("GevSCP", 0x0D00, writable=True),
    Register("GevSCPS", 0x0D04, default=1400, writable=True, locked=True),
    Register("GevSCPD", 0x0D08, writable=True),
    Register("GevSCDA", 0x0D18, writable=True),
    Register("GevSCSP", 0x0D1C),
    Register("ActionGroupKey", 0x9800, writable=True),
    Register("ActionGroupMask", 0x9804, writable=True),
)

#: registers that UserSetLoad (and so a restart) sets to their defaults
USER_SET = (
    "Width", "Height", "OffsetX", "OffsetY", "PixelFormat", "PayloadSize", "AcquisitionMode", "AcquisitionFrameRate",
    "AcquisitionFrameRateEnable", "TriggerMode", "TriggerSource", "TriggerActivation", "ExposureMode", "ExposureTime",
    "Gain", "ActionDeviceKey", "ActionGroupKey", "ActionGroupMask",
)  # fmt: skip


def all_registers(identity: Identity, xml_bytes: int) -> list[Register]:
    """Every register of a camera whose GenICam description takes `xml_bytes` bytes."""
    mac = 0x02_53_00_00_00_00 | identity.address  # locally administered
    capability = _CAPABILITY | (RESEND_CAPABILITY if identity.resend else 0)
    return [
        *_SAME_FOR_ALL,
        Register("GevMACAddressHigh", 0x0008, default=mac >> 32),
        Register("GevMACAddressLow", 0x000C, default=mac & 0xFFFFFFFF),
        Register("GevCurrentIPAddress", 0x0024, default=identity.address),
        Register("DeviceSerialNumber", 0x00D8, 16, Kind.TEXT, identity.serial),
        Register("DeviceUserID", 0x00E8, 16, Kind.TEXT, identity.user_name, writable=True),
        Register("GevFirstURL", 0x0200, 512, Kind.TEXT, f"Local:{MODEL}.xml;{XML_ADDRESS:x};{xml_bytes:x}"),
        Register("GevGVCPCapability", 0x0934, default=capability),
        Register("GevTimestampTickFrequency", 0x093C, 8, default=identity.tick_hz),
        *_of_the_sensor(*identity.sensor),
        *_settings(),
    ]


def _of_the_sensor(width: int, height: int) -> list[Register]:
    place = count(0x10000, 8)

    def fixed(name: str, value: int) -> Register:
        return Register(name, next(place), default=value)

    def pixels(name: str, default: int, low: int, high: int, step: int) -> Register:
        return Register(
            name, next(place), default=default, writable=True, locked=True, minimum=low, maximum=high, increment=step
        )

    return [
        fixed("SensorWidth", width),
        fixed("SensorHeight", height),
        fixed("PayloadSize", width * height),
        pixels("Width", width, MIN_WIDTH, width, 4),
        pixels("Height", height, 2, height, 2),
        pixels("OffsetX", 0, 0, width - MIN_WIDTH, 4),
        pixels("OffsetY", 0, 0, height - 2, 2),
    ]


def _settings() -> list[Register]:
    place = count(0x10100, 8)

    def choice(name: str, *choices: int, locked: bool = False) -> Register:
        return Register(name, next(place), default=choices[0], writable=True, locked=locked, choices=choices)

    def real(name: str, default: float, low: float, high: float) -> Register:
        return Register(name, next(place), 8, Kind.FLOAT, default, writable=True, minimum=low, maximum=high)

    def command(name: str) -> Register:
        return Register(name, next(place), writable=True, choices=(1,))

    return [
        choice("PixelFormat", *(each.code for each in FORMATS.values()), locked=True),
        choice("AcquisitionMode", *AcquisitionMode, locked=True),
        command("AcquisitionStart"),
        command("AcquisitionStop"),
        real("AcquisitionFrameRate", 30.0, 0.1, 1000.0),
        choice("AcquisitionFrameRateEnable", 1, 0),
        choice("TriggerSelector", 0),
        choice("TriggerMode", 0, 1),
        choice("TriggerSource", *TriggerSource),
        choice("TriggerActivation", 0, 1),
        command("TriggerSoftware"),
        choice("ExposureMode", *ExposureMode),
        real("ExposureTime", 2000.0, 10.0, 1e6),
        real("Gain", 0.0, 0.0, 24.0),
        Register("DeviceTemperature", next(place), 8, Kind.FLOAT, 0.0),
        Register("CounterValue", next(place)),
        command("CounterReset"),
        choice("UserSetSelector", 0),
        command("UserSetLoad"),
        choice("PtpEnable", 0, 1),
        Register("PtpStatus", next(place), default=PtpStatus.DISABLED),
        command("PtpDataSetLatch"),
        Register("PtpOffsetFromMaster", next(place), 8, Kind.INT),
        choice("GevGVCPExtendedStatusCodes", 0, 1),
    ]
