"""Descriptions of real cameras, whose files are not ours to ship: `SVEV_GENICAM_DIR` names a folder of them."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from capture.aravis.camera import AravisCamera
from rig.action import ActionKeys
from rig.errors import CameraError
from rig.settings.trigger import ActionTrigger
from simrig.gige.registers.genicam import describe
from simrig.gige.registers.makers import DIALECTS, Maker, registers_of
from simrig.gige.registers.register_table import Identity, all_registers
from tests.capture.aravis.described import ORIGIN, described, descriptions
from tests.capture.aravis.makers_table import BEGIN, END, PAGE, simulated, table
from tests.capture.aravis.test_makers import frames_of
from tests.support.loopback import Loopback

_HERE = Path(__file__).parent
_FOLDER = os.environ.get("SVEV_GENICAM_DIR")
_FILES = descriptions(Path(_FOLDER)) if _FOLDER else []
_IDENTITY = Identity("1", "K2", 0x7F00000B, (640, 480), 1_000_000_000, resend=True)


_INQUIRY = """
<StructReg Comment="inquiry">
 <Address>0x14000</Address><Length>4</Length><AccessMode>RO</AccessMode><pPort>Device</pPort>
 <Endianess>BigEndian</Endianess><StructEntry Name="Present"><Bit>0</Bit></StructEntry>
</StructReg>
<IntSwissKnife Name="Inquired">
 <pVariable Name="P">Present</pVariable><Formula>( P = 1 ) ? 1 : 0</Formula>
</IntSwissKnife>
"""


def _one_frame_per_pulse(path: Path, folder: Path, loopback: Loopback) -> None:
    with described(path, folder, loopback) as made, made.opened() as camera:
        made.start(camera)
        pulses, _ = frames_of(camera, made, 4)
    assert pulses == list(range(pulses[0], pulses[0] + 4))


@pytest.mark.parametrize("maker", Maker)
def test_a_camera_with_a_description_alone_takes_one_frame_per_pulse(
    tmp_path: Path, loopback: Loopback, maker: Maker
) -> None:
    path = tmp_path / f"{maker}.xml"
    path.write_bytes(describe(registers_of(maker, all_registers(_IDENTITY, 0)), DIALECTS[maker]))
    _one_frame_per_pulse(path, tmp_path, loopback)


def test_registers_that_say_whether_a_feature_is_there_are_filled(tmp_path: Path, loopback: Loopback) -> None:
    """Point Grey's say so by single bits of inquiry registers, read through formulas."""
    path = tmp_path / "inquiry.xml"
    xml = describe(registers_of(Maker.POINT_GREY, all_registers(_IDENTITY, 0)), DIALECTS[Maker.POINT_GREY]).decode()
    for name in ("TriggerMode", "ExposureTime"):
        xml = re.sub(f'(Name="{name}">)', r"\1<pIsImplemented>Inquired</pIsImplemented>", xml, count=1)
    path.write_text(xml.replace("<Port ", _INQUIRY + "<Port "))
    _one_frame_per_pulse(path, tmp_path, loopback)


_BY_ACTIONS = {"ActionDeviceKey": ActionKeys.of(ORIGIN).device, "ActionGroupKey": 1, "ActionGroupMask": 1}


@dataclass(frozen=True)
class _Setup:
    """What another program left, feature by feature, and what has to be there after set-up.

    Attributes:
        actions: whether it is to expose at scheduled action commands: what is wanted then, beside the keys.
    """

    left: tuple[tuple[str, str | float], ...]
    wanted: Mapping[str, str | float]
    actions: Mapping[str, str | float] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)


OWN = {
    "basler-ace": _Setup(
        left=(
            ("TriggerSelector", "AcquisitionStart"), ("TriggerMode", "On"), ("ExposureAuto", "Continuous"),
            ("GainAuto", "Continuous"), ("GainRaw", 900), ("AcquisitionFrameRateEnable", 1), ("GevSCPD", 90_000),
            ("TestImageSelector", "Testimage1"), ("AcquisitionFrameCount", 5), ("TriggerDelayAbs", 70.0),
        ),
        wanted={
            "TriggerSelector": "FrameStart", "TriggerMode": "On", "TriggerSource": "Line1", "ExposureMode": "Timed",
            "ExposureAuto": "Off", "ExposureTimeAbs": 500.0, "ExposureTimeRaw": 250, "GainAuto": "Off", "GainRaw": 192,
            "AcquisitionFrameRateEnable": 0, "GevSCPD": 0, "TestImageSelector": "Off", "TriggerDelayAbs": 0.0,
        },
        actions={"TriggerSource": "Action1", "GevIEEE1588": 1},
    ),
    "flir-blackfly-s": _Setup(
        left=(
            ("TriggerSelector", "FrameStart"), ("TriggerSource", "Line1"), ("TriggerMode", "On"),
            ("ExposureAuto", "Continuous"), ("GainAuto", "Continuous"), ("Gain", 30.0), ("GammaEnable", 1),
            ("DeviceLinkThroughputLimit", 3_000_000), ("TriggerDelay", 50.0),
        ),
        wanted={
            "TriggerSelector": "FrameStart", "TriggerMode": "On", "TriggerSource": "Line0", "TriggerOverlap": "ReadOut",
            "TriggerDelay": 7.0, "ExposureTime": 500.0, "Gain": 0.0, "GammaEnable": 0,
            "DeviceLinkThroughputLimit": 125_000_000,
        },
        actions={"TriggerSource": "Action0", "GevIEEE1588": 1},
    ),
    "hikrobot": _Setup(
        left=(
            ("TriggerMode", "On"), ("AcquisitionBurstFrameCount", 3), ("BinningHorizontal", "BinningHorizontal2"),
            ("ReverseX", 1), ("Gain", 12.0), ("LineSelector", "Line0"), ("LineMode", "Strobe"),
            ("AcquisitionFrameRateEnable", 1), ("ExposureAuto", "Once"),
        ),
        wanted={
            "TriggerSelector": "FrameBurstStart", "AcquisitionBurstFrameCount": 1, "TriggerSource": "Line0",
            "TriggerActivation": "RisingEdge", "BinningHorizontal": "BinningHorizontal1", "ReverseX": 0, "Gain": 6.0,
            "LineMode": "Input", "AcquisitionFrameRateEnable": 0, "ExposureTime": 500.0, "ExposureAuto": "Off",
        },
        settings={"gain_db": 6.0},
    ),
    "allied-vision-manta": _Setup(
        left=(
            ("TriggerSelector", "AcquisitionEnd"), ("TriggerMode", "On"), ("StreamBytesPerSecond", 3_000_000),
            ("StreamHoldEnable", "On"), ("ExposureAuto", "Other"), ("Gain", 20.0), ("PtpStatus", "Slave"),
        ),
        wanted={
            "TriggerSelector": "FrameStart", "TriggerMode": "On", "TriggerSource": "Line1", "ExposureAuto": "Off",
            "ExposureTimeAbs": 500.0, "Gain": 0.0, "StreamBytesPerSecond": 124_000_000, "StreamHoldEnable": "Off",
            "PtpMode": "Off",
        },
        actions={"TriggerSource": "Action0", "PtpMode": "Auto"},
    ),
    "point-grey-flea3-ge": _Setup(
        left=(
            ("ExposureAuto", "Continuous"), ("GainAuto", "Continuous"), ("Gain", 18.0), ("TriggerDelay", 0.5),
            ("AcquisitionFrameRateEnabled", 1), ("TriggerSource", "Software"), ("TriggerActivation", "FallingEdge"),
        ),
        wanted={
            "TriggerSelector": "ExposureStart", "TriggerMode": "On", "TriggerSource": "Line0", "ExposureMode": "Timed",
            "TriggerActivation": "RisingEdge", "TriggerDelay": 0.0, "ExposureAuto": "Off", "ExposureTime": 500.0,
            "GainAuto": "Off", "Gain": 0.0, "AcquisitionFrameRateEnabled": 0,
        },
    ),
    "prosilica-gc": _Setup(
        left=(("ExposureAuto", "Once"), ("GainAuto", "Once"), ("GainRaw", 20), ("StreamBytesPerSecond", 2_000_000)),
        wanted={
            "TriggerSelector": "FrameStart", "TriggerSource": "Line1", "TriggerActivation": "RisingEdge",
            "ExposureTimeAbs": 500, "GainAuto": "Off", "GainRaw": 6, "StreamBytesPerSecond": 124_000_000,
        },
        settings={"gain_db": 6.0, "gain_step_db": 1.0},
    ),
    "imperx": _Setup(
        left=(("ExposureMode", "Off"), ("ExposureTimeRaw", 90), ("GainRaw", 20), ("AcquisitionFrameRateEnable", "On")),
        wanted={
            "TriggerMode": "On", "TriggerSource": "Line1", "ExposureMode": "Timed", "ExposureTimeRaw": 500,
            "GainRaw": 5, "AcquisitionFrameRateEnable": "Off",
        },
        settings={"gain_raw": 5},
    ),
    "jai-trigger-lines": _Setup(
        left=(
            ("ShutterMode", "NoShutter"), ("LineSelector", "CameraTrigger0"), ("LineInverter", "ActiveLow"),
            ("GainRaw", 300),
        ),
        wanted={
            "ExposureMode": "EdgePreSelect", "ShutterMode": "ProgrammableExposure", "LineSource": "Line5",
            "LineInverter": "ActiveHigh", "ExposureTimeRaw": 500, "GainRaw": 0,
        },
    ),
    "basler-ace-2": _Setup(
        left=(
            ("TriggerSelector", "FrameBurstStart"), ("TriggerMode", "On"), ("DeviceLinkThroughputLimit", 10_000_000),
            ("ExposureAuto", "Continuous"), ("GainAuto", "Continuous"), ("PtpStatus", "Slave"),
        ),
        wanted={
            "TriggerSelector": "FrameStart", "TriggerMode": "On", "TriggerSource": "Line1", "ExposureTime": 500.0,
            "Gain": 0.0, "DeviceLinkThroughputLimit": 125_000_000, "ExposureAuto": "Off", "GainAuto": "Off",
        },
        actions={"TriggerSource": "Action1", "PtpEnable": 1},
    ),
}  # fmt: skip


def _check(camera: AravisCamera, wanted: Mapping[str, str | float]) -> None:
    """Compare features with what is wanted of them; a float has as many digits as its register."""
    found = {name: camera._features._value(name) for name in wanted}
    assert found == {
        name: pytest.approx(each, rel=1e-7) if isinstance(each, float) else each for name, each in wanted.items()
    }


def _address_of(name: str, register: str) -> int:
    text = (_HERE / "descriptions" / f"{name}.xml").read_text()
    (address,) = re.findall(rf'Name="{register}"><Address>(\w+)</Address>', text)
    return int(address, 16)


@pytest.mark.parametrize("name", OWN)
def test_our_own_description_in_the_manner_of_a_maker_is_set_up_whatever_was_left(
    name: str, tmp_path: Path, loopback: Loopback
) -> None:
    case = OWN[name]
    with described(_HERE / "descriptions" / f"{name}.xml", tmp_path, loopback) as made:
        made.leave(case.left)
        with made.opened(exposure_us=500.0, **case.settings) as camera:
            _check(camera, case.wanted)
            made.start(camera)
            pulses, _ = frames_of(camera, made, 3)
            assert pulses == list(range(pulses[0], pulses[0] + 3))


@pytest.mark.parametrize("name", OWN)
def test_what_was_left_is_there_again_after_a_trial(name: str, tmp_path: Path, loopback: Loopback) -> None:
    case = OWN[name]
    with described(_HERE / "descriptions" / f"{name}.xml", tmp_path, loopback) as made:
        made.leave(case.left)
        before = made.memory()
        with made.opened(exposure_us=500.0, set_back=True, **case.settings):
            assert made.memory() != before
        after = made.memory()
    stop = _address_of(name, "AcquisitionStopReg")
    assert {**after, stop: None} == {**before, stop: None}  # a command: what was written there last is no setting


@pytest.mark.parametrize("name", [name for name, case in OWN.items() if case.actions])
def test_our_own_description_in_the_manner_of_a_maker_is_set_up_for_actions(
    name: str, tmp_path: Path, loopback: Loopback
) -> None:
    with described(_HERE / "descriptions" / f"{name}.xml", tmp_path, loopback) as made:
        made.leave([(status, "Slave") for status in ("PtpStatus", "GevIEEE1588StatusLatched") if made.has(status)])
        trigger = ActionTrigger(source="action", rate_hz=30.0, scheduled=True)
        with made.opened(trigger=trigger) as camera:
            _check(camera, {**_BY_ACTIONS, **OWN[name].actions})
            assert not [notice for notice in camera.notices() if "action" in notice.lower()]


def test_every_description_of_ours_is_tried() -> None:
    assert {path.stem for path in descriptions(_HERE / "descriptions")} == set(OWN)


@pytest.mark.skipif(not _FILES, reason="SVEV_GENICAM_DIR names no folder with descriptions (*.xml) of real cameras")
@pytest.mark.parametrize("path", _FILES or [Path("none")], ids=lambda path: path.stem)
def test_a_real_description_is_set_up_or_refused_in_words(path: Path, tmp_path: Path, loopback: Loopback) -> None:
    try:
        _one_frame_per_pulse(path, tmp_path, loopback)
    except CameraError as error:
        pytest.skip(f"refused: {error}")


def test_the_table_of_makers_is_what_the_cameras_say(loopback: Loopback) -> None:
    shown = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    assert shown == table(list(simulated(loopback))), "run: python -m tests.capture.aravis.makers_table"
