"""Sets format, rate and region of a camera, and checks that it took them."""

from dataclasses import dataclass

from capture.iidc.bandwidth import FIXED_FORMATS, Need, framerate_index, is_fixed_format, need
from capture.iidc.device import Device
from capture.iidc.structures import COLOR_CODING_MONO8, VideoMode
from rig.errors import CameraError
from rig.settings import CameraSettings


@dataclass(frozen=True, slots=True)
class VideoFormat:
    """What was set.

    Attributes:
        mode: libdc1394's number of it.
        name: for people.
        need: packets and bandwidth.
    """

    mode: VideoMode
    name: str
    need: Need


def set_video_format(device: Device, camera: CameraSettings, rate_hz: float) -> VideoFormat:
    """Format, rate and region as the rig file asks for them.

    Raises:
        CameraError: the camera cannot do it.
        BadInputError: no format is that fast.
    """
    device.set_iso_speed(camera.iidc.iso_speed)
    if is_fixed_format(camera) and (fixed := _fixed(device, camera, rate_hz)) is not None:
        return fixed
    return _format7(device, camera, rate_hz)


def _fixed(device: Device, camera: CameraSettings, rate_hz: float) -> VideoFormat | None:
    """A format of the standard; None if this camera does not have it at this rate."""
    region, rate = camera.region, framerate_index(rate_hz)
    mode, _ = FIXED_FORMATS[region.width, region.height]
    if mode not in device.modes() or rate not in device.framerates(mode):
        return None
    device.set_fixed_format(mode, rate)
    return VideoFormat(mode, f"{region.width} x {region.height}", need(camera, rate_hz, fixed=True))


def _format7(device: Device, camera: CameraSettings, rate_hz: float) -> VideoFormat:
    """A region of the sensor, in packets just large enough for the rate."""
    mode, region = VideoMode.FORMAT7_0, camera.region
    if mode not in device.modes():
        raise CameraError(
            f"camera {camera.name} has no format of {region.width} x {region.height} at {rate_hz:g} Hz: set its region "
            "to x = 0, y = 0 and 640 x 480, or lower trigger.rate_hz"
        )
    _check_region(device, camera)
    # Set once so that the camera tells its packet sizes for this region, then with the packet size.
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
    name = f"{region.width} x {region.height} from {region.x}, {region.y}"
    return VideoFormat(mode, name, wanted)


def _set_region(device: Device, camera: CameraSettings, packet_bytes: int) -> None:
    region = camera.region
    device.call(
        "format7_set_roi", VideoMode.FORMAT7_0, COLOR_CODING_MONO8, packet_bytes,
        region.x, region.y, region.width, region.height,
    )  # fmt: skip


def _check_region(device: Device, camera: CameraSettings) -> None:
    """Cameras round a region silently, or refuse it with a number: say before which steps it must have."""
    mode, region = VideoMode.FORMAT7_0, camera.region
    width, height = device.pair("format7_get_max_image_size", mode)
    step_width, step_height = device.pair("format7_get_unit_size", mode)
    step_x, step_y = device.pair("format7_get_unit_position", mode)
    fits = region.x + region.width <= width and region.y + region.height <= height
    steps = ((region.width, step_width), (region.height, step_height), (region.x, step_x), (region.y, step_y))
    if not fits or any(step and value % step for value, step in steps):
        raise CameraError(
            f"camera {camera.name} has {width} x {height} pixels; width and height go in steps of {step_width} and "
            f"{step_height}, x and y of {step_x} and {step_y}: correct its region"
        )
