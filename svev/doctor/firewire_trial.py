"""Tries one FireWire camera: sets it up as for a recording, takes frames for two seconds, resets the bus.

On the first day with real cameras this answers what the emulated bus cannot show; docs/firewire.md has the list.
"""

from collections.abc import Iterator
from contextlib import closing
from typing import Final

from capture.iidc.bus import Bus
from capture.iidc.camera import IidcCamera
from capture.iidc.configuration import READOUT_NS
from capture.iidc.device import Device
from capture.seam import Arrival
from rig.clocks import NS_PER_S, NS_PER_US, host_now
from rig.errors import BadInputError, CameraError
from rig.settings.model import CameraSettings
from rig.transport.ring import CameraRing
from svev.doctor.finding import Finding, Topic, failure, passed, warning
from svev.doctor.firewire_cameras import told

_TRIAL_NS: Final = 2 * NS_PER_S
_AFTER_RESET_NS: Final = NS_PER_S
_SLOTS: Final = 8
_RATE_SHARE: Final = 0.02
_DELAY_NS: Final = 1_000_000
#: A busy computer takes frames late: the trial is repeated before a delay is called wrong.
_DELAY_TRIALS: Final = 3
_MANUAL: Final = "see docs/firewire.md, the first day with real cameras"


def try_camera(settings: CameraSettings, rate_hz: float) -> Iterator[Finding]:
    """Try one camera; afterwards it is set up as for a recording, and switched off."""
    name = settings.name
    with closing(CameraRing.create(name, settings.frame_bytes, _SLOTS)) as ring:
        try:
            with closing(IidcCamera(settings, ring, rate_hz)) as camera:
                yield passed(Topic.CAMERAS, f"{name} is set up: {camera.description}")
                camera.start()
                arrivals = _collect(camera, ring, _TRIAL_NS)
                if not any(arrival.whole for arrival in arrivals):
                    yield _nothing_came(name, len(arrivals))
                    return
                yield from _judge(settings, camera, arrivals, rate_hz)
                if camera.byte_order is not None:
                    yield _judge_delay(settings, camera, ring, [arrival for arrival in arrivals if arrival.whole])
                yield _try_bus_reset(settings, camera, ring)
        except (CameraError, BadInputError) as error:
            yield told(str(error))


def _collect(camera: IidcCamera, ring: CameraRing, duration_ns: int) -> list[Arrival]:
    arrivals = []
    deadline = host_now() + duration_ns
    while (now := host_now()) < deadline:
        if (arrival := camera.receive((deadline - now) / NS_PER_S)) is not None:
            arrivals.append(arrival)
            if arrival.whole:
                ring.return_slot(arrival.slot)
    return arrivals


def _nothing_came(name: str, damaged: int) -> Finding:
    if damaged:
        what = f"{name}: {damaged} frames came, none with a signature that makes sense"
        return failure(
            Topic.CAMERAS, what, "check cable and connectors; if it stays, report it with the camera's firmware"
        )
    what = f"{name} is set up, but no frame came in {_TRIAL_NS / NS_PER_S:g} s"
    remedy = "switch the pulse generator on; if it is, check its cable, trigger_input and trigger_edge, then try again"
    return warning(Topic.CAMERAS, what, remedy)


def _judge(settings: CameraSettings, camera: IidcCamera, arrivals: list[Arrival], rate_hz: float) -> Iterator[Finding]:
    name = settings.name
    whole = [arrival for arrival in arrivals if arrival.whole]
    first, last = whole[0], whole[-1]
    taken = last.frame_id - first.frame_id
    span_s = (last.device_time - first.device_time) / NS_PER_S
    triggers = last.trigger_count - first.trigger_count
    yield _judge_rate(name, (triggers or taken) / span_s if span_s else 0.0, rate_hz)
    lost, damaged = taken + 1 - len(whole), len(arrivals) - len(whole)
    if lost or damaged:
        what = f"{name}: of {taken + 1} frames {damaged} came damaged and {max(0, lost - damaged)} not at all"
        yield warning(Topic.CAMERAS, what, "check cable and connectors; end programs that keep the computer busy")
    else:
        yield passed(Topic.CAMERAS, f"{name}: {len(whole)} frames, none lost or damaged")
    if camera.byte_order is None:
        return
    yield passed(Topic.CAMERAS, f"{name} signs its frames, {camera.byte_order.name.lower()} end of each word first")
    yield _judge_triggers(name, triggers, taken)


def _judge_rate(name: str, rate_hz: float, wanted_hz: float) -> Finding:
    what = f"{name} is triggered {rate_hz:.3f} times a second"
    if abs(rate_hz - wanted_hz) <= _RATE_SHARE * wanted_hz:
        return passed(Topic.CAMERAS, what)
    remedy = "correct trigger.rate_hz in the rig file, or the pulse generator"
    return warning(Topic.CAMERAS, f"{what}, the rig file says {wanted_hz:g}", remedy)


def _judge_triggers(name: str, triggers: int, frames: int) -> Finding:
    if triggers == 0:
        what = f"{name}: its trigger counter stands still, so pulses that it was too busy for count as not seen"
        return warning(Topic.CAMERAS, what, _MANUAL)
    if triggers > frames:
        what = f"{name}: {triggers - frames} of {triggers} pulses came while it was busy (overrun)"
        return warning(Topic.CAMERAS, what, "shorten exposure_us, make the region smaller, or lower trigger.rate_hz")
    return passed(Topic.CAMERAS, f"{name}: trigger and frame counter run together")


def _judge_delay(settings: CameraSettings, camera: IidcCamera, ring: CameraRing, whole: list[Arrival]) -> Finding:
    """Is the time in the signature the beginning of the exposure, as it should be?"""
    expected_ns = round(settings.exposure_us * NS_PER_US) + READOUT_NS
    for trial in range(_DELAY_TRIALS):
        if trial:
            whole = [arrival for arrival in _collect(camera, ring, _TRIAL_NS) if arrival.whole] or whole
        latch = camera.latch()
        latency_ns = min(arrival.host_time - latch.host - (arrival.device_time - latch.device) for arrival in whole)
        measured_ns = latency_ns - camera.transport_ns
        what = (
            f"{settings.name}: first packet {measured_ns / 1e6:.2f} ms after the signed time, "
            f"{expected_ns / 1e6:.2f} ms expected from the exposure"
        )
        if settings.iidc.trigger_mode == 1 or abs(measured_ns - expected_ns) < _DELAY_NS:
            return passed(Topic.CAMERAS, what)
    return warning(Topic.CAMERAS, what, _MANUAL)


def _try_bus_reset(settings: CameraSettings, camera: IidcCamera, ring: CameraRing) -> Finding:
    with Bus() as bus, Device(bus, bus.find(int(settings.address, 16))) as beside:
        beside.call("reset_bus")
    try:
        arrivals = _collect(camera, ring, _AFTER_RESET_NS)
    except CameraError as error:
        what = f"{settings.name} does not go on after a bus reset ({error})"
        return warning(Topic.CAMERAS, what, "recordings connect it again by themselves; do not touch cables meanwhile")
    if any(arrival.whole for arrival in arrivals):
        return passed(Topic.CAMERAS, f"{settings.name} goes on after a bus reset")
    what = f"{settings.name}: no frame came after a bus reset"
    return warning(Topic.CAMERAS, what, "recordings connect it again by themselves; do not touch cables meanwhile")
