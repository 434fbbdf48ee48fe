"""Exposure and gain, changed in a rig and in the text of its file."""

import tomllib
from pathlib import Path

import pytest

from rig.errors import BadInputError, UnknownCameraError
from rig.settings.file import load_rig
from rig.settings.light import with_light, written

TEXT = """# Granåsen, seen from the judges
name = "hill"   # the large one

[trigger]
rate_hz = 30.0

[simulation]
scenario = "training.toml"

[[cameras]]
name = "K1"
backend = "sim"
exposure_us = 2000   # morning
region = { width = 640, height = 480 }

[[cameras]]
gain_db = 3.5
name = "K2"
backend = "sim"
"""


def test_only_what_is_changed_is_another_line() -> None:
    changed = written(TEXT, "K1", {"exposure_us": 1500.0, "gain_db": 2.0}).splitlines()
    before = TEXT.splitlines()
    assert [line for line in changed if line not in before] == ["exposure_us = 1500   # morning", "gain_db = 2"]
    assert [line for line in before if line not in changed] == ["exposure_us = 2000   # morning"]
    again = tomllib.loads(written(TEXT, "K2", {"exposure_us": 12.5}))["cameras"]
    assert again == [
        *tomllib.loads(TEXT)["cameras"][:1],
        {"gain_db": 3.5, "name": "K2", "backend": "sim", "exposure_us": 12.5},
    ]
    inline = 'cameras = [{ name = "K1", backend = "sim" }]\n'
    assert tomllib.loads(written(inline, "K1", {"gain_db": 1.0}))["cameras"][0]["gain_db"] == 1


@pytest.mark.parametrize("text", ['name = "hill"\n', "cameras = 3\n", TEXT.replace("K1", "K9"), "name = \n"])
def test_a_file_that_has_become_another_one_is_not_written(text: str) -> None:
    with pytest.raises(BadInputError, match="the rig file"):
        written(text, "K1", {"gain_db": 2.0})


def test_a_rig_with_another_exposure_is_checked_as_its_file_is(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    rig = load_rig(path)
    changed = with_light(rig, "K1", {"exposure_us": 1500.0})
    assert changed.cameras[0] == rig.cameras[0].model_copy(update={"exposure_us": 1500.0})
    assert changed.cameras[1:] == rig.cameras[1:]
    path.write_text(written(TEXT, "K1", {"exposure_us": 1500.0}))
    assert load_rig(path) == changed
    with pytest.raises(UnknownCameraError, match="no camera K4: the rig has K1, K2"):
        with_light(rig, "K4", {"gain_db": 1.0})
    with pytest.raises(BadInputError, match='camera K1: key "gain_db" = 61'):
        with_light(rig, "K1", {"gain_db": 61.0})
    with pytest.raises(BadInputError, match=r"would expose for 33.4 ms, and pulses come every 33.3 ms"):
        with_light(rig, "K1", {"exposure_us": 33_400.0})
