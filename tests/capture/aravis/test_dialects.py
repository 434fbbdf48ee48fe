"""What descriptions of cameras do differently, each kind by a small description of our own: nodes added to ours.

The camera's registers are memory (`tests.capture.aravis.described`), as another program has left them. After set-up the
features are asked what they are.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from simrig.gige.registers.genicam import describe
from simrig.gige.registers.makers import DIALECTS, Maker, registers_of
from simrig.gige.registers.register_table import Identity, all_registers
from tests.capture.aravis.described import Described, described
from tests.support.loopback import Loopback

_IDENTITY = Identity("1", "K2", 0x7F00000B, (640, 480), 1_000_000_000, resend=True)
_OFF_ON = ("Off", "On")
_AUTO = ("Off", "Once", "Continuous")


def _register(name: str, address: int, *, kind: str = "IntReg", index: str = "", access: str = "RW") -> str:
    length, sign = (8, "") if kind == "FloatReg" else (4, "<Sign>Unsigned</Sign>")
    place = f'<pIndex Offset="{length}">{index}</pIndex>' if index else ""
    return (
        f'<{kind} Name="{name}"><Address>{address:#x}</Address>{place}<Length>{length}</Length>'
        f"<AccessMode>{access}</AccessMode><pPort>Device</pPort><Cachable>NoCache</Cachable>{sign}"
        f"<Endianess>BigEndian</Endianess></{kind}>"
    )


def _enumeration(name: str, entries: tuple[str, ...], address: int, *, more: str = "", index: str = "") -> str:
    values = "".join(
        f'<EnumEntry Name="{entry}"><Value>{place}</Value></EnumEntry>' for place, entry in enumerate(entries)
    )
    node = f'<Enumeration Name="{name}">{more}{values}<pValue>{name}Register</pValue></Enumeration>'
    return node + _register(f"{name}Register", address, index=index)


def _number(
    name: str,
    address: int,
    limits: tuple[float, ...],
    *,
    real: bool = False,
    unit: str = "",
    index: str = "",
    access: str = "RW",
) -> str:
    low, high, *step = limits
    steps = f"<Inc>{step[0]}</Inc>" if step else ""
    kind = "Float" if real else "Integer"
    node = (
        f'<{kind} Name="{name}"><pValue>{name}Register</pValue><Min>{low}</Min><Max>{high}</Max>{steps}'
        f"{f'<Unit>{unit}</Unit>' if unit else ''}</{kind}>"
    )
    register = f"{kind.removesuffix('eger')[:5]}Reg"
    return node + _register(f"{name}Register", address, kind=register, index=index, access=access)


def _boolean(name: str, address: int) -> str:
    node = f'<Boolean Name="{name}"><pValue>{name}Register</pValue><OnValue>1</OnValue><OffValue>0</OffValue></Boolean>'
    return node + _register(f"{name}Register", address)


def _when(name: str, feature: str, value: int) -> str:
    """A formula that is 1 while a feature has a value."""
    variable = f'<pVariable Name="V">{feature}</pVariable>'
    return f'<IntSwissKnife Name="{name}">{variable}<Formula>V = {value}</Formula></IntSwissKnife>'


def _available(formula: str) -> str:
    return f"<pIsAvailable>{formula}</pIsAvailable>"


@dataclass(frozen=True)
class Kind:
    """One way in which descriptions differ.

    Attributes:
        nodes: added to our description.
        instead: nodes of our description that are left out.
        left: what another program has left behind, in its order.
        wanted: what features have to be after set-up.
        locked: an address that is not written while there is 0 at the other.
        settings: of the rig file.
        notices: what is said about the camera; all of it.
    """

    nodes: str
    instead: tuple[str, ...] = ()
    left: tuple[tuple[str, str | float], ...] = ()
    wanted: Mapping[str, str | float] = field(default_factory=dict)
    locked: tuple[int, int] | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    notices: tuple[str, ...] = ()


_TWO_GAINS = (
    _enumeration("GainSelector", ("DigitalAll", "SensorAll"), 0x20000)
    + _number("Gain", 0x20100, (1, 10), real=True, index="GainSelectorRegister")
    + _enumeration("GainAuto", _AUTO, 0x20200, index="GainSelectorRegister")
)

KINDS = {
    "exposure is automatic again in the exposure mode that is set (FLIR, The Imaging Source)": Kind(
        _when("InTimed", "ExposureMode", 1)
        + _enumeration("ExposureAuto", _AUTO, 0x20000, more=_available("InTimed"))
        + _enumeration("ExposureMode", ("TriggerWidth", "Timed"), 0x20100),
        instead=("ExposureMode",),
        left=(
            ("ExposureMode", "Timed"),
            ("ExposureAuto", "Continuous"),
            ("ExposureMode", "TriggerWidth"),
        ),
        wanted={"ExposureMode": "Timed", "ExposureAuto": "Off"},
    ),
    "sources are there while the trigger is on": Kind(
        _when("TriggerIsOn", "TriggerMode", 1)
        + _enumeration("TriggerMode", _OFF_ON, 0x20000)
        + _enumeration("TriggerSource", ("Software", "Line1", "Line2"), 0x20100, more=_available("TriggerIsOn")),
        instead=("TriggerMode", "TriggerSource"),
        left=(
            ("TriggerMode", "On"),
            ("TriggerSource", "Line1"),
            ("TriggerMode", "Off"),
        ),
        locked=(0x20100, 0x20000),
        settings={"trigger_input": "Line2"},
        wanted={"TriggerMode": "On", "TriggerSource": "Line2"},
    ),
    "the trigger is a boolean": Kind(
        _boolean("TriggerMode", 0x20000), instead=("TriggerMode",), wanted={"TriggerMode": 1}
    ),
    "binning counts in its names (Hikrobot)": Kind(
        _enumeration("BinningHorizontal", ("BinningHorizontal2", "BinningHorizontal1"), 0x20000)
        + _enumeration("DecimationVertical", ("Decimation4", "Decimation2", "Decimation1"), 0x20100),
        left=(
            ("BinningHorizontal", "BinningHorizontal2"),
            ("DecimationVertical", "Decimation4"),
        ),
        wanted={"BinningHorizontal": "BinningHorizontal1", "DecimationVertical": "Decimation1"},
    ),
    "the frame rate has a mode, the frame rate switch is an enumeration (Daheng, Imperx)": Kind(
        _enumeration("AcquisitionFrameRateMode", _OFF_ON, 0x20000)
        + _enumeration("AcquisitionFrameRateEnable", _OFF_ON, 0x20100),
        instead=("AcquisitionFrameRateEnable",),
        left=(
            ("AcquisitionFrameRateMode", "On"),
            ("AcquisitionFrameRateEnable", "On"),
        ),
        wanted={"AcquisitionFrameRateMode": "Off", "AcquisitionFrameRateEnable": "Off"},
    ),
    "a frame rate that has no Off is said to stay": Kind(
        _enumeration("AcquisitionFrameRateMode", ("Fixed", "Burst"), 0x20000),
        left=(("AcquisitionFrameRateMode", "Fixed"),),
        notices=("AcquisitionFrameRateMode stays Fixed: it may ignore pulses",),
    ),
    "grey values pass a table or a Gamma, settings a sequence (Allied Vision, Matrix Vision, Baumer)": Kind(
        _boolean("LUTEnable", 0x20000)
        + _number("Gamma", 0x20100, (0.45, 1.0), real=True)
        + _enumeration("SequencerMode", _OFF_ON, 0x20200),
        left=(
            ("LUTEnable", 1),
            ("Gamma", 0.45),
            ("SequencerMode", "On"),
        ),
        wanted={"LUTEnable": 0, "Gamma": 1.0, "SequencerMode": "Off"},
    ),
    "gain is a factor, of sensor and digital, each automatic (Teledyne Dalsa, JAI)": Kind(
        _TWO_GAINS,
        instead=("Gain",),
        left=(
            ("GainSelector", "DigitalAll"),
            ("Gain", 4.0),
            ("GainAuto", "Continuous"),
            ("GainSelector", "SensorAll"),
            ("Gain", 3.0),
            ("GainAuto", "Continuous"),
            ("GainSelector", "DigitalAll"),
        ),
        settings={"gain_db": 6.0},
        wanted={"GainSelector": "SensorAll", "Gain": 1.99526, "GainAuto": "Off", "DigitalAll": 1.0},
    ),
    "gain is an integer without unit (Emergent, IDS)": Kind(
        _number("Gain", 0x20000, (256, 4095)),
        instead=("Gain",),
        left=(("Gain", 900),),
        settings={"gain_db": 6.0, "gain_step_db": 0.01},
        wanted={"Gain": 856},
    ),
    "gain is an integer without unit, set in steps": Kind(
        _number("Gain", 0x20000, (256, 4095)), instead=("Gain",), settings={"gain_raw": 300}, wanted={"Gain": 300}
    ),
    "gain is a whole number of dB": Kind(
        _number("Gain", 0x20000, (0, 24), unit="dB"), instead=("Gain",), settings={"gain_db": 6.0}, wanted={"Gain": 6}
    ),
    "gain counts tenths of dB": Kind(
        _number("Gain", 0x20000, (0, 240), unit="0.1 dB"),
        instead=("Gain",),
        settings={"gain_db": 6.0, "gain_step_db": 0.1},
        wanted={"Gain": 60},
    ),
    "gain is in a unit of its maker's own": Kind(
        _number("Gain", 0x20000, (0, 100), real=True, unit="%"),
        instead=("Gain",),
        left=(("Gain", 40.0),),
        settings={"gain_db": 6.0},
        wanted={"Gain": 40.0},
        notices=("its gain is in %, not in dB: it stays as it was left",),
    ),
    "the delay between packets has steps": Kind(
        _number("GevSCPD", 0x20000, (0, 100_000, 400)),
        instead=("GevSCPD",),
        left=(("GevSCPD", 90_000),),
        settings={"packet_delay": 1.0},
        wanted={"GevSCPD": 800},
    ),
    "packets have a largest size and steps": Kind(
        _number("GevSCPSPacketSize", 0x20000, (220, 8228, 8)),
        instead=("GevSCPSPacketSize",),
        left=(("GevSCPSPacketSize", 1500),),
        settings={"packet_size": 9000},
        wanted={"GevSCPSPacketSize": 8228},
    ),
    "packets in steps never become larger than the network takes": Kind(
        _number("GevSCPSPacketSize", 0x20000, (576, 8992, 16)),
        instead=("GevSCPSPacketSize",),
        settings={"packet_size": 1500},
        wanted={"GevSCPSPacketSize": 1488},
    ),
    "pixels are locked while the stream's parameters are": Kind(
        _number("TLParamsLocked", 0x20000, (0, 1))
        + _enumeration("PixelFormat", ("Mono12", "Mono8"), 0x20100, more="<pIsLocked>TLParamsLocked</pIsLocked>"),
        instead=("PixelFormat",),
        left=(
            ("PixelFormat", "Mono12"),
            ("TLParamsLocked", 1),
        ),
        wanted={"PixelFormat": "Mono8"},
    ),
    "exposure has steps": Kind(
        _number("ExposureTimeAbs", 0x20000, (21, 100_000, 7)),
        instead=("ExposureTime",),
        settings={"exposure_us": 500.0},
        wanted={"ExposureTimeAbs": 497},
    ),
    "exposure is a float with steps": Kind(
        _number("ExposureTime", 0x20000, (20.0, 100_000.0, 14.8), real=True),
        instead=("ExposureTime",),
        settings={"exposure_us": 500.0},
        wanted={"ExposureTime": 493.6},
    ),
    "exposure is in milliseconds": Kind(
        _number("ExposureTime", 0x20000, (0.01, 100.0), real=True, unit="ms"),
        instead=("ExposureTime",),
        settings={"exposure_us": 500.0},
        wanted={"ExposureTime": 0.5},
    ),
    "exposure is a whole number of nanoseconds": Kind(
        _number("Exposure", 0x20000, (1000, 1_000_000_000), unit="ns"),
        instead=("ExposureTime",),
        settings={"exposure_us": 500.0},
        wanted={"Exposure": 500_000},
    ),
    "bytes per second can only be read, and are the most that there are": Kind(
        _number("StreamBytesPerSecond", 0x20000, (1_000_000, 124_000_000), access="RO"),
        left=(("StreamBytesPerSecond", 124_000_000),),
        wanted={"StreamBytesPerSecond": 124_000_000},
    ),
    "bytes per second can only be read, and could be more": Kind(
        _number("StreamBytesPerSecond", 0x20000, (1_000_000, 124_000_000), access="RO"),
        left=(("StreamBytesPerSecond", 100_000_000),),
        notices=("StreamBytesPerSecond stays 1e+08 bytes per second",),
    ),
    "frames are kept, compressed, or sent only when that is asked for (Allied Vision, FLIR, Lucid, Dalsa)": Kind(
        _enumeration("StreamHoldEnable", _OFF_ON, 0x20000)
        + _enumeration("ImageCompressionMode", ("Off", "Lossless"), 0x20100)
        + _enumeration("transferTurboMode", ("Off", "Active"), 0x20200)
        + _enumeration("TransferControlMode", ("Basic", "UserControlled"), 0x20300),
        left=(
            ("StreamHoldEnable", "On"),
            ("ImageCompressionMode", "Lossless"),
            ("transferTurboMode", "Active"),
            ("TransferControlMode", "UserControlled"),
        ),
        wanted={
            "StreamHoldEnable": "Off",
            "ImageCompressionMode": "Off",
            "transferTurboMode": "Off",
            "TransferControlMode": "Basic",
        },
    ),
    "the input is turned round by another program (FLIR, Basler)": Kind(
        _enumeration("LineSelector", ("Line1", "Line0"), 0x20000) + _boolean("LineInverter", 0x20100),
        left=(("LineInverter", 1),),
        settings={"trigger_input": "Line0"},
        wanted={"LineSelector": "Line0", "LineInverter": 0},
    ),
    "names are written in other ways (Emergent, Sony)": Kind(
        _enumeration("TriggerActivation", ("Falling_Edge", "Rising_Edge"), 0x20000)
        + _enumeration("TriggerSource", ("SOFTWARE", "LINE_1", "LINE_2"), 0x20100)
        + _enumeration("TriggerMode", ("OFF", "ON"), 0x20200),
        instead=("TriggerActivation", "TriggerSource", "TriggerMode"),
        settings={"trigger_input": "Line2"},
        wanted={"TriggerActivation": "Rising_Edge", "TriggerSource": "LINE_2", "TriggerMode": "ON"},
    ),
    "the input waits under the maker's own name (Teledyne Dalsa)": Kind(
        _enumeration("LineSelector", ("Line0", "Line1"), 0x20000) + _number("lineDebouncingPeriod", 0x20100, (0, 255)),
        left=(("lineDebouncingPeriod", 40),),
        settings={"trigger_input": "Line0"},
        notices=("its input waits 40 us for a steady level (lineDebouncingPeriod)",),
    ),
}


#: A command: what was written there last is no setting.
_ACQUISITION_STOP = next(each.address for each in all_registers(_IDENTITY, 0) if each.name == "AcquisitionStop")


def _description(kind: Kind) -> bytes:
    xml = describe(registers_of(Maker.STANDARD, all_registers(_IDENTITY, 0)), DIALECTS[Maker.STANDARD]).decode()
    for name in kind.instead:
        xml = re.sub(rf'<(\w+) Name="{name}">.*?</\1>', "", xml, count=1)
    return xml.replace("<Port ", kind.nodes + "<Port ").encode()


@contextmanager
def _left_by_another_program(kind: Kind, tmp_path: Path, loopback: Loopback) -> Iterator[Described]:
    """A camera of this kind, with the values that another program has left."""
    path = tmp_path / "dialect.xml"
    path.write_bytes(_description(kind))
    with described(path, tmp_path, loopback) as made:
        made.leave(kind.left)
        if kind.locked is not None:
            made.lock(*kind.locked)
        yield made


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS.keys())
def test_a_camera_is_set_up_whatever_another_program_left(kind: Kind, tmp_path: Path, loopback: Loopback) -> None:
    with _left_by_another_program(kind, tmp_path, loopback) as made, made.opened(**kind.settings) as camera:
        features = camera._features
        found: dict[str, str | float | None] = {}
        for name in kind.wanted:
            if name in features.entries("GainSelector"):  # asked last: it changes what is selected
                assert features.choose("GainSelector", name)
                found[name] = features.number("Gain")
            else:
                value = features._value(name)
                found[name] = round(value, 5) if isinstance(value, float) else value
        notices = camera.notices()
    assert found == dict(kind.wanted)
    assert len(notices) == len(kind.notices), notices
    for notice, words in zip(notices, kind.notices, strict=True):
        assert words in notice


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS.keys())
def test_what_another_program_left_is_there_again_after_a_trial(kind: Kind, tmp_path: Path, loopback: Loopback) -> None:
    with _left_by_another_program(kind, tmp_path, loopback) as made:
        before = made.memory()
        with made.opened(set_back=True, **kind.settings):
            assert made.memory() != before
        assert {**made.memory(), _ACQUISITION_STOP: None} == {**before, _ACQUISITION_STOP: None}
