"""Compares the exposure of each camera with the time between two pulses."""

from collections.abc import Iterator

from rig.clocks import NS_PER_US
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from svev.doctor.finding import Finding, Topic, failure, passed


def look_at_exposures(rig: RigSettings) -> Iterator[Finding]:
    """Is every exposure shorter than the period? Of FireWire cameras more is known: `svev.doctor.cameras.firewire`."""
    cameras = [camera for camera in rig.cameras if camera.backend not in {"iidc", "replay"}]
    if not cameras:
        return
    longer = [finding for camera in cameras if (finding := exposes_on(camera, rig)) is not None]
    yield from longer
    if not longer:
        what = "exposures take {exposure:.1f} ms at most, pulses come every {period:.1f} ms"
        longest_ms = max(camera.exposure_us for camera in cameras) / 1000
        period_ms = rig.trigger.period_ns / 1e6
        yield passed(Topic.CAMERAS, "check_exposures", what, exposure=longest_ms, period=period_ms)


def exposes_on(camera: CameraSettings, rig: RigSettings) -> Finding | None:
    """A failure if a camera still exposes when the next pulse comes, which it then misses; else None."""
    if camera.exposure_us < rig.trigger.period_ns / NS_PER_US:
        return None
    return failure(
        Topic.CAMERAS,
        "check_exposes_on",
        "{camera}: it exposes for {exposure:.1f} ms, pulses come every {period:.1f} ms",
        "shorten exposure_us, or lower trigger.rate_hz",
        camera=camera.name,
        exposure=camera.exposure_us / 1000,
        period=rig.trigger.period_ns / 1e6,
    )
