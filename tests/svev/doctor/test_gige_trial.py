"""The doctor opens cameras as a recording would, says what would be refused, and sets them back."""

from pathlib import Path
from typing import Any

import pytest

from rig.settings.model import RigSettings
from simrig.gige.registers.makers import DIALECTS, Maker
from svev.doctor.cameras.gige_trial import try_camera
from svev.doctor.finding import Finding, Level
from tests.capture.aravis.test_makers import Made, make
from tests.support.loopback import Loopback

#: No settings: written by opening control channel and stream, and by reading the clock.
_CHANNELS = frozenset(
    {"GevCCP", "GevSCP", "GevSCDA", "GevHeartbeatTimeout", "GevTimestampControl", "TimestampLatchValue"}
)


def _try(made: Made, **settings: Any) -> list[Finding]:
    camera = made.rig.cameras[0].model_copy(update={"trigger_input": made.input, **settings})
    rig: RigSettings = made.rig.model_copy(update={"cameras": (camera,)})
    return list(try_camera(rig, camera))


def _settings(made: Made) -> dict[str, bytes]:
    registers = made.registers
    return {
        name: bytes(registers._memory[each.address : each.address + each.length])
        for name, each in registers._named.items()
        if each.writable and name not in _CHANNELS
    }


@pytest.mark.parametrize("maker", Maker)
def test_a_camera_that_was_tried_is_as_it_was(tmp_path: Path, loopback: Loopback, maker: Maker) -> None:
    with make(maker, tmp_path, loopback) as made:
        before = _settings(made)
        codes = {finding.code for finding in _try(made)}
        assert "check_would_be_taken" in codes
        assert ("check_gain_steps" in codes) == ("Gain" in DIALECTS[maker].without)
        assert _settings(made) == before


@pytest.mark.parametrize(
    ("maker", "settings", "told"),
    [
        (Maker.BASLER, {"trigger_input": "Line7"}, 'would be refused: K2 has no trigger input "Line7" (it has Line1, '),
        (Maker.HIKROBOT, {"pixel_format": "Mono10p"}, "would be refused: K2 has no pixel format Mono10p (it has "),
    ],
)
def test_what_a_recording_would_refuse_is_said_beforehand_and_set_back(
    tmp_path: Path, loopback: Loopback, maker: Maker, settings: dict[str, str], told: str
) -> None:
    with make(maker, tmp_path, loopback) as made:
        before = _settings(made)
        (refused,) = _try(made, **settings)
        assert (refused.level, refused.what.startswith(told)) == (Level.FAIL, True)
        assert refused.remedy.startswith("correct ")
        assert _settings(made) == before


def test_what_limits_a_camera_and_the_steps_of_its_gain_are_said(tmp_path: Path, loopback: Loopback) -> None:
    with make(Maker.BASLER, tmp_path, loopback) as made:
        made.registers.set("ResultingFrameRateAbs", 21.5)
        findings = _try(made, gain_db=3.0)
    assert [(each.level, each.code) for each in findings] == [
        (Level.PASS, "check_would_be_taken"),
        *[(Level.WARN, "check_would_be_limited")] * 3,
        (Level.PASS, "check_gain_steps"),
    ]
    assert "its gain has no unit (GainRaw, 0 to 500)" in findings[2].what
    assert "it takes 21.5 frames per second at most (ResultingFrameRateAbs), and 30 pulses come" in findings[3].what
    assert findings[4].what == "K2 has its gain in steps: gain_raw goes from 0 to 500"


def test_a_camera_that_cannot_describe_itself_is_said_to_answer(tmp_path: Path, loopback: Loopback) -> None:
    with make(Maker.STANDARD, tmp_path, loopback) as made:
        made.registers._documents = {place: b"?" * len(text) for place, text in made.registers._documents.items()}
        (refused,) = _try(made)
    assert refused.what == "would be refused: K2 answers, but its description of itself cannot be read"
    assert refused.remedy == "update its firmware, or use another camera"
