"""Another rate of the pulses, in a rig and in the text of its file."""

import tomllib
from pathlib import Path

import pytest

from rig.errors import BadInputError
from rig.settings.editing import with_rate, written_rate
from rig.settings.file import load_rig

TEXT = """name = "hill"

[trigger]
source = "gpio"
line = 18
rate_hz = 30.0   # the cameras' limit is 60
pulse_ms = 4.0

[simulation]
scenario = "training.toml"

[[cameras]]
name = "K1"
backend = "sim"
exposure_us = 12500
"""


def test_a_rig_with_another_rate_is_that_of_the_written_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    changed = with_rate(load_rig(path), 50.0)
    text = written_rate(TEXT, 50.0)
    assert [line for line in text.splitlines() if line not in TEXT.splitlines()] == [
        "rate_hz = 50   # the cameras' limit is 60"
    ]
    path.write_text(text)
    assert load_rig(path) == changed
    without = TEXT.replace("rate_hz = 30.0   # the cameras' limit is 60\n", "")
    assert tomllib.loads(written_rate(without, 12.5))["trigger"]["rate_hz"] == 12.5


@pytest.mark.parametrize(
    ("rate_hz", "complaint"),
    [
        (80.0, r"pulses would come every 12.5 ms, and camera K1 exposes for 12.5 ms: choose a lower rate"),
        (200.0, r"trigger.pulse_ms = 4 is more than half of the time between two pulses at 200 Hz: make it 2.5"),
        (2000.0, 'key "rate_hz" = 2000'),
    ],
)
def test_a_rate_that_source_or_cameras_cannot_do_is_refused(tmp_path: Path, rate_hz: float, complaint: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(TEXT)
    rig = load_rig(path)
    with pytest.raises(BadInputError, match=complaint):
        with_rate(rig, rate_hz)


@pytest.mark.parametrize("text", ['name = "hill"\n', "trigger = 3\n", "name = \n"])
def test_a_file_that_has_become_another_one_is_not_written(text: str) -> None:
    with pytest.raises(BadInputError, match="the rig file"):
        written_rate(text, 50.0)
