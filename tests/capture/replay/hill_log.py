"""A log of one camera of the simulated hill, and faults that are written into it while it is replayed."""

from pathlib import Path
from typing import Any

from msgspec.structs import replace

from capture.replay.timeline import Timeline
from recorder.log.triplet_buffers import TripletBuffers
from rig.clocks import HostNs, UtcNs, host_now
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.settings.model import RigSettings
from rig.tag import CameraTag, TripletTag
from simrig.programs.scene import SimScene
from tests.recorder.logs import START, acquire, open_writer

_READY_NS = 5_000_000
_BECOMES = {
    "missed_pulse": FrameStatus.MISSED,
    "lost_frame": FrameStatus.LOST,
    "damaged_frame": FrameStatus.DAMAGED,
    "lost_leader": FrameStatus.DAMAGED,
    "lost_packets": FrameStatus.DAMAGED,
    "restart": FrameStatus.ABSENT,
}


def write_hill_log(path: Path, rig: RigSettings, pulses: int) -> None:
    """Record the first camera of a simulated rig from hill pulse 0 on."""
    (camera, *_) = rig.cameras
    shape = (camera.region.height, camera.region.width)
    scene, buffers = SimScene(rig, 0, HostNs(0)), TripletBuffers(shape, 8)
    with open_writer(path, buffers) as log:
        scene.start(HostNs(-1))
        for number in range(1, pulses + 1):
            fired = scene.next_pulse(HostNs(2**62))
            assert fired is not None
            pulse, host = fired
            time = UtcNs(START + host)
            ready = UtcNs(time + _READY_NS)
            tag = CameraTag(
                camera.name, (0, shape[1]), FrameStatus.OK, number, number, scene.device_time(host, pulse), ready, 0.0
            )
            slot = acquire(buffers)
            scene.render_into(buffers.pixels(slot), pulse)
            log.write_pulse(TripletTag(PulseNumber(number), time, "s", "r", shape, (tag,)), slot, ready)
    buffers.close()


def write_fault(timeline: Timeline, kind: str, fields: dict[str, Any]) -> None:
    """Let the log say that a fault befell the next pulse: later frames have the ids that they had then."""
    tags = timeline.source.tags
    assert isinstance(tags, list)
    first = timeline.next_pulse(host_now())
    count = round(fields.get("duration_s", 0) * 1e9 / timeline.source.period_ns) + 1
    for place in range(first, first + count):
        tags[place] = CameraTag(tags[place].name, tags[place].columns, _BECOMES[kind])
    if kind == "missed_pulse":
        for place in range(first + count, len(tags)):
            tag = tags[place]
            tags[place] = replace(tag, frame_id=tag.frame_id - 1, trigger_count=tag.trigger_count - 1)
