"""The GenICam description (XML, GenApi schema 1.1) of the camera's features."""

import re
from collections.abc import Sequence
from xml.etree import ElementTree as ET

from simrig.gige.features import Feature, Node
from simrig.gige.registers import WORD, Kind, Register
from simrig.gige.values import MODEL, VENDOR

_ROOT = {
    "ModelName": MODEL, "VendorName": VENDOR, "ToolTip": "Camera of the simulated hill", "StandardNameSpace": "GEV",
    "SchemaMajorVersion": "1", "SchemaMinorVersion": "1", "SchemaSubMinorVersion": "0",
    "MajorVersion": "1", "MinorVersion": "0", "SubMinorVersion": "0",
    "ProductGuid": "5cf0ab4e-6d5c-4d3f-9d55-0d6a3e1f7c01", "VersionGuid": "5cf0ab4e-6d5c-4d3f-9d55-0d6a3e1f7c02",
    "xmlns": "http://www.genicam.org/GenApi/Version_1_1",
}  # fmt: skip


def describe(features: Sequence[Feature]) -> bytes:
    """The XML document, padded with line ends to a multiple of 4 bytes."""
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
    """Name of the register node behind a feature; features that share a register and bits share the node."""
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
