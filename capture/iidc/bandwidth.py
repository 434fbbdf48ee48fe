"""Computes how much of a FireWire bus each camera needs, and refuses a rig whose cameras do not fit.

Of each cycle of 125 us, 100 us may be isochronous: 4915 units, each the time of four bytes at 1600 Mbit/s. A camera
sends one packet per cycle, with three quadlets of header and checksums. The rig must be checked before it starts,
because the kernel reports a full bus only as a missing channel (libdc1394's error -7, not -8).
"""

import math
from collections import defaultdict
from dataclasses import dataclass
from typing import Final

from capture.iidc.clock import CYCLE_NS
from capture.iidc.structures import VideoMode
from rig.errors import BadInputError
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings

UNITS_PER_BUS: Final = 4915
_OVERHEAD_QUADLETS: Final = 3
_UNITS_PER_QUADLET: Final = {100: 16, 200: 8, 400: 4, 800: 2}
#: IIDC's frame rates for fixed formats, in libdc1394's order; each fixes the packet size.
FRAMERATES: Final = (1.875, 3.75, 7.5, 15.0, 30.0, 60.0, 120.0, 240.0)
#: A pulse generator may be faster than a frame rate of the standard by this factor.
_FAST: Final = 1.01
#: A Format7 frame is sent within this share of the period, so that the next one never waits for it.
_SHARE: Final = 0.9


@dataclass(frozen=True, slots=True)
class FixedFormat:
    """Formats of one size that the standard fixes (IIDC 1.31, section 2.2).

    Attributes:
        mono8: libdc1394's mode of 8-bit pixels.
        mono16: libdc1394's mode of 16-bit pixels.
        cycles_at_30: packets of a frame at 30 frames per second. Those of 16-bit pixels are twice as large, not twice
            as many.
    """

    mono8: VideoMode
    mono16: VideoMode
    cycles_at_30: int = 240


#: By width and height.
FIXED_FORMATS: Final = {
    (640, 480): FixedFormat(VideoMode.MONO8_640X480, VideoMode.MONO16_640X480),
    (800, 600): FixedFormat(VideoMode.MONO8_800X600, VideoMode.MONO16_800X600),
    (1024, 768): FixedFormat(VideoMode.MONO8_1024X768, VideoMode.MONO16_1024X768, 256),
    (1280, 960): FixedFormat(VideoMode.MONO8_1280X960, VideoMode.MONO16_1280X960),
    (1600, 1200): FixedFormat(VideoMode.MONO8_1600X1200, VideoMode.MONO16_1600X1200),
}


@dataclass(frozen=True, slots=True)
class Need:
    """What one camera needs of its bus.

    Attributes:
        packet_bytes: payload of one packet.
        packets: per frame.
        units: bandwidth units of its bus.
    """

    packet_bytes: int
    packets: int
    units: int

    @property
    def transport_ns(self) -> int:
        """Time from the first packet of a frame to its last."""
        return self.packets * CYCLE_NS


def is_fixed_format(camera: CameraSettings) -> bool:
    """Whether the region is the whole image of a fixed format of the standard; any other region needs Format7.

    A camera that is to use another mode of Format7 than 0 is to use that.
    """
    region = camera.region
    return (
        camera.iidc.format7_mode == 0 and region.x == region.y == 0 and (region.width, region.height) in FIXED_FORMATS
    )


def framerate_index(rate_hz: float) -> int:
    """Index in `FRAMERATES` of the slowest rate that is not slower than the pulses.

    Raises:
        BadInputError: the pulses are faster than all of them.
    """
    for index, framerate in enumerate(FRAMERATES):
        if rate_hz <= framerate * _FAST:
            return index
    raise BadInputError(f"{rate_hz:g} pulses per second are more than FireWire cameras can do: lower trigger.rate_hz")


def need(camera: CameraSettings, rate_hz: float, *, fixed: bool | None = None, unit_bytes: int = 4) -> Need:
    """What a camera needs of its bus.

    Args:
        camera: its settings.
        rate_hz: pulses per second.
        fixed: whether it sends a fixed format; None: if its region is that of one.
        unit_bytes: packets of Format7 are a multiple of this, which the camera tells.
    """
    if is_fixed_format(camera) if fixed is None else fixed:
        at_30 = FIXED_FORMATS[camera.region.width, camera.region.height].cycles_at_30
        cycles = round(at_30 * 30 / FRAMERATES[framerate_index(rate_hz)])
    else:
        cycles = int(_SHARE * 1e9 / rate_hz / CYCLE_NS)
    packet = math.ceil(camera.frame_bytes / max(1, cycles) / unit_bytes) * unit_bytes
    return Need(packet, math.ceil(camera.frame_bytes / packet), units(packet, camera.iidc.iso_speed))


def units(packet_bytes: int, iso_speed: int) -> int:
    """Bandwidth units of one packet per cycle."""
    return (math.ceil(packet_bytes / 4) + _OVERHEAD_QUADLETS) * _UNITS_PER_QUADLET[iso_speed]


def check_bandwidth(rig: RigSettings) -> None:
    """Check that the FireWire cameras of a rig fit on their buses.

    Raises:
        BadInputError: they do not fit.
    """
    buses: dict[int, list[CameraSettings]] = defaultdict(list)
    for camera in rig.cameras:
        if camera.backend == "iidc":
            buses[camera.iidc.bus].append(camera)
    for bus, cameras in buses.items():
        needs = [need(camera, rig.trigger.rate_hz).units for camera in cameras]
        if sum(needs) > UNITS_PER_BUS:
            each = ", ".join(f"{camera.name} {units}" for camera, units in zip(cameras, needs, strict=True))
            deep = any(camera.format.pixels.size > 1 for camera in cameras)
            raise BadInputError(
                f"the cameras on FireWire bus {bus} need {sum(needs)} of its {UNITS_PER_BUS} bandwidth units ({each}): "
                "take one away, give it a card of its own and say so with iidc.bus, or lower trigger.rate_hz or regions"
                + (', or set pixel_format = "Mono8", which needs half' if deep else "")
            )
