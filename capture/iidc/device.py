"""One open FireWire camera: the calls of libdc1394 that we use, with types. Knows nothing of rigs, rings or pulses."""

import ctypes
from ctypes import byref, c_float, c_int, c_uint32, c_uint64
from types import TracebackType
from typing import Any, Final, Self

from capture.iidc.bus import Bus, Found, guid_text
from capture.iidc.structures import (
    FEATURE_MODE_MANUAL,
    FRAMERATE_1_875,
    TRIGGER_MODES,
    TRIGGER_SOURCE_0,
    ColorCodings,
    Feature,
    Framerates,
    IsoSpeed,
    OperationMode,
    Polarity,
    TriggerSources,
    VideoMode,
    VideoModes,
)
from rig.errors import CameraError

_TRIGGER_INQ: Final = 0x530  # IIDC 1.31, table "Trigger_Mode": bit 16 from the left is mode 0


class Device:
    """A camera that libdc1394 has opened; a context manager. Every call may raise `Dc1394Error`.

    Attributes:
        pointer: `dc1394camera_t *`.
    """

    def __init__(self, bus: Bus, found: Found) -> None:
        self._library = bus.library
        self.pointer = self._library.get("camera_new_unit", bus.handle, found.guid, found.unit)
        if not self.pointer:
            raise CameraError(
                f"FireWire camera {guid_text(found.guid)} is listed but cannot be opened: plug it out and in"
            )

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the camera and free its channel and bandwidth; a second call does nothing."""
        if self.pointer:
            self._library.get("camera_free", self.pointer)
        self.pointer = None

    def call(self, name: str, *arguments: Any) -> None:
        """Call `dc1394_<name>` for this camera."""
        self._library.call(name, self.pointer, *arguments)

    def file_descriptor(self) -> int:
        """Descriptor that is readable when a frame is complete or the bus was reset; -1 while capture is not set up."""
        return int(self._library.get("capture_get_fileno", self.pointer))

    @property
    def name(self) -> str:
        """Vendor, model and GUID."""
        camera = self.pointer.contents
        words = [(text or b"?").decode(errors="replace").strip() for text in (camera.vendor, camera.model)]
        return f"{' '.join(words)}, GUID {guid_text(camera.guid)}"

    @property
    def has_advanced_registers(self) -> bool:
        """Whether the camera has registers of its maker's own."""
        return bool(self.pointer.contents.advanced_features_csr)

    @property
    def vendor_id(self) -> int:
        """The maker's IEEE vendor id."""
        return int(self.pointer.contents.vendor_id)

    # -- transmission and bus ------------------------------------------------------------------------------------

    def set_transmission(self, *, on: bool) -> None:
        """Switch the sending of frames on or off."""
        self.call("video_set_transmission", int(on))

    def transmits(self) -> bool:
        """Whether the camera sends frames."""
        return bool(self._int("video_get_transmission"))

    def set_iso_speed(self, mbit_s: int) -> None:
        """Set the speed at which frames are sent; more than 400 needs IEEE 1394b."""
        speed = IsoSpeed[f"S{mbit_s}"]
        mode = OperationMode.B_1394 if speed > IsoSpeed.S400 else OperationMode.LEGACY
        self.call("video_set_operation_mode", mode)
        self.call("video_set_iso_speed", speed)

    def cycle_timer(self) -> int:
        """The cycle timer of the bus, one word."""
        word, utc_us = c_uint32(), c_uint64()
        self.call("read_cycle_timer", byref(word), byref(utc_us))
        return word.value

    def bandwidth_units(self) -> int:
        """Bandwidth units that the camera needs with its present settings."""
        return self._u32("video_get_bandwidth_usage")

    # -- picture -------------------------------------------------------------------------------------------------

    def modes(self) -> list[int]:
        """Video modes that the camera has."""
        modes = VideoModes()
        self.call("video_get_supported_modes", byref(modes))
        return [int(mode) for mode in modes.modes[: modes.num]]

    def framerates(self, mode: int) -> list[int]:
        """Indices in `bandwidth.FRAMERATES` that the camera has for a fixed format."""
        rates = Framerates()
        self.call("video_get_supported_framerates", mode, byref(rates))
        return [int(rate) - FRAMERATE_1_875 for rate in rates.framerates[: rates.num]]

    def mode(self) -> int:
        """The video mode that is set."""
        return self._int("video_get_mode")

    def color_codings(self, mode: int) -> list[int]:
        """Kinds of pixels that a mode of Format7 has."""
        codings = ColorCodings()
        self.call("format7_get_color_codings", mode, byref(codings))
        return [int(coding) for coding in codings.codings[: codings.num]]

    def data_depth(self) -> int:
        """Significant bits of a pixel in the format that is set (IIDC 1.31, DATA_DEPTH).

        For 16-bit pixels of a camera that does not tell, as all of IIDC 1.30 and before, libdc1394 says 16.
        """
        return self._u32("video_get_data_depth")

    def set_fixed_format(self, mode: VideoMode, framerate: int) -> None:
        """Set a fixed format of the standard, and its rate by index in `bandwidth.FRAMERATES`."""
        self.call("video_set_mode", mode)
        self.call("video_set_framerate", FRAMERATE_1_875 + framerate)

    def pair(self, name: str, *arguments: Any) -> tuple[int, int]:
        """Call a function that returns two numbers."""
        first, second = c_uint32(), c_uint32()
        self.call(name, *arguments, byref(first), byref(second))
        return first.value, second.value

    # -- features ------------------------------------------------------------------------------------------------

    def has(self, feature: Feature) -> bool:
        """Whether the camera has a feature."""
        return bool(self._int("feature_is_present", feature))

    def set_by_hand(self, feature: Feature) -> None:
        """Set a feature to manual, so that the camera does not change it by itself."""
        self.call("feature_set_mode", feature, FEATURE_MODE_MANUAL)

    def set_raw(self, feature: Feature, value: int) -> None:
        """Set a feature, in the camera's own steps."""
        self.call("feature_set_value", feature, value)

    def boundaries(self, feature: Feature) -> tuple[int, int]:
        """Least and greatest value of a feature, in the camera's own steps."""
        return self.pair("feature_get_boundaries", feature)

    def has_absolute(self, feature: Feature) -> bool:
        """Whether the feature can be set in physical units."""
        return bool(self._int("feature_has_absolute_control", feature))

    def set_absolute(self, feature: Feature, value: float) -> None:
        """Set a feature, in physical units (shutter: s, gain: dB)."""
        self.call("feature_set_absolute_control", feature, 1)
        self.call("feature_set_absolute_value", feature, value)

    def absolute_boundaries(self, feature: Feature) -> tuple[float, float]:
        """Least and greatest value of a feature, in physical units."""
        least, greatest = c_float(), c_float()
        self.call("feature_get_absolute_boundaries", feature, byref(least), byref(greatest))
        return least.value, greatest.value

    # -- trigger -------------------------------------------------------------------------------------------------

    def trigger_sources(self) -> list[int]:
        """Numbers of the inputs that can trigger."""
        sources = TriggerSources()
        self.call("external_trigger_get_supported_sources", byref(sources))
        return [int(source) - TRIGGER_SOURCE_0 for source in sources.sources[: sources.num]]

    def trigger_modes(self) -> list[int]:
        """The trigger modes, of 0 to 15, that the camera has."""
        word = self.read_command(_TRIGGER_INQ)
        return [mode for mode in range(16) if word & 0x8000 >> mode]

    def set_trigger(self, *, mode: int, source: int | None, rising: bool) -> None:
        """Let pulses trigger the camera.

        Args:
            mode: trigger mode of the standard.
            source: number of the input; None if the camera has only one and does not number it.
            rising: whether the rising edge triggers.

        Raises:
            CameraError: the camera triggers on rising edges only.
        """
        self.call("external_trigger_set_mode", TRIGGER_MODES[mode])
        if source is not None:
            self.call("external_trigger_set_source", TRIGGER_SOURCE_0 + source)
        if self._int("external_trigger_has_polarity"):
            self.call("external_trigger_set_polarity", Polarity.ACTIVE_HIGH if rising else Polarity.ACTIVE_LOW)
        elif not rising:
            raise CameraError(f'{self.name} triggers on rising edges only: set trigger_edge = "rising"')
        self.call("external_trigger_set_power", 1)

    def fire(self) -> None:
        """Let the camera expose by its software trigger register (IIDC 1.31, Software_Trigger)."""
        self.call("software_trigger_set_power", 1)

    def set_broadcast(self) -> None:
        """Have every later write go to all cameras of the bus; reads are still this one's."""
        self.call("camera_set_broadcast", 1)

    def is_triggered(self) -> bool:
        """Whether pulses trigger the camera."""
        return bool(self._int("external_trigger_get_power"))

    # -- the maker's registers -----------------------------------------------------------------------------------

    def read_command(self, offset: int) -> int:
        """Read a register by its offset from the start of the command registers."""
        word = c_uint32()
        self.call("get_control_registers", offset, byref(word), 1)
        return word.value

    def write_command(self, offset: int, value: int) -> None:
        """Write such a register."""
        self.call("set_control_registers", offset, byref(c_uint32(value)), 1)

    def read_advanced(self, offset: int) -> int:
        """Read one of the maker's registers."""
        word = c_uint32()
        self.call("get_adv_control_registers", offset, byref(word), 1)
        return word.value

    def write_advanced(self, offset: int, value: int) -> None:
        """Write one of the maker's registers."""
        self.call("set_adv_control_registers", offset, byref(c_uint32(value)), 1)

    def _u32(self, name: str, *arguments: Any) -> int:
        value = c_uint32()
        self.call(name, *arguments, byref(value))
        return value.value

    def _int(self, name: str, *arguments: Any) -> int:
        value: ctypes.c_int = c_int()
        self.call(name, *arguments, byref(value))
        return value.value
