"""The unmodified libdc1394, bound as thinly as possible, without the project's own binding."""

import ctypes
import select
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes import POINTER, Structure, byref, c_char_p, c_int, c_uint16, c_uint32, c_uint64, c_void_p
from dataclasses import dataclass
from functools import cache
from typing import Any

OFF, ON = 0, 1
OPERATION_LEGACY = 480
S400 = 2
VGA_MONO8, FORMAT7_0 = 69, 88
RATE_15, RATE_30 = 35, 36
SHUTTER, GAIN, TRIGGER = 423, 424, 428
MANUAL = 736
TRIGGER_MODE_0, TRIGGER_MODE_1 = 384, 385
ACTIVE_LOW, ACTIVE_HIGH = 704, 705
SOURCE_0 = 576
DEFAULT_CAPTURE = 4
POLL = 673
MONO8 = 352
RECOMMENDED_PACKETS = -3


class CameraStruct(Structure):
    _fields_ = (
        ("guid", c_uint64), ("unit", c_int), ("unit_spec_ID", c_uint32), ("unit_sw_version", c_uint32),
        ("unit_sub_sw_version", c_uint32), ("command_registers_base", c_uint32), ("unit_directory", c_uint32),
        ("unit_dependent_directory", c_uint32), ("advanced_features_csr", c_uint64), ("PIO", c_uint64),
        ("SIO", c_uint64), ("strobe", c_uint64), ("format7_csr", c_uint64 * 8), ("iidc_version", c_uint32),
        ("vendor", c_char_p), ("model", c_char_p), ("vendor_id", c_uint32), ("model_id", c_uint32),
        ("rest", c_uint32 * 8),
    )  # fmt: skip


class FrameStruct(Structure):
    _fields_ = (
        ("image", c_void_p), ("size", c_uint32 * 2), ("position", c_uint32 * 2), ("color_coding", c_uint32),
        ("color_filter", c_uint32), ("yuv_byte_order", c_uint32), ("data_depth", c_uint32), ("stride", c_uint32),
        ("video_mode", c_uint32), ("total_bytes", c_uint64), ("image_bytes", c_uint32), ("padding_bytes", c_uint32),
        ("packet_size", c_uint32), ("packets_per_frame", c_uint32), ("timestamp", c_uint64),
        ("frames_behind", c_uint32), ("camera", c_void_p), ("id", c_uint32), ("allocated", c_uint64),
        ("little_endian", c_uint32), ("data_in_padding", c_uint32),
    )  # fmt: skip


class _Id(Structure):
    _fields_ = (("unit", c_uint16), ("guid", c_uint64))


class _List(Structure):
    _fields_ = (("num", c_uint32), ("ids", POINTER(_Id)))


@cache
def functions() -> ctypes.CDLL:
    """The library; loaded only where it is used, because its first user in a process decides what it stands on."""
    loaded = ctypes.CDLL("libdc1394.so.25")
    loaded.dc1394_new.restype = c_void_p
    loaded.dc1394_camera_new.restype = POINTER(CameraStruct)
    loaded.dc1394_camera_new.argtypes = (c_void_p, c_uint64)
    loaded.dc1394_free.argtypes = (c_void_p,)
    loaded.dc1394_camera_enumerate.argtypes = (c_void_p, POINTER(POINTER(_List)))
    loaded.dc1394_camera_free_list.argtypes = (POINTER(_List),)
    for name in ("get", "set"):
        getattr(loaded, f"dc1394_{name}_adv_control_registers").argtypes = (
            POINTER(CameraStruct), c_uint64, POINTER(c_uint32), c_uint32,
        )  # fmt: skip
    return loaded


class Dc1394Error(Exception):
    def __init__(self, function: str, code: int) -> None:
        super().__init__(f"{function}: {code}")
        self.code = code


@dataclass(frozen=True)
class Frame:
    pixels: bytes
    width: int
    height: int
    timestamp_us: int
    packet_bytes: int
    packets: int
    position: tuple[int, int]


class Handle:
    """One camera."""

    def __init__(self, camera: Any) -> None:
        self.camera = camera

    def call(self, function: str, *arguments: Any) -> None:
        code = getattr(functions(), f"dc1394_{function}")(self.camera, *arguments)
        if code != 0:
            raise Dc1394Error(function, code)

    def get(self, function: str, *arguments: Any) -> int:
        value = c_uint32()
        self.call(function, *arguments, byref(value))
        return value.value

    def advanced(self, offset: int) -> int:
        value = c_uint32()
        self.call("get_adv_control_registers", offset, byref(value), 1)
        return value.value

    def set_advanced(self, offset: int, value: int) -> None:
        self.call("set_adv_control_registers", offset, byref(c_uint32(value)), 1)

    def cycle_timer(self) -> tuple[int, int]:
        """The register, and UTC in microseconds."""
        register, local = c_uint32(), c_uint64()
        self.call("read_cycle_timer", byref(register), byref(local))
        return register.value, local.value

    def configure(self, shutter: int = 100) -> None:
        """640 x 480 at 30 Hz by external trigger, signed in the last line."""
        self.call("video_set_operation_mode", OPERATION_LEGACY)
        self.call("video_set_iso_speed", S400)
        self.call("video_set_mode", VGA_MONO8)
        self.call("video_set_framerate", RATE_30)
        self.arm(shutter)

    def arm(self, shutter: int = 100, *, triggered: bool = True) -> None:
        self.call("external_trigger_set_mode", TRIGGER_MODE_0)
        self.call("external_trigger_set_source", SOURCE_0)
        self.call("external_trigger_set_polarity", ACTIVE_HIGH)
        self.call("external_trigger_set_power", ON if triggered else OFF)
        self.call("feature_set_mode", SHUTTER, MANUAL)
        self.call("feature_set_value", SHUTTER, shutter)
        self.set_advanced(0x600, 0x0200FFFF)
        self.set_advanced(0x610, 0x4200FFFF)
        self.set_advanced(0x620, 0x4200FFFF)

    def start(self, ring: int = 16) -> None:
        self.call("capture_setup", ring, DEFAULT_CAPTURE)
        self.call("video_set_transmission", ON)

    def stop(self) -> None:
        self.call("video_set_transmission", OFF)
        self.call("capture_stop")

    def frame(self, timeout_s: float = 1.0) -> Frame | None:
        """The next frame, None if there is none in time."""
        waiting = select.poll()
        waiting.register(functions().dc1394_capture_get_fileno(self.camera), select.POLLIN)
        for _ in range(8):  # events other than frames end the waiting, too
            events = waiting.poll(timeout_s * 1000)
            if not events:
                return None
            found = POINTER(FrameStruct)()
            self.call("capture_dequeue", POLL, byref(found))
            if found:
                return self._copy(found)
        return None

    def _copy(self, found: Any) -> Frame:
        frame = found.contents
        copy = Frame(
            ctypes.string_at(frame.image, frame.image_bytes), frame.size[0], frame.size[1], frame.timestamp,
            frame.packet_size, frame.packets_per_frame, (frame.position[0], frame.position[1]),
        )  # fmt: skip
        self.call("capture_enqueue", found)
        return copy


@contextmanager
def library() -> Iterator[Any]:
    context = functions().dc1394_new()
    assert context
    try:
        yield context
    finally:
        functions().dc1394_free(context)


def guids(context: Any) -> list[int]:
    found = POINTER(_List)()
    code = functions().dc1394_camera_enumerate(context, byref(found))
    assert code == 0
    numbers = [found.contents.ids[index].guid for index in range(found.contents.num)]
    functions().dc1394_camera_free_list(found)
    return numbers


@contextmanager
def opened(context: Any, guid: int) -> Iterator[Handle]:
    camera = functions().dc1394_camera_new(context, guid)
    assert camera, f"no camera {guid:x}"
    try:
        yield Handle(camera)
    finally:
        functions().dc1394_camera_free(camera)
