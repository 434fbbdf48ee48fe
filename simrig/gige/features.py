"""The camera's registers and GenICam features: one table that register map and XML are both made from.

Names are those of the GenICam Standard Features Naming Convention. Bootstrap addresses are those of GigE Vision 2.0,
chapter 28; the camera's own registers begin at 0x10000.
"""

from dataclasses import dataclass
from enum import IntEnum, StrEnum
from itertools import count

from simrig.gige.registers import Kind, Register

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

# GVCP capability: user name, serial number, heartbeat disable, IEEE 1588, status codes of 2.0,
# scheduled action; action, pending ack, packet resend, WRITEMEM, concatenation
_CAPABILITY = 0xE00E0063
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


class Node(StrEnum):
    """GenICam node type of a feature."""

    INTEGER = "Integer"
    FLOAT = "Float"
    ENUMERATION = "Enumeration"
    BOOLEAN = "Boolean"
    COMMAND = "Command"
    STRING = "StringReg"


@dataclass(frozen=True, slots=True)
class Feature:
    """One feature of the GenICam description.

    Attributes:
        register: register that holds it.
        bits: first and last bit of it in big-endian counting (0 = most significant), None: the whole register.
        entries: names and values of an enumeration.
        command: value that a command writes.
        limits: smallest, largest value and increment, where the register's own are not those of the feature.
        maximum: formula for the largest value, over names of other features.
        unit: of the value.
    """

    name: str
    node: Node
    category: str
    register: Register
    bits: tuple[int, int] | None = None
    entries: tuple[tuple[str, int], ...] = ()
    command: int = 1
    limits: tuple[int, int, int] | None = None
    maximum: str = ""
    unit: str = ""


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


VENDOR = "Svev"
MODEL = "SimulatedHillCamera"


def bootstrap(identity: Identity, xml_bytes: int) -> list[Register]:
    """Bootstrap registers."""
    mac = 0x02_53_00_00_00_00 | identity.address & 0xFFFFFFFF  # locally administered
    text = Kind.TEXT
    capability = _CAPABILITY | (RESEND_CAPABILITY if identity.resend else 0)
    return [
        Register("GevVersion", 0x0000, default=0x00020000),
        Register("GevDeviceMode", 0x0004, default=0x80000001),
        Register("GevMACAddressHigh", 0x0008, default=mac >> 32),
        Register("GevMACAddressLow", 0x000C, default=mac & 0xFFFFFFFF),
        Register("GevSupportedIPConfiguration", 0x0010, default=0x4),
        Register("GevCurrentIPConfiguration", 0x0014, default=0x4),
        Register("GevCurrentIPAddress", 0x0024, default=identity.address),
        Register("GevCurrentSubnetMask", 0x0034, default=0xFF000000),
        Register("GevCurrentDefaultGateway", 0x0044),
        Register("DeviceVendorName", 0x0048, 32, text, VENDOR),
        Register("DeviceModelName", 0x0068, 32, text, MODEL),
        Register("DeviceVersion", 0x0088, 32, text, "1"),
        Register("DeviceManufacturerInfo", 0x00A8, 48, text, "simulated"),
        Register("DeviceSerialNumber", 0x00D8, 16, text, identity.serial),
        Register("DeviceUserID", 0x00E8, 16, text, identity.user_name, writable=True),
        Register("GevFirstURL", 0x0200, 512, text, f"Local:{MODEL}.xml;{XML_ADDRESS:x};{xml_bytes:x}"),
        Register("GevSecondURL", 0x0400, 512, text, ""),
        Register("GevNumberOfInterfaces", 0x0600, default=1),
        Register("GevMessageChannelCount", 0x0900),
        Register("GevStreamChannelCount", 0x0904, default=1),
        Register("GevActionSignalCount", 0x0908, default=1),
        Register("ActionDeviceKey", 0x090C, writable=True),
        Register("GevActiveLinkCount", 0x0910, default=1),
        Register("GevGVSPCapability", 0x092C, default=0x40000000),
        Register("GevGVCPCapability", 0x0934, default=capability),
        Register("GevHeartbeatTimeout", 0x0938, default=3000, writable=True, minimum=500, maximum=60000),
        Register("GevTimestampTickFrequency", 0x093C, 8, default=identity.tick_hz),
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
    ]


def device_registers(sensor: tuple[int, int]) -> list[Register]:
    """The camera's own registers."""
    place = count(0x10000, 8)
    width, height = sensor

    def fixed(name: str, value: int = 0) -> Register:
        return Register(name, next(place), default=value)

    def pixels(name: str, default: int, low: int, high: int, step: int) -> Register:
        return Register(
            name, next(place), default=default, writable=True, locked=True, minimum=low, maximum=high, increment=step
        )

    def choice(name: str, *choices: int, locked: bool = False) -> Register:
        return Register(name, next(place), default=choices[0], writable=True, locked=locked, choices=choices)

    def real(name: str, default: float, low: float, high: float, *, writable: bool = True) -> Register:
        return Register(name, next(place), 8, Kind.FLOAT, default, writable, minimum=low, maximum=high)

    def command(name: str) -> Register:
        return Register(name, next(place), writable=True, choices=(1,))

    return [
        fixed("SensorWidth", width),
        fixed("SensorHeight", height),
        pixels("Width", width, MIN_WIDTH, width, 4),
        pixels("Height", height, 2, height, 2),
        pixels("OffsetX", 0, 0, width - MIN_WIDTH, 4),
        pixels("OffsetY", 0, 0, height - 2, 2),
        choice("PixelFormat", MONO8, locked=True),
        fixed("PayloadSize", width * height),
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
        real("DeviceTemperature", 0.0, -40.0, 125.0, writable=False),
        fixed("CounterValue"),
        command("CounterReset"),
        choice("UserSetSelector", 0),
        command("UserSetLoad"),
        choice("PtpEnable", 0, 1),
        fixed("PtpStatus", PtpStatus.DISABLED),
        command("PtpDataSetLatch"),
        Register("PtpOffsetFromMaster", next(place), 8, Kind.INT),
    ]


#: what UserSetLoad (and so a restart) sets back
USER_SET = (
    "Width", "Height", "OffsetX", "OffsetY", "PixelFormat", "PayloadSize", "AcquisitionMode", "AcquisitionFrameRate",
    "AcquisitionFrameRateEnable", "TriggerMode", "TriggerSource", "TriggerActivation", "ExposureMode", "ExposureTime",
    "Gain", "ActionDeviceKey", "ActionGroupKey", "ActionGroupMask",
)  # fmt: skip


def features(registers: list[Register]) -> list[Feature]:
    """The GenICam features over `registers`."""
    named = {register.name: register for register in registers}
    device, image, acquisition = "DeviceControl", "ImageFormatControl", "AcquisitionControl"
    counters, actions, transport, ptp = "CounterAndTimerControl", "ActionControl", "TransportLayerControl", "PtpControl"

    def node(kind: Node, category: str, *names: str, unit: str = "") -> list[Feature]:
        return [Feature(name, kind, category, named[name], unit=unit) for name in names]

    def enum(category: str, name: str, **entries: int) -> Feature:
        return Feature(name, Node.ENUMERATION, category, named[name], entries=tuple(entries.items()))

    states = {state.name.capitalize(): int(state) for state in PtpStatus}
    sources = {source.name.capitalize(): int(source) for source in TriggerSource}
    sizes = (MIN_PACKET_SIZE, MAX_PACKET_SIZE, 4)
    scps, control = named["GevSCPS"], named["GevTimestampControl"]
    return [
        *node(Node.STRING, device, "DeviceVendorName", "DeviceModelName", "DeviceVersion", "DeviceManufacturerInfo"),
        *node(Node.STRING, device, "DeviceSerialNumber", "DeviceUserID"),
        Feature("DeviceID", Node.STRING, device, named["DeviceSerialNumber"]),
        *node(Node.FLOAT, device, "DeviceTemperature", unit="C"),
        *node(Node.INTEGER, image, "SensorWidth", "SensorHeight"),
        Feature("Width", Node.INTEGER, image, named["Width"], maximum="SensorWidth-OffsetX"),
        Feature("Height", Node.INTEGER, image, named["Height"], maximum="SensorHeight-OffsetY"),
        Feature("OffsetX", Node.INTEGER, image, named["OffsetX"], maximum="SensorWidth-Width"),
        Feature("OffsetY", Node.INTEGER, image, named["OffsetY"], maximum="SensorHeight-Height"),
        enum(image, "PixelFormat", Mono8=MONO8),
        enum(acquisition, "AcquisitionMode", Continuous=0, SingleFrame=1),
        *node(Node.COMMAND, acquisition, "AcquisitionStart", "AcquisitionStop"),
        *node(Node.FLOAT, acquisition, "AcquisitionFrameRate", unit="Hz"),
        *node(Node.BOOLEAN, acquisition, "AcquisitionFrameRateEnable"),
        enum(acquisition, "TriggerSelector", FrameStart=0),
        enum(acquisition, "TriggerMode", Off=0, On=1),
        enum(acquisition, "TriggerSource", **sources),
        enum(acquisition, "TriggerActivation", RisingEdge=0, FallingEdge=1),
        *node(Node.COMMAND, acquisition, "TriggerSoftware"),
        enum(acquisition, "ExposureMode", Timed=0, TriggerWidth=1),
        *node(Node.FLOAT, acquisition, "ExposureTime", unit="us"),
        *node(Node.FLOAT, "AnalogControl", "Gain", unit="dB"),
        *node(Node.INTEGER, counters, "CounterValue"),
        *node(Node.COMMAND, counters, "CounterReset"),
        enum("UserSetControl", "UserSetSelector", Default=0),
        *node(Node.COMMAND, "UserSetControl", "UserSetLoad"),
        *node(Node.INTEGER, actions, "ActionDeviceKey", "ActionGroupKey", "ActionGroupMask"),
        *node(Node.INTEGER, transport, "PayloadSize", "GevTimestampTickFrequency", "GevTimestampValue", "GevCCP"),
        *node(Node.INTEGER, transport, "GevHeartbeatTimeout", "GevSCPD", "GevCurrentIPAddress"),
        Feature("GevGVCPHeartbeatDisable", Node.BOOLEAN, transport, named["GevGVCPConfiguration"], bits=(31, 31)),
        Feature("GevSCPSPacketSize", Node.INTEGER, transport, scps, bits=(16, 31), limits=sizes),
        Feature("GevSCPSDoNotFragment", Node.BOOLEAN, transport, scps, bits=(1, 1)),
        Feature("GevSCPSFireTestPacket", Node.COMMAND, transport, scps, bits=(0, 0)),
        Feature("GevTimestampControlLatch", Node.COMMAND, transport, control, command=LATCH),
        Feature("GevTimestampControlReset", Node.COMMAND, transport, control, command=CLOCK_RESET),
        Feature(
            "GevGVSPExtendedIDMode", Node.ENUMERATION, transport, named["GevGVSPConfiguration"], bits=(1, 1),
            entries=(("Off", 0), ("On", 1)),
        ),
        *node(Node.BOOLEAN, ptp, "PtpEnable"),
        enum(ptp, "PtpStatus", **states),
        *node(Node.COMMAND, ptp, "PtpDataSetLatch"),
        *node(Node.INTEGER, ptp, "PtpOffsetFromMaster"),
        Feature("GevIEEE1588", Node.BOOLEAN, ptp, named["PtpEnable"]),
        Feature("GevIEEE1588Status", Node.ENUMERATION, ptp, named["PtpStatus"], entries=tuple(states.items())),
    ]  # fmt: skip
