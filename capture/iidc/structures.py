"""Structures and constants of libdc1394 2.2, for calls through ctypes.

`tests/capture/iidc/test_structures.py` compares every size, offset and number with the installed headers.
"""

import ctypes
from ctypes import POINTER, Structure, c_char_p, c_int, c_uint16, c_uint32, c_uint64, c_void_p
from enum import IntEnum
from typing import ClassVar, Final


class Camera(Structure):
    """`dc1394camera_t`."""

    _fields_: ClassVar = [
        ("guid", c_uint64),
        ("unit", c_int),
        ("unit_spec_ID", c_uint32),
        ("unit_sw_version", c_uint32),
        ("unit_sub_sw_version", c_uint32),
        ("command_registers_base", c_uint32),
        ("unit_directory", c_uint32),
        ("unit_dependent_directory", c_uint32),
        ("advanced_features_csr", c_uint64),
        ("PIO_control_csr", c_uint64),
        ("SIO_control_csr", c_uint64),
        ("strobe_control_csr", c_uint64),
        ("format7_csr", c_uint64 * 8),
        ("iidc_version", c_uint32),
        ("vendor", c_char_p),
        ("model", c_char_p),
        ("vendor_id", c_uint32),
        ("model_id", c_uint32),
        ("bmode_capable", c_uint32),
        ("one_shot_capable", c_uint32),
        ("multi_shot_capable", c_uint32),
        ("can_switch_on_off", c_uint32),
        ("has_vmode_error_status", c_uint32),
        ("has_feature_error_status", c_uint32),
        ("max_mem_channel", c_int),
        ("flags", c_uint32),
    ]


class VideoFrame(Structure):
    """`dc1394video_frame_t`."""

    _fields_: ClassVar = [
        ("image", c_void_p),
        ("size", c_uint32 * 2),
        ("position", c_uint32 * 2),
        ("color_coding", c_uint32),
        ("color_filter", c_uint32),
        ("yuv_byte_order", c_uint32),
        ("data_depth", c_uint32),
        ("stride", c_uint32),
        ("video_mode", c_uint32),
        ("total_bytes", c_uint64),
        ("image_bytes", c_uint32),
        ("padding_bytes", c_uint32),
        ("packet_size", c_uint32),
        ("packets_per_frame", c_uint32),
        ("timestamp", c_uint64),
        ("frames_behind", c_uint32),
        ("camera", POINTER(Camera)),
        ("id", c_uint32),
        ("allocated_image_bytes", c_uint64),
        ("little_endian", c_uint32),
        ("data_in_padding", c_uint32),
    ]


class CameraId(Structure):
    """`dc1394camera_id_t`."""

    _fields_: ClassVar = [("unit", c_uint16), ("guid", c_uint64)]


class CameraList(Structure):
    """`dc1394camera_list_t`."""

    _fields_: ClassVar = [("num", c_uint32), ("ids", POINTER(CameraId))]


_MODES, _FRAMERATES, _SOURCES, _CODINGS = 32, 8, 5, 11


class VideoModes(Structure):
    """`dc1394video_modes_t`."""

    _fields_: ClassVar = [("num", c_uint32), ("modes", c_uint32 * _MODES)]


class Framerates(Structure):
    """`dc1394framerates_t`."""

    _fields_: ClassVar = [("num", c_uint32), ("framerates", c_uint32 * _FRAMERATES)]


class ColorCodings(Structure):
    """`dc1394color_codings_t`."""

    _fields_: ClassVar = [("num", c_uint32), ("codings", c_uint32 * _CODINGS)]


class TriggerSources(Structure):
    """`dc1394trigger_sources_t`."""

    _fields_: ClassVar = [("num", c_uint32), ("sources", c_uint32 * _SOURCES)]


CameraPointer = POINTER(Camera)
FramePointer = POINTER(VideoFrame)
ListPointer = POINTER(CameraList)
#: `void (*)(dc1394log_t type, const char *message, void *user)`
LogHandler = ctypes.CFUNCTYPE(None, c_int, c_char_p, c_void_p)


class Code(IntEnum):
    """Error codes that we tell apart."""

    SUCCESS = 0
    FUNCTION_NOT_SUPPORTED = -3
    NO_ISO_CHANNEL = -7
    NO_BANDWIDTH = -8


class Log(IntEnum):
    """`dc1394log_t`."""

    ERROR = 768
    WARNING = 769
    DEBUG = 770


class VideoMode(IntEnum):
    """The values of `dc1394video_mode_t` for monochrome images."""

    MONO8_640X480 = 69
    MONO16_640X480 = 70
    MONO8_800X600 = 73
    MONO8_1024X768 = 76
    MONO16_800X600 = 77
    MONO16_1024X768 = 78
    MONO8_1280X960 = 81
    MONO8_1600X1200 = 84
    MONO16_1280X960 = 85
    MONO16_1600X1200 = 86
    FORMAT7_0 = 88


class OperationMode(IntEnum):
    """`dc1394operation_mode_t`."""

    LEGACY = 480
    B_1394 = 481


class IsoSpeed(IntEnum):
    """`dc1394speed_t`, named by Mbit/s."""

    S100 = 0
    S200 = 1
    S400 = 2
    S800 = 3


class Feature(IntEnum):
    """The values of `dc1394feature_t` that we use."""

    SHUTTER = 423
    GAIN = 424
    TRIGGER = 428


class Polarity(IntEnum):
    """`dc1394trigger_polarity_t`."""

    ACTIVE_LOW = 704
    ACTIVE_HIGH = 705


COLOR_CODING_MONO8: Final = 352
COLOR_CODING_MONO16: Final = 357
FRAMERATE_1_875: Final = 32  #: each of the next numbers is twice as fast, up to 240
#: libdc1394's numbers of the trigger modes; 6 to 13 are none.
TRIGGER_MODES: Final = {**{mode: 384 + mode for mode in range(6)}, 14: 390, 15: 391}
TRIGGER_SOURCE_0: Final = 576
TRIGGER_SOURCE_SOFTWARE: Final = 580
FEATURE_MODE_MANUAL: Final = 736
CAPTURE_POLICY_POLL: Final = 673
CAPTURE_FLAGS_DEFAULT: Final = 4  #: allocate channel and bandwidth
