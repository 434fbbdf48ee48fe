"""Loads libdc1394 and calls its functions: with types, its errors as exceptions and its messages in our log."""

import ctypes
import logging
from ctypes import POINTER, c_char_p, c_float, c_int, c_int32, c_uint32, c_uint64, c_void_p
from functools import cache
from typing import Any, Final

from capture.iidc.structures import (
    CameraPointer,
    Code,
    ColorCodings,
    FramePointer,
    Framerates,
    ListPointer,
    Log,
    LogHandler,
    TriggerSources,
    VideoModes,
)
from rig.errors import BadInputError, CameraError

SONAME: Final = "libdc1394.so.25"

_LOGGER: Final = logging.getLogger("svev.libdc1394")
_LEVELS: Final = {Log.ERROR: logging.WARNING, Log.WARNING: logging.INFO, Log.DEBUG: logging.DEBUG}
_U32, _U64, _FLOAT = POINTER(c_uint32), POINTER(c_uint64), POINTER(c_float)

#: Arguments of the functions that return an error code. A C `enum` is an int.
_ARGUMENTS: Final[dict[str, tuple[Any, ...]]] = {
    "camera_enumerate": (c_void_p, POINTER(ListPointer)),
    "log_register_handler": (c_int, LogHandler, c_void_p),
    "read_cycle_timer": (CameraPointer, _U32, _U64),
    "reset_bus": (CameraPointer,),
    "get_control_registers": (CameraPointer, c_uint64, _U32, c_uint32),
    "set_control_registers": (CameraPointer, c_uint64, _U32, c_uint32),
    "get_adv_control_registers": (CameraPointer, c_uint64, _U32, c_uint32),
    "set_adv_control_registers": (CameraPointer, c_uint64, _U32, c_uint32),
    "video_set_transmission": (CameraPointer, c_int),
    "video_get_transmission": (CameraPointer, POINTER(c_int)),
    "video_set_operation_mode": (CameraPointer, c_int),
    "video_set_iso_speed": (CameraPointer, c_int),
    "video_set_mode": (CameraPointer, c_int),
    "video_get_mode": (CameraPointer, POINTER(c_int)),
    "video_set_framerate": (CameraPointer, c_int),
    "video_get_supported_modes": (CameraPointer, POINTER(VideoModes)),
    "video_get_supported_framerates": (CameraPointer, c_int, POINTER(Framerates)),
    "video_get_bandwidth_usage": (CameraPointer, _U32),
    "video_get_data_depth": (CameraPointer, _U32),
    "format7_set_roi": (CameraPointer, c_int, c_int, *[c_int32] * 5),
    "format7_get_max_image_size": (CameraPointer, c_int, _U32, _U32),
    "format7_get_unit_size": (CameraPointer, c_int, _U32, _U32),
    "format7_get_unit_position": (CameraPointer, c_int, _U32, _U32),
    "format7_get_color_codings": (CameraPointer, c_int, POINTER(ColorCodings)),
    "format7_get_packet_parameters": (CameraPointer, c_int, _U32, _U32),
    "feature_is_present": (CameraPointer, c_int, POINTER(c_int)),
    "feature_set_mode": (CameraPointer, c_int, c_int),
    "feature_set_value": (CameraPointer, c_int, c_uint32),
    "feature_get_boundaries": (CameraPointer, c_int, _U32, _U32),
    "feature_has_absolute_control": (CameraPointer, c_int, POINTER(c_int)),
    "feature_set_absolute_control": (CameraPointer, c_int, c_int),
    "feature_set_absolute_value": (CameraPointer, c_int, c_float),
    "feature_get_absolute_boundaries": (CameraPointer, c_int, _FLOAT, _FLOAT),
    "external_trigger_get_supported_sources": (CameraPointer, POINTER(TriggerSources)),
    "external_trigger_has_polarity": (CameraPointer, POINTER(c_int)),
    "external_trigger_set_power": (CameraPointer, c_int),
    "external_trigger_get_power": (CameraPointer, POINTER(c_int)),
    "external_trigger_set_mode": (CameraPointer, c_int),
    "external_trigger_set_source": (CameraPointer, c_int),
    "external_trigger_set_polarity": (CameraPointer, c_int),
    "software_trigger_set_power": (CameraPointer, c_int),
    "camera_set_broadcast": (CameraPointer, c_int),
    "capture_setup": (CameraPointer, c_uint32, c_uint32),
    "capture_stop": (CameraPointer,),
    "capture_dequeue": (CameraPointer, c_int, POINTER(FramePointer)),
    "capture_enqueue": (CameraPointer, FramePointer),
}

#: The other functions: result, arguments.
_OTHERS: Final[dict[str, tuple[Any, tuple[Any, ...]]]] = {
    "new": (c_void_p, ()),
    "free": (None, (c_void_p,)),
    "camera_free_list": (None, (ListPointer,)),
    "camera_new_unit": (CameraPointer, (c_void_p, c_uint64, c_int)),
    "camera_free": (None, (CameraPointer,)),
    "capture_get_fileno": (c_int, (CameraPointer,)),
    "error_get_string": (c_char_p, (c_int,)),
}

#: The first message of libdc1394 during the present call: its error codes alone rarely tell the reason.
_first_words: Final[list[str]] = []


class Dc1394Error(CameraError):
    """A call of libdc1394 failed.

    Attributes:
        code: libdc1394's error code, negative.
    """

    def __init__(self, function: str, code: int, text: str) -> None:
        super().__init__(text)
        self.function, self.code = function, code


class Library:
    """The functions of libdc1394. Use `load`, which makes one per process."""

    def __init__(self, loaded: ctypes.CDLL) -> None:
        self._functions: dict[str, Any] = {}
        for name, arguments in _ARGUMENTS.items():
            self._bind(loaded, name, c_int, arguments)
        for name, (result, arguments) in _OTHERS.items():
            self._bind(loaded, name, result, arguments)

    def _bind(self, loaded: ctypes.CDLL, name: str, result: Any, arguments: tuple[Any, ...]) -> None:
        function = loaded[f"dc1394_{name}"]
        function.restype, function.argtypes = result, arguments
        self._functions[name] = function

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function that returns an error code.

        Args:
            name: its name without `dc1394_`.
            arguments: its arguments.

        Raises:
            Dc1394Error: it failed.
        """
        _first_words.clear()
        code = self._functions[name](*arguments)
        if code != Code.SUCCESS:
            said = self._functions["error_get_string"](code) or b"unknown error"
            words = f"; {_first_words[0]}" if _first_words else ""
            raise Dc1394Error(name, code, f"dc1394_{name}: {said.decode(errors='replace')} ({code}{words})")

    def get(self, name: str, *arguments: Any) -> Any:
        """Call a function that returns something else than an error code."""
        return self._functions[name](*arguments)


def _to_our_log(kind: int, message: bytes, _user: object) -> None:
    """Log handler for libdc1394."""
    text = message.decode(errors="replace").strip()
    if kind != Log.DEBUG and not _first_words:
        _first_words.append(text)
    _LOGGER.log(_LEVELS[Log(kind)], "%s", text)


_HANDLER: Final = LogHandler(_to_our_log)  # libdc1394 keeps the pointer: this lives as long as the module


@cache
def load() -> Library:
    """Load libdc1394, once per process.

    Raises:
        BadInputError: it is not installed.
    """
    try:
        library = Library(ctypes.CDLL(SONAME))
    except (OSError, AttributeError) as error:
        raise BadInputError(
            f"FireWire cameras need libdc1394, which cannot be loaded ({error}): run: sudo apt-get install libdc1394-25"
        ) from None
    for kind in Log:
        library.call("log_register_handler", kind, _HANDLER, None)
    return library
