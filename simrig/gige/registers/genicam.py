"""The camera's GenICam description: its features, and the XML (GenApi schema 1.1) that tells a program of them.

Names of features are those of the Standard Features Naming Convention.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum, StrEnum
from xml.etree import ElementTree as ET

from rig.images.pixels import FORMATS
from simrig.gige.registers.makers import Dialect
from simrig.gige.registers.register_map import WORD, Kind, Register
from simrig.gige.registers.register_table import (
    CLOCK_RESET,
    LATCH,
    MAX_PACKET_SIZE,
    MIN_PACKET_SIZE,
    MODEL,
    VENDOR,
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
        bits: its first and last bit in big-endian counting (0 = most significant); None: the whole register.
        entries: names and values of an enumeration.
        command: value that a command writes.
        limits: smallest and largest value and increment, if they differ from the register's.
        maximum: formula for the largest value, in names of other features.
        unit: unit of the value.
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


def _features(registers: Sequence[Register]) -> list[Feature]:
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
    """Entries of an enumeration; the convention writes SINGLE_FRAME as SingleFrame."""
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
    (Node.BOOLEAN, _TRANSPORT, "GevGVCPExtendedStatusCodes"),
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
    ("PixelFormat", _IMAGE, tuple((name, each.code) for name, each in FORMATS.items())),
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
    """Features that are the whole register of the same name."""
    return [
        *(Feature(name, node, category, named[name]) for node, category, names in _PLAIN for name in names.split()),
        *(Feature(name, Node.FLOAT, category, named[name], unit=unit) for name, category, unit in _MEASURED),
        *(Feature(name, Node.ENUMERATION, category, named[name], entries=e) for name, category, e in _CHOSEN),
    ]


def _regions(named: Mapping[str, Register]) -> list[Feature]:
    """The region of interest; size and offset limit each other."""
    limits = {
        "Width": "SensorWidth-OffsetX",
        "Height": "SensorHeight-OffsetY",
        "OffsetX": "SensorWidth-Width",
        "OffsetY": "SensorHeight-Height",
    }
    return [Feature(name, Node.INTEGER, _IMAGE, named[name], maximum=formula) for name, formula in limits.items()]


def _transport(named: Mapping[str, Register]) -> list[Feature]:
    """Features that are some bits of a register, or write one value to it."""
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


_ROOT = {
    "ModelName": MODEL, "VendorName": VENDOR, "ToolTip": "Camera of the simulated hill", "StandardNameSpace": "GEV",
    "SchemaMajorVersion": "1", "SchemaMinorVersion": "1", "SchemaSubMinorVersion": "0",
    "MajorVersion": "1", "MinorVersion": "0", "SubMinorVersion": "0",
    "ProductGuid": "5cf0ab4e-6d5c-4d3f-9d55-0d6a3e1f7c01", "VersionGuid": "5cf0ab4e-6d5c-4d3f-9d55-0d6a3e1f7c02",
    "xmlns": "http://www.genicam.org/GenApi/Version_1_1",
}  # fmt: skip


def _offered(feature: Feature, dialect: Dialect) -> tuple[tuple[str, int], ...]:
    """The values of an enumeration; of pixel formats those that the maker's cameras have."""
    if feature.name != "PixelFormat" or not dialect.formats:
        return feature.entries
    return tuple((name, value) for name, value in feature.entries if name in dialect.formats)


def _of_the_maker(features: Sequence[Feature], dialect: Dialect, named: Mapping[str, Register]) -> Iterator[Feature]:
    """The features of a maker's cameras."""
    for feature in features:
        if feature.name in dialect.without:
            continue
        entries = dialect.entries.get(feature.name)
        yield replace(
            feature,
            name=dialect.names.get(feature.name, feature.name),
            node=feature.node if entries is None else Node.ENUMERATION,
            category=dialect.categories.get(feature.category, feature.category),
            entries=_offered(feature, dialect) if entries is None else _numbered(entries),
            maximum=_reachable(feature.maximum, dialect.without),
        )
    for extra in dialect.extra:
        node = Node.FLOAT if extra.real else Node.ENUMERATION if extra.entries else Node.INTEGER
        node = Node.COMMAND if extra.command else Node.BOOLEAN if extra.boolean else node
        category = dialect.categories.get(extra.category, extra.category)
        yield Feature(extra.name, node, category, named[extra.name], entries=_numbered(extra.entries))


def _numbered(entries: Sequence[str]) -> tuple[tuple[str, int], ...]:
    return tuple((entry, number) for number, entry in enumerate(entries))


def _reachable(formula: str, without: frozenset[str]) -> str:
    """A formula without what the camera does not have: no offset, so the whole sensor."""
    names = formula.split("-")
    return names[0] if without.intersection(names) else formula


def describe(registers: Sequence[Register], dialect: Dialect) -> bytes:
    """The XML document for a maker's camera with these registers, padded with line ends to a multiple of 4 bytes."""
    named = {register.name: register for register in registers}
    features = list(_of_the_maker(_features(registers), dialect, named))
    root = ET.Element("RegisterDescription", _ROOT)
    categories = dict.fromkeys(feature.category for feature in features)
    _category(root, "Root", categories)
    for category in categories:
        _category(root, category, [feature.name for feature in features if feature.category == category])
    described: set[str] = set()
    for feature in features:
        _feature(root, feature)
        place = _place(feature)
        if feature.node is not Node.STRING and place not in described:
            described.add(place)
            _register(root, feature)
    ET.SubElement(root, "Port", Name="Device")
    document: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return document + b"\n" * (-len(document) % WORD)


def _category(root: ET.Element, name: str, members: Sequence[str] | dict[str, None]) -> None:
    category = ET.SubElement(root, "Category", Name=name)
    for member in members:
        ET.SubElement(category, "pFeature").text = member


def _place(feature: Feature) -> str:
    """Name of the register node behind a feature; features with the same register and bits share it."""
    suffix = "" if feature.bits is None else f"Bits{feature.bits[0]}To{feature.bits[1]}"
    return f"{feature.register.name}{suffix}Register"


def _feature(root: ET.Element, feature: Feature) -> None:
    if feature.node is Node.STRING:
        _access(ET.SubElement(root, feature.node, Name=feature.name), feature.register)
        return
    element = ET.SubElement(root, feature.node, Name=feature.name)
    for name, value in feature.entries:
        entry = ET.SubElement(element, "EnumEntry", Name=name)
        ET.SubElement(entry, "Value").text = str(value)
    ET.SubElement(element, "pValue").text = _place(feature)
    match feature.node:
        case Node.COMMAND:
            ET.SubElement(element, "CommandValue").text = str(feature.command)
        case Node.BOOLEAN:
            ET.SubElement(element, "OnValue").text = "1"
            ET.SubElement(element, "OffValue").text = "0"
        case Node.INTEGER | Node.FLOAT:
            _limits(root, element, feature)


def _limits(root: ET.Element, element: ET.Element, feature: Feature) -> None:
    register = feature.register
    low, high, increment = feature.limits or (register.minimum, register.maximum, register.increment)
    if low is not None:
        ET.SubElement(element, "Min").text = f"{low:g}"
    if feature.maximum:
        name = f"{feature.name}Maximum"
        ET.SubElement(element, "pMax").text = name
        _formula(root, name, feature.maximum)
    elif high is not None:
        ET.SubElement(element, "Max").text = f"{high:.10g}"
    if feature.node is Node.INTEGER and increment != 1:
        ET.SubElement(element, "Inc").text = str(increment)
    if feature.unit:
        ET.SubElement(element, "Unit").text = feature.unit


def _formula(root: ET.Element, name: str, formula: str) -> None:
    knife = ET.SubElement(root, "IntSwissKnife", Name=name)
    for variable in re.findall(r"\w+", formula):
        ET.SubElement(knife, "pVariable", Name=variable.upper()).text = variable
    ET.SubElement(knife, "Formula").text = formula.upper()


def _register(root: ET.Element, feature: Feature) -> None:
    register = feature.register
    if register.kind is Kind.FLOAT:
        _access(ET.SubElement(root, "FloatReg", Name=_place(feature)), register, Endianess="BigEndian")
        return
    sign = "Signed" if register.kind is Kind.INT else "Unsigned"
    if feature.bits is None:
        element = ET.SubElement(root, "IntReg", Name=_place(feature))
        _access(element, register, Sign=sign, Endianess="BigEndian")
        return
    element = ET.SubElement(root, "MaskedIntReg", Name=_place(feature))
    first, last = feature.bits
    _access(element, register, LSB=str(last), MSB=str(first), Sign=sign, Endianess="BigEndian")


def _access(element: ET.Element, register: Register, **details: str) -> None:
    """Address, length and rights of a register node, then its `details`."""
    rights = ("R" if register.readable else "") + ("W" if register.writable else "")
    children = {
        "Address": hex(register.address),
        "Length": str(register.length),
        "AccessMode": {"R": "RO", "W": "WO", "RW": "RW"}[rights],
        "pPort": "Device",
        "Cachable": "NoCache",
        **details,
    }
    for name, text in children.items():
        ET.SubElement(element, name).text = text
