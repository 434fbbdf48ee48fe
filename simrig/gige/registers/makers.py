"""What cameras of different makers have and what they call it, from their public feature references.

A simulated camera has all features of the naming convention (SFNC); as a camera of a maker it has others instead.
Sources: Basler ace GigE (Product Documentation, "Features"), FLIR Blackfly S (Technical Reference), Hikrobot area scan
cameras (GigE user manual), Allied Vision Manta and Mako ("GigE Features Reference"), JAI Go series (user manual),
The Imaging Source 33G ("GigE property reference"). What the others leave out is after what users of their descriptions
report: Point Grey Flea3 GE, Prosilica GC, Imperx, JAI with a trigger line, Basler ace 2.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final

from rig.images.pixels import FORMATS
from simrig.gige.registers.register_map import Kind, Register


class Maker(StrEnum):
    """Whose features a simulated camera has."""

    STANDARD = "standard"
    BASLER = "basler-ace"
    FLIR = "flir-blackfly-s"
    HIKROBOT = "hikrobot"
    ALLIED_VISION = "allied-vision-manta"
    JAI = "jai-go"
    IMAGING_SOURCE = "imaging-source-33g"
    POINT_GREY = "point-grey-flea3-ge"
    PROSILICA = "prosilica-gc"
    IMPERX = "imperx"
    JAI_LINES = "jai-trigger-lines"
    BASLER_ACE_2 = "basler-ace-2"


@dataclass(frozen=True, slots=True)
class Extra:
    """A feature beyond those of the standard camera.

    Attributes:
        default: value after a restart; for an enumeration the number of its entry.
        entries: of an enumeration, numbered from 0; empty: it is a number, or a command if `command`.
        real: whether the number is a float.
        command: whether it is a command.
        boolean: whether it is a boolean.
        maximum: of a number.
        read_only: whether the camera refuses to have it written.
        category: in which it is listed.
    """

    name: str
    default: float = 0
    entries: tuple[str, ...] = ()
    real: bool = False
    boolean: bool = False
    command: bool = False
    maximum: float = 1e6
    read_only: bool = False
    category: str = "AcquisitionControl"


@dataclass(frozen=True, slots=True)
class Dialect:
    """Features of a maker's cameras.

    Attributes:
        names: the maker's name by standard name.
        without: standard features that these cameras do not have.
        entries: names of an enumeration's values, in their order.
        extra: further features.
        latch_register: whether the bootstrap register latches the clock.
        formats: pixel formats that these cameras have; empty: all.
        read_only: standard features that cannot be written.
        categories: the maker's name of a category by the standard one.
    """

    names: Mapping[str, str] = field(default_factory=dict)
    without: frozenset[str] = frozenset()
    entries: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    extra: tuple[Extra, ...] = ()
    latch_register: bool = True
    formats: tuple[str, ...] = ()
    read_only: frozenset[str] = frozenset()
    categories: Mapping[str, str] = field(default_factory=dict)


_AUTO: Final = ("Off", "Once", "Continuous")
_CONTINUOUS: Final = 2
_SHORT_IDS: Final = frozenset({"GevGVSPExtendedIDMode"})
_COUNTERS: Final = frozenset({"CounterValue", "CounterReset"})
#: The status of PTP is that of the last of these commands; cameras without it tell the present one.
_LATCH: Final = "PtpDataSetLatch"
_PACKED_AS_BEFORE: Final = ("Mono8", "Mono10", "Mono10Packed", "Mono12", "Mono12Packed", "BayerRG8")
#: An entry's place is its value, so the first input is the one that the trigger cable is plugged into.

DIALECTS: Final[Mapping[Maker, Dialect]] = {
    Maker.STANDARD: Dialect(),
    Maker.BASLER: Dialect(
        formats=("Mono8", "Mono12", "Mono12Packed"),
        names={
            "ExposureTime": "ExposureTimeAbs", "AcquisitionFrameRate": "AcquisitionFrameRateAbs",
            "DeviceTemperature": "TemperatureAbs", _LATCH: "GevIEEE1588DataSetLatch",
            "GevIEEE1588Status": "GevIEEE1588StatusLatched",
        },
        without=_SHORT_IDS | _COUNTERS | {"Gain", "PtpEnable", "PtpStatus"},
        entries={
            "TriggerSelector": ("FrameStart", "AcquisitionStart"),
            "TriggerSource": ("Line1", "Line3", "Software", "Action1"),
        },
        extra=(
            Extra("ExposureAuto", _CONTINUOUS, _AUTO), Extra("GainAuto", _CONTINUOUS, _AUTO),
            Extra("GainSelector", 0, ("All",)), Extra("GainRaw", 40, maximum=500),
            Extra("TriggerDelayAbs", 100.0, real=True), Extra("AcquisitionFrameCount", 5, maximum=255),
            Extra("ExposureTimeRaw", 2000), Extra("ActionSelector", 0, maximum=1),
            Extra("TestImageSelector", 1, ("Off", "Testimage1")),
            Extra("LineSelector", 0, ("Line1", "Out1")), Extra("LineDebouncerTimeAbs", 10.0, real=True),
            Extra("ResultingFrameRateAbs", 61.5, real=True, read_only=True),
        ),
    ),
    Maker.FLIR: Dialect(
        names={_LATCH: "GevIEEE1588DataSetLatch", "GevIEEE1588Status": "GevIEEE1588StatusLatched"},
        without=_COUNTERS | {"PtpEnable", "PtpStatus", "GevTimestampControlLatch", "GevTimestampControlReset"},
        entries={
            "TriggerSelector": ("AcquisitionStart", "FrameStart", "FrameBurstStart"),
            "TriggerSource": ("Line0", "Line1", "Software", "Action0"),
        },
        extra=(
            Extra("ExposureAuto", _CONTINUOUS, _AUTO), Extra("GainAuto", _CONTINUOUS, _AUTO),
            Extra("GammaEnable", 1, boolean=True), Extra("TriggerOverlap", 0, ("Off", "ReadOut")),
            Extra("TriggerDelay", 29.0, real=True), Extra("ReverseX", 1, boolean=True),
            Extra("BinningHorizontal", 2, maximum=4), Extra("BinningVertical", 2, maximum=4),
            Extra("TimestampLatch", command=True), Extra("TimestampLatchValue"),
            Extra("DeviceLinkThroughputLimitMode", 0, ("On", "Off")),
            Extra("DeviceLinkThroughputLimit", 3_000_000, maximum=125_000_000),
            Extra("ActionSelector", 0, ("Action0",), read_only=True),
            Extra("AcquisitionResultingFrameRate", 170.0, real=True, read_only=True),
        ),
        latch_register=False,
    ),
    Maker.HIKROBOT: Dialect(
        formats=_PACKED_AS_BEFORE,
        without=_SHORT_IDS | _COUNTERS | {"PtpEnable", "GevIEEE1588", "GevIEEE1588Status", "AcquisitionFrameRate"},
        entries={
            "TriggerSelector": ("FrameBurstStart",),
            "TriggerSource": ("Line0", "Line2", "Software", "Action1", "Action2", "Action3", "Action4"),
        },
        extra=(
            Extra("ExposureAuto", _CONTINUOUS, _AUTO), Extra("GainAuto", _CONTINUOUS, _AUTO),
            Extra("AcquisitionBurstFrameCount", 3, maximum=1023), Extra("TriggerDelay", 0.0, real=True),
            Extra("LineSelector", 0, ("Line0", "Line1")), Extra("LineMode", 0, ("Input", "Strobe")),
            Extra("LineDebouncerTime", 50), Extra("GammaEnable", 0, boolean=True), Extra("ActionSelector", maximum=0),
            Extra("ResultingFrameRate", 60.0, real=True, read_only=True),
        ),
    ),
    Maker.ALLIED_VISION: Dialect(
        names={
            "ExposureTime": "ExposureTimeAbs", "AcquisitionFrameRate": "AcquisitionFrameRateAbs",
            "PtpEnable": "PtpMode",
        },
        without=_COUNTERS
        | {"AcquisitionFrameRateEnable", "GevIEEE1588", "GevIEEE1588Status", "OffsetX", "OffsetY", "GevSCPD", _LATCH},
        entries={
            "TriggerSelector": ("FrameStart", "AcquisitionStart", "AcquisitionEnd"),
            "TriggerSource": ("Line1", "Line2", "Software", "Action0", "Freerun"),
            "PtpEnable": ("Off", "Slave", "Master", "Auto"),
        },
        extra=(
            Extra("ExposureAuto", _CONTINUOUS, ("Off", "Once", "Continuous", "Other")),
            Extra("GainAuto", _CONTINUOUS, _AUTO), Extra("GainSelector", 0, ("All",)),
            Extra("TriggerDelayAbs", 0.0, real=True), Extra("TriggerOverlap", 0, ("Off", "PreviousFrame")),
            Extra("StreamBytesPerSecond", 3_000_000, maximum=124_000_000), Extra("StreamHoldEnable", 1, ("Off", "On")),
            Extra("AcquisitionFrameRateLimit", 67.0, real=True, read_only=True),
        ),
    ),
    Maker.JAI: Dialect(
        formats=_PACKED_AS_BEFORE,
        without=_COUNTERS | {"TriggerActivation", "AcquisitionFrameRateEnable", "PtpEnable", "GevIEEE1588"},
        entries={
            "ExposureMode": ("Timed", "TriggerWidth", "Off"),
            "TriggerSource": ("Line5", "Line6", "Software", "PulseGenerator0"),
        },
        extra=(Extra("GainAuto", 0, _AUTO), Extra("TestPattern", 1, ("Off", "GreyHorizontalRamp"))),
    ),
    Maker.IMAGING_SOURCE: Dialect(
        names={"ExposureTime": "Exposure"},
        without=_SHORT_IDS | _COUNTERS | {"ExposureMode", "TriggerSelector", "PtpEnable", "GevIEEE1588"},
        entries={"TriggerSource": ("Any",)},
        extra=(Extra("ExposureAuto", _CONTINUOUS, _AUTO), Extra("GainAuto", _CONTINUOUS, _AUTO)),
    ),
    Maker.POINT_GREY: Dialect(
        without=_SHORT_IDS | _COUNTERS | {"PtpEnable", "GevIEEE1588"},
        entries={
            "TriggerSelector": ("ExposureStart", "ExposureActive"),
            "TriggerSource": ("Line0", "Line1", "Software"),
        },
        read_only=frozenset({"TriggerSelector"}),
        extra=(Extra("ExposureAuto", _CONTINUOUS, _AUTO), Extra("GainAuto", _CONTINUOUS, _AUTO)),
    ),
    Maker.PROSILICA: Dialect(
        names={"ExposureTime": "ExposureTimeAbs", "AcquisitionFrameRate": "AcquisitionFrameRateAbs"},
        without=_SHORT_IDS | _COUNTERS | {"AcquisitionFrameRateEnable", "Gain", "PtpEnable", "GevIEEE1588", "GevSCPD"},
        entries={"TriggerSource": ("Line1", "Line2", "Software")},
        categories={"AnalogControl": "Gain"},
        extra=(
            Extra("GainAuto", _CONTINUOUS, _AUTO, category="AnalogControl"),
            Extra("GainRaw", 12, maximum=30, category="AnalogControl"),
        ),
    ),
    Maker.IMPERX: Dialect(
        without=_SHORT_IDS | _COUNTERS | {"ExposureTime", "PtpEnable", "GevIEEE1588"},
        entries={"TriggerSource": ("Line1", "Line2", "Software", "PulseGenerator")},
        categories={"AcquisitionControl": "Exposure", "AnalogControl": "Gain"},
        extra=(Extra("ExposureTimeRaw", 9000),),
    ),
    Maker.JAI_LINES: Dialect(
        formats=_PACKED_AS_BEFORE,
        names={"TriggerMode": "ExposureMode", "TriggerSource": "LineSource"},
        without=_SHORT_IDS | _COUNTERS | {
            "ExposureMode", "TriggerSelector", "TriggerActivation", "TriggerSoftware", "AcquisitionFrameRateEnable",
            "Gain", "ExposureTime", "PtpEnable", "GevIEEE1588",
        },
        entries={
            "TriggerMode": ("Continuous", "EdgePreSelect", "PulseWidthControl"),
            "TriggerSource": ("Line4", "Line5", "SoftwareTrigger0", "Action1"),
        },
        extra=(
            Extra("LineSelector", 1, ("CameraTrigger0", "GPOut1")),
            Extra("LineInverter", 1, ("ActiveHigh", "ActiveLow")),
            Extra("ShutterMode", 0, ("NoShutter", "ProgrammableExposure")),
            Extra("ExposureTimeRaw", 9000), Extra("GainRaw", 40, maximum=800),
        ),
    ),
    Maker.BASLER_ACE_2: Dialect(
        without=_COUNTERS | {"GevIEEE1588", "GevIEEE1588Status", "GevSCPD"},
        entries={
            "TriggerSelector": ("FrameBurstStart", "FrameStart"),
            "TriggerSource": ("Line1", "Line2", "Software", "Action1"),
        },
        extra=(
            Extra("ExposureAuto", _CONTINUOUS, _AUTO), Extra("GainAuto", _CONTINUOUS, _AUTO),
            Extra("DeviceLinkThroughputLimitMode", 0, ("On",)),
            Extra("DeviceLinkThroughputLimit", 10_000_000, maximum=125_000_000),
            Extra("BslResultingAcquisitionFrameRate", 51.0, real=True, read_only=True),
        ),
    ),
}  # fmt: skip

_BASE, _STEP = 0x11000, 8


def registers_of(maker: Maker, standard: Sequence[Register]) -> list[Register]:
    """Registers of a maker's cameras, made from those of the standard one."""
    dialect = DIALECTS[maker]
    extra = [_register(each, _BASE + _STEP * place) for place, each in enumerate(dialect.extra)]
    return [*(_as_made(register, dialect) for register in standard), *extra]


def _as_made(register: Register, dialect: Dialect) -> Register:
    if register.name == "GevTimestampControl" and not dialect.latch_register:
        return replace(register, writable=False)
    if register.name == _LATCH and _LATCH in dialect.without:
        return replace(register, writable=False)
    if register.name == "AcquisitionFrameRateEnable" and register.name in dialect.without:
        return replace(register, default=0)  # such a camera takes every pulse
    if register.name == "PixelFormat" and dialect.formats:
        return replace(register, choices=tuple(FORMATS[name].code for name in dialect.formats))
    if register.name in dialect.read_only:
        register = replace(register, writable=False)
    if register.choices and register.name in dialect.entries:
        return replace(register, choices=tuple(range(len(dialect.entries[register.name]))))
    return register


def _register(extra: Extra, address: int) -> Register:
    if extra.command:
        return Register(extra.name, address, writable=True, choices=(1,))
    if extra.entries or extra.boolean:
        choices = tuple(range(len(extra.entries) or 2))
        writable = not extra.read_only
        return Register(extra.name, address, default=int(extra.default), writable=writable, choices=choices)
    if extra.real:
        return Register(
            extra.name,
            address,
            _STEP,
            Kind.FLOAT,
            float(extra.default),
            writable=not extra.read_only,
            minimum=0,
            maximum=extra.maximum,
        )
    low = 1 if "Count" in extra.name or "Binning" in extra.name else 0
    return Register(
        extra.name, address, _STEP, Kind.UINT, int(extra.default), writable=True, minimum=low, maximum=extra.maximum
    )
