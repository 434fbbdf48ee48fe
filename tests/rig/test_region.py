"""The region of a camera, in a rig and in the text of its file."""

import tomllib
from pathlib import Path

import pytest

from rig.errors import BadInputError
from rig.settings.camera import Region
from rig.settings.file import load_rig
from rig.settings.region import RegionLimits, calibration_unfit, with_region, written_region

TEXT = """name = "hill"
[trigger]
rate_hz = 30.0   # as the generator
[[cameras]]
name = "K1"
backend = "aravis"
address = "192.168.11.2"
region = { x = 4, y = 0, width = 640, height = 480 }   # calibrated in June
[[cameras]]
name = "K2"
backend = "aravis"
address = "192.168.12.2"
[cameras.region]
width = 800  # all
height = 600
[automatic.motion]
camera = "K2"
region = { x = 600, y = 0, width = 100, height = 100 }
"""
OTHER = Region(x=8, y=2, width=320, height=240)


def test_the_region_of_the_calibration_stays_beside_another_one(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    rig = load_rig(path)
    changed = with_region(rig, "K1", OTHER)
    text = written_region(TEXT, "K1", OTHER, changed.cameras[0].calibrated_region)
    before, after = TEXT.splitlines(), text.splitlines()
    assert [line for line in after if line not in before] == [
        "region = { x = 8, y = 2, width = 320, height = 240 }   # calibrated in June",
        "calibrated_region = {x = 4, y = 0, width = 640, height = 480}",
    ]
    path.write_text(text)
    assert load_rig(path) == changed
    assert calibration_unfit(changed.cameras[0]) is not None
    again = with_region(changed, "K1", Region(x=0, y=0, width=64, height=64))
    assert again.cameras[0].calibrated_region == rig.cameras[0].region
    back = with_region(again, "K1", rig.cameras[0].region)
    assert back == rig
    assert written_region(text, "K1", rig.cameras[0].region, None) == TEXT
    table = written_region(TEXT, "K2", OTHER, Region(width=800, height=600))
    assert tomllib.loads(table)["cameras"][1]["region"] == OTHER.model_dump()
    assert "width = 320  # all" in table


def test_a_region_that_the_rest_of_the_rig_does_not_go_with_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    with pytest.raises(BadInputError, match=r"automatic\.motion\.region reaches beyond the frames of K2"):
        with_region(load_rig(path), "K2", OTHER)
    path.write_text(TEXT.replace('"aravis"', '"sim"') + '[simulation]\nscenario = "x.toml"\n')
    with pytest.raises(BadInputError, match="K1 are no part of a larger image"):
        with_region(load_rig(path), "K1", OTHER)


@pytest.mark.parametrize(
    "wrong", [{"x": 4}, {"y": 3}, {"width": 328}, {"height": 241}, {"width": 16}, {"x": 8, "width": 1024}]
)
def test_a_region_off_the_limits_of_the_camera_is_refused(wrong: dict[str, int]) -> None:
    limits = RegionLimits(
        width=1024, height=768, step_x=8, step_y=2, step_width=16, step_height=2, least_width=32, least_height=2
    )
    limits.check("K1", OTHER)
    with pytest.raises(BadInputError, match="K1 has 1024 x 768 px, and no region of"):
        limits.check("K1", OTHER.model_copy(update=wrong))
