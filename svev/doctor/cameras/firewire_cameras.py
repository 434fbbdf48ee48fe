"""Examines FireWire cameras without changing their settings: connection, bandwidth, exposure, signature."""

from collections.abc import Iterator

from capture.iidc.avt import AvtRegisters
from capture.iidc.bandwidth import UNITS_PER_BUS, check_bandwidth, need
from capture.iidc.bus import Bus, guid_text, why_no_camera
from capture.iidc.configuration import READOUT_NS
from capture.iidc.device import Device
from capture.iidc.point_grey import PointGreyRegisters
from rig.clocks import NS_PER_US
from rig.errors import BadInputError, CameraError
from rig.phrase import phrase
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed, warning


def told(message: str) -> Finding:
    """The finding FAIL of an error message of ours, which is "what is wrong: what to do"."""
    what, _, remedy = message.removeprefix("camera ").partition(": ")
    remedy = remedy or "see docs/how-to/firewire.md"
    return failure(Topic.CAMERAS, "check_camera_refuses", "{what}", "{remedy}", what=what, remedy=remedy)


def look_at_cameras(rig: RigSettings) -> Iterator[tuple[Finding, CameraSettings | None]]:
    """Findings; with a finding that a camera is ready to be tried comes the camera, else None."""
    cameras = [camera for camera in rig.cameras if camera.backend == "iidc"]
    yield _look_at_bandwidth(rig, cameras), None
    for camera in cameras:
        yield _look_at_exposure(camera, rig), None
    try:
        with Bus() as bus:
            there = {found.guid for found in bus.cameras()}
            if not there:
                yield told(why_no_camera()), None
                return
            known = {int(camera.address, 16) for camera in cameras}
            if others := ", ".join(guid_text(guid) for guid in sorted(there - known)):
                what = "also on FireWire, but not in the rig file: {others}"
                yield passed(Topic.CAMERAS, "check_firewire_others", what, others=others), None
            for camera in cameras:
                yield from _look_at_camera(bus, camera)
    except (BadInputError, CameraError) as error:
        yield told(str(error)), None


def _look_at_camera(bus: Bus, camera: CameraSettings) -> Iterator[tuple[Finding, CameraSettings | None]]:
    try:
        with Device(bus, bus.find(int(camera.address, 16))) as device:
            if device.transmits():
                what = "{camera} ({device}) sends frames already"
                remedy = (
                    "end the program that uses it (another svev?); after a crash the next recording switches it off"
                )
                yield (
                    warning(Topic.CAMERAS, "check_camera_sends", what, remedy, camera=camera.name, device=device.name),
                    None,
                )
                return
            what = "{camera} is {device}"
            yield passed(Topic.CAMERAS, "check_firewire_camera", what, camera=camera.name, device=device.name), camera
            yield _look_at_signature(camera, device), None
    except (BadInputError, CameraError) as error:
        yield told(f"{camera.name}, {error}"), None


def _look_at_signature(camera: CameraSettings, device: Device) -> Finding:
    if PointGreyRegisters(device).signs:
        what = "{camera} can number and time its frames (frame information); torn ones pass as pictures"
        return passed(Topic.CAMERAS, "check_numbers", what, camera=camera.name)
    if AvtRegisters(device).signs:
        what = "{camera} can sign its frames (secure image signature)"
        return passed(Topic.CAMERAS, "check_signs", what, camera=camera.name)
    return warning(
        Topic.CAMERAS,
        "check_signs_not",
        "{camera} cannot sign its frames: torn frames pass as pictures, lost ones count as missed",
        "use an AVT camera with firmware 3.03 or newer where every frame counts",
        camera=camera.name,
    )


def _look_at_bandwidth(rig: RigSettings, cameras: list[CameraSettings]) -> Finding:
    try:
        check_bandwidth(rig)
    except BadInputError as error:
        return told(str(error))
    needs = [need(camera, rig.trigger.rate_hz) for camera in cameras]
    each = ", ".join(f"{camera.name} {taken.units}" for camera, taken in zip(cameras, needs, strict=True))
    total = sum(taken.units for taken in needs)
    what = "FireWire bandwidth: {taken} of {units} units ({each})"
    return passed(Topic.CAMERAS, "check_bandwidth", what, taken=total, units=UNITS_PER_BUS, each=each)


def _look_at_exposure(camera: CameraSettings, rig: RigSettings) -> Finding:
    """Is the exposure short enough? A camera that still exposes or sends a frame misses the next pulse."""
    period_ms = rig.trigger.period_ns / 1e6
    exposure_ns = camera.exposure_us * NS_PER_US
    busy_ms = (exposure_ns + READOUT_NS + need(camera, rig.trigger.rate_hz).transport_ns) / 1e6
    text = "{camera}: exposure, readout and transfer take {busy_ms:.1f} of {period_ms:.1f} ms"
    said = phrase("check_exposure", text, camera=camera.name, busy_ms=busy_ms, period_ms=period_ms)
    remedy = "shorten exposure_us, make the region smaller, or lower trigger.rate_hz"
    if exposure_ns + READOUT_NS >= rig.trigger.period_ns:
        what = "{said}: every other pulse will find it exposing"
        return failure(Topic.CAMERAS, "check_exposure_long", what, remedy, said=said)
    if busy_ms > period_ms:
        what = "{said}: pulses may find it busy (overrun)"
        return warning(Topic.CAMERAS, "check_exposure_busy", what, remedy, said=said)
    return judged(Level.PASS, Topic.CAMERAS, said, remedy)
