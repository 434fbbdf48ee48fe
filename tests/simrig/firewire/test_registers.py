"""The camera's registers as the unmodified libdc1394 reads and writes them."""

import pytest

from tests.simrig.firewire.conftest import GUIDS, RefusedError, StartHill, StartProgram
from tests.simrig.firewire.dc1394 import GAIN, SHUTTER, TRIGGER
from tests.support.waiting import wait_until

PRESENT = 1 << 31
EXTENDED_SHUTTER, INPUT_1 = 0x20C, 0x300


def test_cameras_are_found_by_their_guids(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(3))
    assert program("cameras") == list(GUIDS.values())[:3]
    assert program("open", GUIDS["K2"]) == {
        "vendor": "AVT", "model": "Marlin F080B", "iidc": 548, "advanced": 0x1000000,  # 548: IIDC 1.31
    }  # fmt: skip


def test_features_have_ranges_and_keep_to_them(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    assert [program("get", "feature_is_present", feature) for feature in (SHUTTER, GAIN, TRIGGER)] == [1, 1, 1]
    program("call", "feature_set_value", SHUTTER, 4095)
    assert program("get", "feature_get_value", SHUTTER) == 4095
    program("call", "feature_set_value", GAIN, 2000)
    assert program("get", "feature_get_value", GAIN) == 680
    program("call", "feature_set_value", SHUTTER, 0)
    assert program("get", "feature_get_value", SHUTTER) == 1


def test_the_trigger(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    assert program("get", "external_trigger_get_power") == 1
    assert program("get", "external_trigger_has_polarity") == 1
    program("call", "external_trigger_set_polarity", 704)
    assert program("get", "external_trigger_get_polarity") == 704
    program("call", "external_trigger_set_mode", 385)
    assert program("get", "external_trigger_get_mode") == 385
    program("call", "external_trigger_set_power", 0)
    assert program("get", "external_trigger_get_power") == 0


def test_bandwidth_and_versions(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    assert program("get", "video_get_bandwidth_usage") == 1292
    assert program("advanced", 0x010) & 0xFFFF == 0x0303, "firmware 3.03 has the signature"
    assert program("advanced", INPUT_1) & PRESENT


def test_the_extended_shutter_ends_with_the_next_mode(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    program("set_advanced", EXTENDED_SHUTTER, 5000)
    assert program("advanced", EXTENDED_SHUTTER) == PRESENT | 5000
    program("call", "video_set_framerate", 36)
    assert program("advanced", EXTENDED_SHUTTER) == PRESENT


def test_the_stamps_stand_where_they_are_told_to(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    program("set_advanced", 0x600, 0x02000000)  # first line
    program("start")
    first, second = program("frames", 2)
    assert second["frame_count"] != first["frame_count"] + 1, "not in the last line"
    program("set_advanced", 0x600, 0x0200FFFF)
    first, second = program("frames", 4)[-2:]
    assert second["frame_count"] == first["frame_count"] + 1
    program("set_advanced", 0x610, 0x4200FFFF)
    # on a busy machine frames wait that were taken before
    wait_until(lambda: program("frames", 1)[0]["frame_count"] < first["frame_count"], "frames are counted anew")


def test_a_reset_camera_has_its_defaults(start_hill: StartHill, start_program: StartProgram) -> None:
    program = start_program(start_hill(), "K1")
    program("call", "camera_reset")
    assert program("get", "external_trigger_get_power") == 0
    assert program("get", "feature_get_value", SHUTTER) == 2000


def test_a_frozen_camera_does_not_answer(start_hill: StartHill, start_program: StartProgram) -> None:
    hill = start_hill(2)
    program, other = start_program(hill, "K1"), start_program(hill, "K2")
    hill.freeze("K1")
    with pytest.raises(RefusedError):
        program("get", "feature_get_value", SHUTTER)
    assert other("get", "feature_get_value", SHUTTER) == 100
    hill.thaw("K1")
    assert program("get", "feature_get_value", SHUTTER) == 100
