"""Another calibration in a rig file: nothing else of it is touched, and old regions are forgotten."""

from pathlib import Path

from rig.settings.editing import with_calibration, written_calibration
from rig.settings.file import load_rig

_TEXT = """\
name = "rig"   # of the hill

[simulation]
scenario = "scenario.toml"

[[cameras]]
name = "K1"
backend = "sim"
calibrated_region = { x = 0, y = 0, width = 320, height = 240 }   # before

[[cameras]]
name = "K2"
backend = "sim"
calibrated_region = { x = 0, y = 0, width = 320, height = 240 }
"""


def test_it_stands_at_the_top_and_the_rest_stays(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    new = written_calibration(_TEXT, tmp_path / "results" / "calibration.json", ["K1"])
    file.write_text(new)
    rig = load_rig(file)
    assert rig.calibration == tmp_path / "results" / "calibration.json"
    assert [camera.calibrated_region is None for camera in rig.cameras] == [True, False]
    assert "# of the hill" in new
    file.write_text(_TEXT)
    before = load_rig(file)
    assert with_calibration(before, tmp_path / "results" / "calibration.json", ["K1"]) == rig


def test_one_that_is_there_is_replaced(tmp_path: Path) -> None:
    once = written_calibration(_TEXT, tmp_path / "one.json", [])
    assert written_calibration(once, tmp_path / "two.json", []) == once.replace("one.json", "two.json")
