"""What has been measured, as metrics."""

from collections.abc import Iterator
from typing import Any

from rig.control import Message
from webpanel.models import State, Status
from webpanel.rig_service import Metric, Quantity


def measurements(status: Status, health: Message) -> list[Metric]:
    """All families.

    Args:
        status: the present picture.
        health: the recorder's last report of that name, empty if there is none.
    """
    return [*_of_service(status), *_of_cameras(status, health), *_of_recorder(status, health)]


def _of_service(status: Status) -> Iterator[Metric]:
    states = {state.value: float(state is status.state) for state in State}
    yield Metric("svev_state", "1 for the present state.", Quantity.GAUGE, "state", states)
    restarts = {process.name: float(process.restarts) for process in status.processes}
    yield Metric("svev_process_restarts", "Deaths of a process.", Quantity.COUNTER, "process", restarts)
    yield _gauge("svev_disk_free_bytes", "Free on the disk for recordings.", status.disk.free_gb * 1e9)
    yield _gauge("svev_disk_seconds_left", "Seconds that can still be recorded.", status.disk.seconds_left)
    yield _gauge("svev_preroll_seconds", "Seconds of triplets held in memory.", status.preroll.seconds)
    if status.pulses.rate_hz is not None:
        yield _gauge("svev_pulse_rate_hertz", "Trigger pulses per second.", status.pulses.rate_hz)
    if status.pulses.spread_us is not None:
        spread = status.pulses.spread_us / 1e6
        yield _gauge("svev_pulse_spread_seconds", "Median spread of the triggers within a pulse.", spread)


def _of_cameras(status: Status, health: Message) -> Iterator[Metric]:
    present = {camera.name: float(camera.state in {"ready", "silent"}) for camera in status.cameras}
    yield _by_camera("svev_camera_present", "1 if the camera is connected.", Quantity.GAUGE, present)
    reports: list[dict[str, Any]] = health.get("cameras", [])
    for name, key, text in (
        ("svev_frames", "frames", "Whole frames from the camera."),
        ("svev_damaged_frames", "damaged", "Damaged frames from the camera."),
        ("svev_resent_packets", "resent_packets", "Packets that the camera had to send again."),
        ("svev_missing_packets", "missing_packets", "Packets that never came."),
        ("svev_reconnects", "reconnects", "How often the camera was connected again."),
        ("svev_queue_overflows", "queue_overflows", "Records that found the camera's queue full."),
    ):
        yield _by_camera(name, text, Quantity.COUNTER, {r["name"]: float(r[key]) for r in reports})
    queued = {r["name"]: float(r["slots_queued"]) for r in reports}
    yield _by_camera("svev_ring_frames_queued", "Frames that wait in the camera's ring.", Quantity.GAUGE, queued)
    warmth = {c.name: c.temperature_c for c in status.cameras if c.temperature_c is not None}
    yield _by_camera("svev_camera_temperature_celsius", "Inside the camera.", Quantity.GAUGE, warmth)
    offsets = {c.name: c.clock_offset_us / 1e6 for c in status.cameras if c.clock_offset_us is not None}
    yield _by_camera("svev_clock_offset_seconds", "Trigger time minus the pulse's.", Quantity.GAUGE, offsets)


def _of_recorder(status: Status, health: Message) -> Iterator[Metric]:
    if "free_triplets" in health:
        yield _gauge("svev_triplet_buffers_free", "Free buffers for triplets.", health["free_triplets"])
    if "unpublished" in health:
        dropped = {"": float(health["unpublished"])}
        yield Metric("svev_unpublished", "Triplets dropped before a slow subscriber.", Quantity.COUNTER, "", dropped)
    yield Metric("svev_pulses", "Pulses since arming.", Quantity.COUNTER, "", {"": float(status.pulses.number)})
    if "latency" in health:
        latency = health["latency"]
        text = "From the last frame in memory to the publication."
        buckets = {bound: float(count) for bound, count in latency["buckets_s"].items()}
        yield Metric("svev_latency_seconds", text, Quantity.HISTOGRAM, "", buckets, float(latency["sum_s"]))
    if status.recording is not None:
        counts = status.recording.counts
        triplets = {"complete": float(counts.complete), "partial": float(counts.partial)}
        yield Metric("svev_recording_triplets", "Of the recording in progress.", Quantity.GAUGE, "state", triplets)


def _gauge(name: str, text: str, value: float) -> Metric:
    return Metric(name, text, Quantity.GAUGE, "", {"": float(value)})


def _by_camera(name: str, text: str, quantity: Quantity, values: dict[str, float]) -> Metric:
    return Metric(name, text, quantity, "camera", values)
