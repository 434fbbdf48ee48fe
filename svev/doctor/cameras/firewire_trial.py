"""Tries one FireWire camera: sets it up as for a recording, takes frames for two seconds, resets the bus.

On the first day with real cameras this answers what the emulated bus cannot show; docs/how-to/firewire.md has the list.
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
from rig.frame import FrameRecord
from rig.phrase import phrase
from rig.settings.camera import CameraSettings
from rig.transport.ring import CameraRing
from svev.doctor.cameras.firewire_cameras import told
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed, warning

_TRIAL_NS: Final = 2 * NS_PER_S
_AFTER_RESET_NS: Final = NS_PER_S
_SLOTS: Final = 8
_RATE_SHARE: Final = 0.02
_DELAY_NS: Final = 1_000_000
#: A busy computer takes frames late: the trial is repeated before a delay is called wrong.
_DELAY_TRIALS: Final = 3
_MANUAL: Final = "see docs/how-to/firewire.md, the first day with real cameras"
_AFTER_RESET: Final = "recordings connect it again by themselves; do not touch cables meanwhile"


def try_camera(settings: CameraSettings, rate_hz: float) -> Iterator[Finding]:
    """Try one camera; afterwards it is set up as for a recording, and switched off."""
    name = settings.name
    with closing(CameraRing.create(name, settings.frame_bytes, _SLOTS)) as ring:
        try:
            with closing(IidcCamera(settings, ring, rate_hz)) as camera:
                what = "{camera} is set up: {description}"
                yield passed(Topic.CAMERAS, "check_trial_set_up", what, camera=name, description=camera.description)
                camera.start()
                arrivals = _collect(camera, ring, _TRIAL_NS)
                whole = _whole(arrivals)
                if not whole:
                    yield _nothing_came(name, len(arrivals))
                    return
                yield from _judge(settings, camera, whole, len(arrivals) - len(whole), rate_hz)
                if camera.byte_order is not None:
                    yield _judge_delay(settings, camera, ring, whole)
                yield _try_bus_reset(settings, camera, ring)
        except (CameraError, BadInputError) as error:
            yield told(str(error))


def _collect(camera: IidcCamera, ring: CameraRing, duration_ns: int) -> list[Arrival]:
    arrivals = []
    deadline = host_now() + duration_ns
    while (now := host_now()) < deadline:
        if (arrival := camera.receive((deadline - now) / NS_PER_S)) is not None:
            arrivals.append(arrival)
            if isinstance(arrival, FrameRecord):
                ring.return_slot(arrival.slot)
    return arrivals


def _whole(arrivals: list[Arrival]) -> list[FrameRecord]:
    return [arrival for arrival in arrivals if isinstance(arrival, FrameRecord)]


def _nothing_came(name: str, damaged: int) -> Finding:
    if damaged:
        what = "{camera}: {count} frames came, none with a signature that makes sense"
        remedy = "check cable and connectors; if it stays, report it with the camera's firmware"
        return failure(Topic.CAMERAS, "check_trial_unsigned", what, remedy, camera=name, count=damaged)
    what = "{camera} is set up, but no frame came in {seconds:g} s"
    remedy = "switch the pulse generator on; if it is, check its cable, trigger_input and trigger_edge, then try again"
    return warning(Topic.CAMERAS, "check_trial_silent", what, remedy, camera=name, seconds=_TRIAL_NS / NS_PER_S)


def _judge(
    settings: CameraSettings, camera: IidcCamera, whole: list[FrameRecord], damaged: int, rate_hz: float
) -> Iterator[Finding]:
    name = settings.name
    first, last = whole[0], whole[-1]
    taken = last.frame_id - first.frame_id
    span_s = (last.device_time - first.device_time) / NS_PER_S
    triggers = last.trigger_count - first.trigger_count
    yield _judge_rate(name, (triggers or taken) / span_s if span_s else 0.0, rate_hz)
    lost = taken + 1 - len(whole)
    if lost or damaged:
        yield warning(
            Topic.CAMERAS,
            "check_trial_lost",
            "{camera}: of {frames} frames {damaged} came damaged and {lost} not at all",
            "check cable and connectors; end programs that keep the computer busy",
            camera=name,
            frames=taken + 1,
            damaged=damaged,
            lost=max(0, lost - damaged),
        )
    else:
        what = "{camera}: {frames} frames, none lost or damaged"
        yield passed(Topic.CAMERAS, "check_trial_whole", what, camera=name, frames=len(whole))
    if camera.byte_order is None:
        return
    what, order = "{camera} signs its frames, {order} end of each word first", camera.byte_order.name.lower()
    yield passed(Topic.CAMERAS, "check_trial_signs", what, camera=name, order=order)
    yield _judge_triggers(name, triggers, taken)


def _judge_rate(name: str, rate_hz: float, wanted_hz: float) -> Finding:
    what, rate = "{camera} is triggered {rate} times a second", f"{rate_hz:.3f}"
    if abs(rate_hz - wanted_hz) <= _RATE_SHARE * wanted_hz:
        return passed(Topic.CAMERAS, "check_trial_rate", what, camera=name, rate=rate)
    what = "{camera} is triggered {rate} times a second, the rig file says {wanted:g}"
    remedy = "correct trigger.rate_hz in the rig file, or the pulse generator"
    return warning(Topic.CAMERAS, "check_trial_rate_wrong", what, remedy, camera=name, rate=rate, wanted=wanted_hz)


def _judge_triggers(name: str, triggers: int, frames: int) -> Finding:
    if triggers == 0:
        what = "{camera}: its trigger counter stands still, so pulses that it was too busy for count as not seen"
        return warning(Topic.CAMERAS, "check_trial_counter", what, _MANUAL, camera=name)
    if triggers > frames:
        what = "{camera}: {missed} of {pulses} pulses came while it was busy (overrun)"
        remedy = "shorten exposure_us, make the region smaller, or lower trigger.rate_hz"
        missed = triggers - frames
        return warning(Topic.CAMERAS, "check_trial_overrun", what, remedy, camera=name, missed=missed, pulses=triggers)
    return passed(
        Topic.CAMERAS, "check_trial_counters", "{camera}: trigger and frame counter run together", camera=name
    )


def _judge_delay(settings: CameraSettings, camera: IidcCamera, ring: CameraRing, whole: list[FrameRecord]) -> Finding:
    """Is the time in the signature the beginning of the exposure, as it should be?"""
    expected_ns = round(settings.exposure_us * NS_PER_US) + READOUT_NS
    for trial in range(_DELAY_TRIALS):
        if trial:
            whole = _whole(_collect(camera, ring, _TRIAL_NS)) or whole
        latch = camera.latch()
        latency_ns = min(arrival.host_time - latch.host - (arrival.device_time - latch.device) for arrival in whole)
        measured_ns = latency_ns - camera.transport_ns
        said = phrase(
            "check_trial_delay",
            "{camera}: first packet {measured} ms after the signed time, {expected} ms expected from the exposure",
            camera=settings.name, measured=f"{measured_ns / 1e6:.2f}", expected=f"{expected_ns / 1e6:.2f}",
        )  # fmt: skip
        if settings.iidc.trigger_mode == 1 or abs(measured_ns - expected_ns) < _DELAY_NS:
            return judged(Level.PASS, Topic.CAMERAS, said, _MANUAL)
    return judged(Level.WARN, Topic.CAMERAS, said, _MANUAL)


def _try_bus_reset(settings: CameraSettings, camera: IidcCamera, ring: CameraRing) -> Finding:
    with Bus() as bus, Device(bus, bus.find(int(settings.address, 16))) as beside:
        beside.call("reset_bus")
    try:
        arrivals = _collect(camera, ring, _AFTER_RESET_NS)
    except CameraError as error:
        what = "{camera} does not go on after a bus reset ({why})"
        return warning(
            Topic.CAMERAS, "check_trial_reset_ends", what, _AFTER_RESET, camera=settings.name, why=str(error)
        )
    if _whole(arrivals):
        return passed(Topic.CAMERAS, "check_trial_reset", "{camera} goes on after a bus reset", camera=settings.name)
    what = "{camera}: no frame came after a bus reset"
    return warning(Topic.CAMERAS, "check_trial_reset_silent", what, _AFTER_RESET, camera=settings.name)
