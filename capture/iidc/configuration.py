"""Sets a FireWire camera as the rig file says: format, rate, region, trigger, gain and exposure.

The exposure is set last: any other setting may change it back.
"""

from dataclasses import dataclass

from capture.iidc.avt import AvtRegisters
from capture.iidc.bandwidth import FIXED_FORMATS, Need, framerate_index, is_fixed_format, need
from capture.iidc.device import Device
from capture.iidc.structures import (
    COLOR_CODING_MONO8,
    COLOR_CODING_MONO16,
    TRIGGER_SOURCE_0,
    TRIGGER_SOURCE_SOFTWARE,
    Feature,
    VideoMode,
)
from rig.clocks import NS_PER_US
from rig.errors import BadInputError, CameraError
from rig.images.pixels import FORMATS
from rig.settings.camera import CameraSettings
from rig.settings.region import RegionLimits

#: Time from the end of the exposure to the first packet (Marlin manual: 500 us +- 62.5 us).
READOUT_NS = 500_000
#: What `DATA_DEPTH` says of 16-bit pixels if all bits are significant, or if it is not known how many are.
_ALL_BITS = 16
#: Commands, as a number among the trigger sources.
_SOFTWARE = TRIGGER_SOURCE_SOFTWARE - TRIGGER_SOURCE_0


@dataclass(frozen=True, slots=True)
class VideoFormat:
    """The format that was set.

    Attributes:
        mode: libdc1394's number of it.
        name: for people.
        need: its packets and bandwidth.
    """

    mode: int
    name: str
    need: Need


def set_video_format(device: Device, camera: CameraSettings, rate_hz: float) -> VideoFormat:
    """Set format, rate and region.

    Raises:
        CameraError: the camera does not have them.
        BadInputError: no format is that fast.
    """
    device.set_iso_speed(camera.iidc.iso_speed)
    chosen = _fixed(device, camera, rate_hz) if is_fixed_format(camera) else None
    chosen = chosen or _format7(device, camera, rate_hz)
    if _is_deep(camera):
        _check_depth(device.data_depth(), camera)
    return chosen


def _is_deep(camera: CameraSettings) -> bool:
    return camera.format.pixels.size > 1


def _check_depth(depth: int, camera: CameraSettings) -> None:
    """Check that the camera has as many significant bits as logs will say."""
    named = f"Mono{depth}" if f"Mono{depth}" in FORMATS else "Mono16"
    if depth != _ALL_BITS and camera.pixel_format != named:
        raise CameraError(
            f"camera {camera.name} sends pixels of {depth} significant bits, not {camera.pixel_format}: "
            f'set pixel_format = "{named}"'
        )


def _fixed(device: Device, camera: CameraSettings, rate_hz: float) -> VideoFormat | None:
    """Set a fixed format; None if the camera does not have it at this rate."""
    region, rate = camera.region, framerate_index(rate_hz)
    formats = FIXED_FORMATS[region.width, region.height]
    mode = formats.mono16 if _is_deep(camera) else formats.mono8
    if mode not in device.modes() or rate not in device.framerates(mode):
        return None
    device.set_fixed_format(mode, rate)
    return VideoFormat(mode, _name(camera), need(camera, rate_hz, fixed=True))


def _name(camera: CameraSettings) -> str:
    """The format of a fixed size, for people; 8 bits go without saying."""
    return f"{camera.region.width} x {camera.region.height}" + (f" {camera.pixel_format}" if _is_deep(camera) else "")


def _format7(device: Device, camera: CameraSettings, rate_hz: float) -> VideoFormat:
    """Set a region of the sensor, in packets just large enough for the rate."""
    mode, region = _format7_mode(camera), camera.region
    if mode not in device.modes() and camera.iidc.format7_mode:
        there = ", ".join(str(each - VideoMode.FORMAT7_0) for each in device.modes() if each >= VideoMode.FORMAT7_0)
        raise CameraError(
            f"camera {camera.name} has no mode {camera.iidc.format7_mode} of Format7 (it has {there or 'none'}): "
            "correct iidc.format7_mode"
        )
    if mode not in device.modes():
        raise CameraError(
            f"camera {camera.name} has no format of {region.width} x {region.height} at {rate_hz:g} Hz: set its region "
            "to x = 0, y = 0 and 640 x 480, or lower trigger.rate_hz"
        )
    if _is_deep(camera) and COLOR_CODING_MONO16 not in device.color_codings(mode):
        raise CameraError(
            f"camera {camera.name} sends {region.width} x {region.height} at {rate_hz:g} Hz with 8 bits only: set "
            'pixel_format = "Mono8"'
        )
    _check_region(device, camera)
    # Set twice: the camera tells its packet sizes for a region only after the region has been set.
    device.call("video_set_mode", mode)
    _set_region(device, camera, need(camera, rate_hz, fixed=False).packet_bytes)
    unit, largest = device.pair("format7_get_packet_parameters", mode)
    wanted = need(camera, rate_hz, fixed=False, unit_bytes=max(4, unit))
    if wanted.packet_bytes > largest:
        raise CameraError(
            f"camera {camera.name} would need packets of {wanted.packet_bytes} bytes, {largest} is the most at "
            f"{camera.iidc.iso_speed} Mbit/s: make its region smaller or lower trigger.rate_hz"
        )
    _set_region(device, camera, wanted.packet_bytes)
    return VideoFormat(mode, f"{_name(camera)} from {region.x}, {region.y}", wanted)


def _format7_mode(camera: CameraSettings) -> int:
    """libdc1394's number of the mode of Format7."""
    return VideoMode.FORMAT7_0 + camera.iidc.format7_mode


def _coding(camera: CameraSettings) -> int:
    return COLOR_CODING_MONO16 if _is_deep(camera) else COLOR_CODING_MONO8


def _set_region(device: Device, camera: CameraSettings, packet_bytes: int) -> None:
    region = camera.region
    device.call(
        "format7_set_roi", _format7_mode(camera), _coding(camera), packet_bytes,
        region.x, region.y, region.width, region.height,
    )  # fmt: skip


def region_limits(device: Device, camera: CameraSettings) -> RegionLimits | None:
    """Which regions the camera takes in its mode of Format7; None if it has fixed formats only."""
    mode = _format7_mode(camera)
    if mode not in device.modes():
        return None
    width, height = device.pair("format7_get_max_image_size", mode)
    step_width, step_height = (max(1, step) for step in device.pair("format7_get_unit_size", mode))
    step_x, step_y = (max(1, step) for step in device.pair("format7_get_unit_position", mode))
    return RegionLimits(
        width=width, height=height, step_x=step_x, step_y=step_y, step_width=step_width, step_height=step_height,
        least_width=step_width, least_height=step_height,
    )  # fmt: skip


def _check_region(device: Device, camera: CameraSettings) -> None:
    """Check the region: cameras round it silently, or refuse it without saying which steps it must have."""
    if (limits := region_limits(device, camera)) is None:
        return
    try:
        limits.check(camera.name, camera.region)
    except BadInputError as error:
        raise CameraError(f"{error}; correct its region") from None


def set_trigger(device: Device, camera: CameraSettings, *, software: bool) -> None:
    """Let pulses at the camera's input trigger it, or commands.

    Raises:
        CameraError: the camera has no such input, mode or edge.
    """
    if not device.has(Feature.TRIGGER):
        raise CameraError(f"camera {camera.name} has no trigger input: use another camera")
    if software:  # cameras that do not list commands among their sources take them beside the pulses at their input
        listed = _SOFTWARE in device.trigger_sources()
        device.set_trigger(mode=0, source=_SOFTWARE if listed else None, rising=True)
        return
    source, sources = int(camera.trigger_input.removeprefix("Line")), device.trigger_sources()
    # Cameras older than IIDC 1.31 have one input and do not number it.
    if source not in (sources or [0]):
        names = " or ".join(f'"Line{number}"' for number in sources or [0])
        raise CameraError(f"camera {camera.name} has no trigger_input {camera.trigger_input}, but {names}: correct it")
    mode = camera.iidc.trigger_mode
    if mode not in device.trigger_modes():
        raise CameraError(f"camera {camera.name} has no trigger mode {mode}: choose another iidc.trigger_mode")
    rising = camera.trigger_edge == "rising"
    device.set_trigger(mode=mode, source=source if sources else None, rising=rising)


def set_gain(device: Device, camera: CameraSettings) -> None:
    """Set a fixed gain.

    Raises:
        CameraError: the gain is out of the camera's range.
    """
    if not device.has(Feature.GAIN):
        if camera.gain_db:
            raise CameraError(f"camera {camera.name} has no gain: set gain_db = 0")
        return
    device.set_by_hand(Feature.GAIN)
    if device.has_absolute(Feature.GAIN):
        device.set_absolute(Feature.GAIN, camera.gain_db)
        return
    least, greatest = device.boundaries(Feature.GAIN)
    value = least + round(camera.gain_db / camera.iidc.gain_step_db)
    if value > greatest:
        most = (greatest - least) * camera.iidc.gain_step_db
        raise CameraError(f"camera {camera.name} has {most:.1f} dB of gain at most: lower gain_db")
    device.set_raw(Feature.GAIN, value)


def set_exposure(device: Device, avt: AvtRegisters, camera: CameraSettings) -> None:
    """Set the exposure time, by the finest way that the camera has. To be called last.

    Raises:
        CameraError: the exposure is out of the camera's range, or the camera does not tell its steps.
    """
    if camera.iidc.trigger_mode == 1:
        return  # the pulse is as long as the exposure
    device.set_by_hand(Feature.SHUTTER)
    if avt.extended_shutter:
        avt.set_extended_shutter(camera.exposure_us)
    elif device.has_absolute(Feature.SHUTTER):
        _set_absolute(device, camera)
    elif (steps := avt.shutter_steps(camera.exposure_us, camera.iidc.shutter_offset_us)) is not None:
        device.set_raw(Feature.SHUTTER, steps)
    else:
        raise CameraError(
            f"camera {camera.name} cannot be set to an exposure of {camera.exposure_us:g} us: "
            "choose another exposure_us"
        )


def _set_absolute(device: Device, camera: CameraSettings) -> None:
    least, greatest = device.absolute_boundaries(Feature.SHUTTER)
    if not least <= camera.exposure_us / 1e6 <= greatest:
        raise CameraError(
            f"camera {camera.name} can expose {least * 1e6:.0f} to {greatest * 1e6:.0f} us: correct exposure_us"
        )
    device.set_absolute(Feature.SHUTTER, camera.exposure_us / 1e6)


def longest_delay_ns(camera: CameraSettings, period_ns: int) -> int:
    """Longest time from the beginning of the exposure to the first packet, ns."""
    exposure_ns = period_ns if camera.iidc.trigger_mode == 1 else round(camera.exposure_us * NS_PER_US)
    return exposure_ns + READOUT_NS + period_ns // 2
