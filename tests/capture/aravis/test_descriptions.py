"""Descriptions of real cameras, whose files are not ours to ship: `SVEV_GENICAM_DIR` names a folder of them."""

import os
import re
from pathlib import Path

import pytest

from rig.errors import CameraError
from simrig.gige.registers.genicam import describe
from simrig.gige.registers.makers import DIALECTS, Maker, registers_of
from simrig.gige.registers.register_table import Identity, all_registers
from tests.capture.aravis.described import described, descriptions
from tests.capture.aravis.makers_table import BEGIN, END, PAGE, simulated, table
from tests.capture.aravis.test_makers import frames_of
from tests.support.loopback import Loopback

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
