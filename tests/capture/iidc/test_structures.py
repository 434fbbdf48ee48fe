"""Compares our structures and constants with the installed headers, by a compiled C program."""

import ctypes
import subprocess
from enum import IntEnum
from pathlib import Path

import pytest

from capture.iidc import structures
from capture.iidc.library import _ARGUMENTS, _OTHERS, SONAME
from capture.iidc.structures import (
    Camera,
    CameraId,
    CameraList,
    ColorCodings,
    Framerates,
    TriggerSources,
    VideoFrame,
    VideoModes,
)
from tests.capture.iidc.emulated import GCC

STRUCTURES: dict[str, type[ctypes.Structure]] = {
    "dc1394camera_t": Camera,
    "dc1394video_frame_t": VideoFrame,
    "dc1394camera_id_t": CameraId,
    "dc1394camera_list_t": CameraList,
    "dc1394video_modes_t": VideoModes,
    "dc1394framerates_t": Framerates,
    "dc1394trigger_sources_t": TriggerSources,
    "dc1394color_codings_t": ColorCodings,
}

#: Names of our constants in the headers.
NUMBERS: dict[str, int] = {
    "DC1394_SUCCESS": structures.Code.SUCCESS,
    "DC1394_FUNCTION_NOT_SUPPORTED": structures.Code.FUNCTION_NOT_SUPPORTED,
    "DC1394_NO_ISO_CHANNEL": structures.Code.NO_ISO_CHANNEL,
    "DC1394_NO_BANDWIDTH": structures.Code.NO_BANDWIDTH,
    "DC1394_LOG_ERROR": structures.Log.ERROR,
    "DC1394_LOG_WARNING": structures.Log.WARNING,
    "DC1394_LOG_DEBUG": structures.Log.DEBUG,
    "DC1394_VIDEO_MODE_640x480_MONO8": structures.VideoMode.MONO8_640X480,
    "DC1394_VIDEO_MODE_800x600_MONO8": structures.VideoMode.MONO8_800X600,
    "DC1394_VIDEO_MODE_1024x768_MONO8": structures.VideoMode.MONO8_1024X768,
    "DC1394_VIDEO_MODE_1280x960_MONO8": structures.VideoMode.MONO8_1280X960,
    "DC1394_VIDEO_MODE_1600x1200_MONO8": structures.VideoMode.MONO8_1600X1200,
    "DC1394_VIDEO_MODE_640x480_MONO16": structures.VideoMode.MONO16_640X480,
    "DC1394_VIDEO_MODE_800x600_MONO16": structures.VideoMode.MONO16_800X600,
    "DC1394_VIDEO_MODE_1024x768_MONO16": structures.VideoMode.MONO16_1024X768,
    "DC1394_VIDEO_MODE_1280x960_MONO16": structures.VideoMode.MONO16_1280X960,
    "DC1394_VIDEO_MODE_1600x1200_MONO16": structures.VideoMode.MONO16_1600X1200,
    "DC1394_VIDEO_MODE_FORMAT7_0": structures.VideoMode.FORMAT7_0,
    "DC1394_OPERATION_MODE_LEGACY": structures.OperationMode.LEGACY,
    "DC1394_OPERATION_MODE_1394B": structures.OperationMode.B_1394,
    "DC1394_ISO_SPEED_100": structures.IsoSpeed.S100,
    "DC1394_ISO_SPEED_200": structures.IsoSpeed.S200,
    "DC1394_ISO_SPEED_400": structures.IsoSpeed.S400,
    "DC1394_ISO_SPEED_800": structures.IsoSpeed.S800,
    "DC1394_FEATURE_SHUTTER": structures.Feature.SHUTTER,
    "DC1394_FEATURE_GAIN": structures.Feature.GAIN,
    "DC1394_FEATURE_TRIGGER": structures.Feature.TRIGGER,
    "DC1394_TRIGGER_ACTIVE_LOW": structures.Polarity.ACTIVE_LOW,
    "DC1394_TRIGGER_ACTIVE_HIGH": structures.Polarity.ACTIVE_HIGH,
    "DC1394_COLOR_CODING_MONO8": structures.COLOR_CODING_MONO8,
    "DC1394_COLOR_CODING_MONO16": structures.COLOR_CODING_MONO16,
    "DC1394_FRAMERATE_1_875": structures.FRAMERATE_1_875,
    "DC1394_FRAMERATE_240": structures.FRAMERATE_1_875 + 7,
    "DC1394_TRIGGER_MODE_0": structures.TRIGGER_MODES[0],
    "DC1394_TRIGGER_MODE_1": structures.TRIGGER_MODES[1],
    "DC1394_TRIGGER_MODE_14": structures.TRIGGER_MODES[14],
    "DC1394_TRIGGER_MODE_15": structures.TRIGGER_MODES[15],
    "DC1394_TRIGGER_SOURCE_0": structures.TRIGGER_SOURCE_0,
    "DC1394_TRIGGER_SOURCE_SOFTWARE": structures.TRIGGER_SOURCE_SOFTWARE,
    "DC1394_FEATURE_MODE_MANUAL": structures.FEATURE_MODE_MANUAL,
    "DC1394_CAPTURE_POLICY_POLL": structures.CAPTURE_POLICY_POLL,
    "DC1394_CAPTURE_FLAGS_DEFAULT": structures.CAPTURE_FLAGS_DEFAULT,
}


def _fields(structure: type[ctypes.Structure]) -> list[str]:
    return [field[0] for field in structure._fields_]


def _program() -> str:
    lines = ["#include <dc1394/dc1394.h>", "#include <stddef.h>", "#include <stdio.h>", "int main(void) {"]
    for name, structure in STRUCTURES.items():
        lines.append(f'printf("{name} %zu\\n", sizeof({name}));')
        lines += [f'printf("{name}.{f} %zu\\n", offsetof({name}, {f}));' for f in _fields(structure)]
    lines += [f'printf("{name} %lld\\n", (long long) {name});' for name in NUMBERS]
    return "\n".join([*lines, "return 0; }"])


@pytest.fixture(scope="module")
def of_the_headers(tmp_path_factory: pytest.TempPathFactory) -> dict[str, int]:
    directory: Path = tmp_path_factory.mktemp("headers")
    (directory / "layout.c").write_text(_program())
    program = str(directory / "layout")
    subprocess.run([GCC, "-Wall", "-Werror", "-o", program, str(directory / "layout.c")], check=True, timeout=60)
    printed = subprocess.run([program], capture_output=True, text=True, check=True, timeout=10).stdout
    return {name: int(value) for name, value in (line.split() for line in printed.splitlines())}


@pytest.mark.parametrize("name", STRUCTURES)
def test_sizes_and_offsets_are_those_of_the_installed_headers(name: str, of_the_headers: dict[str, int]) -> None:
    structure = STRUCTURES[name]
    assert ctypes.sizeof(structure) == of_the_headers[name]
    offsets = {field: getattr(structure, field).offset for field in _fields(structure)}
    assert offsets == {field: of_the_headers[f"{name}.{field}"] for field in _fields(structure)}


def test_numbers_are_those_of_the_installed_headers(of_the_headers: dict[str, int]) -> None:
    assert {name: int(value) for name, value in NUMBERS.items()} == {name: of_the_headers[name] for name in NUMBERS}


def test_no_number_is_left_unchecked() -> None:
    enums = [kind for kind in vars(structures).values() if isinstance(kind, type) and issubclass(kind, IntEnum)]
    members = {f"{kind.__name__}.{member.name}" for kind in enums for member in kind}
    checked = {f"{type(value).__name__}.{value.name}" for value in NUMBERS.values() if isinstance(value, IntEnum)}
    assert members == checked


def test_the_headers_declare_every_function_that_we_call(tmp_path: Path) -> None:
    calls = "\n".join(f"(void) dc1394_{name};" for name in (*_ARGUMENTS, *_OTHERS))
    source = tmp_path / "functions.c"
    source.write_text(f"#include <dc1394/dc1394.h>\nint main(void) {{\n{calls}\nreturn 0; }}\n")
    command = [GCC, "-Wall", "-Werror", "-o", str(tmp_path / "functions"), str(source), f"-l:{SONAME}"]
    subprocess.run(command, check=True, timeout=60)
