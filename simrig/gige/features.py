"""The camera's GenICam features over its registers, in the names of the Standard Features Naming Convention."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum, StrEnum

from simrig.gige.registers import Register
from simrig.gige.values import (
    CLOCK_RESET,
    LATCH,
    MAX_PACKET_SIZE,
    MIN_PACKET_SIZE,
    MONO8,
    AcquisitionMode,
    ExposureMode,
    PtpStatus,
    TriggerSource,
)


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


def features(registers: Sequence[Register]) -> list[Feature]:
    """The features of a camera with these registers."""
    named = {register.name: register for register in registers}
    return [
        *_whole_registers(named),
        *_regions(named),
        *_transport(named),
        Feature("DeviceID", Node.STRING, "DeviceControl", named["DeviceSerialNumber"]),
        Feature("GevIEEE1588", Node.BOOLEAN, "PtpControl", named["PtpEnable"]),
        Feature("GevIEEE1588Status", Node.ENUMERATION, "PtpControl", named["PtpStatus"], entries=_entries(PtpStatus)),
    ]


def _entries(values: type[IntEnum]) -> tuple[tuple[str, int], ...]:
    """Names as the convention writes them: SINGLE_FRAME becomes SingleFrame."""
    return tuple((value.name.title().replace("_", ""), int(value)) for value in values)


_DEVICE, _IMAGE, _ACQUISITION = "DeviceControl", "ImageFormatControl", "AcquisitionControl"
_TRANSPORT, _ACTIONS, _COUNTERS = "TransportLayerControl", "ActionControl", "CounterAndTimerControl"
_PLAIN: tuple[tuple[Node, str, str], ...] = (
    (Node.STRING, _DEVICE, "DeviceVendorName DeviceModelName DeviceVersion DeviceManufacturerInfo"),
    (Node.STRING, _DEVICE, "DeviceSerialNumber DeviceUserID"),
    (Node.INTEGER, _IMAGE, "SensorWidth SensorHeight"),
    (Node.COMMAND, _ACQUISITION, "AcquisitionStart AcquisitionStop TriggerSoftware"),
    (Node.BOOLEAN, _ACQUISITION, "AcquisitionFrameRateEnable"),
    (Node.INTEGER, _COUNTERS, "CounterValue"),
    (Node.COMMAND, _COUNTERS, "CounterReset"),
    (Node.COMMAND, "UserSetControl", "UserSetLoad"),
    (Node.INTEGER, _ACTIONS, "ActionDeviceKey ActionGroupKey ActionGroupMask"),
    (Node.INTEGER, _TRANSPORT, "PayloadSize GevTimestampTickFrequency GevTimestampValue GevCCP GevHeartbeatTimeout"),
    (Node.INTEGER, _TRANSPORT, "GevSCPD GevCurrentIPAddress"),
    (Node.BOOLEAN, "PtpControl", "PtpEnable"),
    (Node.COMMAND, "PtpControl", "PtpDataSetLatch"),
    (Node.INTEGER, "PtpControl", "PtpOffsetFromMaster"),
)
_MEASURED = (
    ("DeviceTemperature", _DEVICE, "C"),
    ("AcquisitionFrameRate", _ACQUISITION, "Hz"),
    ("ExposureTime", _ACQUISITION, "us"),
    ("Gain", "AnalogControl", "dB"),
)
_CHOSEN = (
    ("PixelFormat", _IMAGE, (("Mono8", MONO8),)),
    ("AcquisitionMode", _ACQUISITION, _entries(AcquisitionMode)),
    ("TriggerSelector", _ACQUISITION, (("FrameStart", 0),)),
    ("TriggerMode", _ACQUISITION, (("Off", 0), ("On", 1))),
    ("TriggerSource", _ACQUISITION, _entries(TriggerSource)),
    ("TriggerActivation", _ACQUISITION, (("RisingEdge", 0), ("FallingEdge", 1))),
    ("ExposureMode", _ACQUISITION, _entries(ExposureMode)),
    ("UserSetSelector", "UserSetControl", (("Default", 0),)),
    ("PtpStatus", "PtpControl", _entries(PtpStatus)),
)


def _whole_registers(named: Mapping[str, Register]) -> list[Feature]:
    """Features that are a register of the same name."""
    return [
        *(Feature(name, node, category, named[name]) for node, category, names in _PLAIN for name in names.split()),
        *(Feature(name, Node.FLOAT, category, named[name], unit=unit) for name, category, unit in _MEASURED),
        *(Feature(name, Node.ENUMERATION, category, named[name], entries=e) for name, category, e in _CHOSEN),
    ]


def _regions(named: Mapping[str, Register]) -> list[Feature]:
    """The region of interest, whose parts limit each other."""
    limits = {
        "Width": "SensorWidth-OffsetX",
        "Height": "SensorHeight-OffsetY",
        "OffsetX": "SensorWidth-Width",
        "OffsetY": "SensorHeight-Height",
    }
    return [Feature(name, Node.INTEGER, _IMAGE, named[name], maximum=formula) for name, formula in limits.items()]


def _transport(named: Mapping[str, Register]) -> list[Feature]:
    """Features that are bits, or certain values, of a register."""
    scps, control, stream = named["GevSCPS"], named["GevTimestampControl"], named["GevGVSPConfiguration"]
    sizes, switch = (MIN_PACKET_SIZE, MAX_PACKET_SIZE, 4), (("Off", 0), ("On", 1))
    return [
        Feature("GevGVCPHeartbeatDisable", Node.BOOLEAN, _TRANSPORT, named["GevGVCPConfiguration"], bits=(31, 31)),
        Feature("GevSCPSPacketSize", Node.INTEGER, _TRANSPORT, scps, bits=(16, 31), limits=sizes),
        Feature("GevSCPSDoNotFragment", Node.BOOLEAN, _TRANSPORT, scps, bits=(1, 1)),
        Feature("GevSCPSFireTestPacket", Node.COMMAND, _TRANSPORT, scps, bits=(0, 0)),
        Feature("GevTimestampControlLatch", Node.COMMAND, _TRANSPORT, control, command=LATCH),
        Feature("GevTimestampControlReset", Node.COMMAND, _TRANSPORT, control, command=CLOCK_RESET),
        Feature("GevGVSPExtendedIDMode", Node.ENUMERATION, _TRANSPORT, stream, bits=(1, 1), entries=switch),
    ]
