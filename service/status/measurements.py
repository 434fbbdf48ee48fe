"""The service's measurements as Prometheus metric families, for `/metrics`."""

from collections.abc import Iterator, Mapping

from prometheus_client.metrics_core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily, Metric

from rig.api.status import CameraState, State, Status
from rig.health import Health


def measurements(status: Status, health: Health | None) -> Iterator[Metric]:
    """All families, in the base units of Prometheus (seconds, bytes).

    Args:
        status: the present status.
        health: the recorder's last health record, None if there is none.
    """
    yield from _of_service(status)
    yield from _of_cameras(status, health)
    yield from _of_recorder(status, health)


def _of_service(status: Status) -> Iterator[Metric]:
    states = {state.value: float(state is status.state) for state in State}
    yield _gauges("svev_state", "1 for the present state.", "state", states)
    restarts = {process.name: process.restarts for process in status.processes}
    yield _counters("svev_process_restarts", "Deaths of a process.", "process", restarts)
    yield GaugeMetricFamily("svev_disk_free_bytes", "Free on the disk for recordings.", status.disk.free_gb * 1e9)
    yield GaugeMetricFamily("svev_disk_seconds_left", "Seconds that can still be recorded.", status.disk.seconds_left)
    yield GaugeMetricFamily("svev_preroll_seconds", "Seconds of triplets held in memory.", status.preroll.seconds)
    if status.pulses.rate_hz is not None:
        yield GaugeMetricFamily("svev_pulse_rate_hertz", "Trigger pulses per second.", status.pulses.rate_hz)
    if status.pulses.spread_us is not None:
        spread_s = status.pulses.spread_us / 1e6
        yield GaugeMetricFamily("svev_pulse_spread_seconds", "Median spread of the triggers within a pulse.", spread_s)


def _of_cameras(status: Status, health: Health | None) -> Iterator[Metric]:
    present = {camera.name: float(camera.state in {CameraState.READY, CameraState.SILENT}) for camera in status.cameras}
    yield _gauges("svev_camera_present", "1 if the camera is connected.", "camera", present)
    reports = () if health is None else health.cameras
    for name, field, text in (
        ("svev_frames", "frames", "Whole frames from the camera."),
        ("svev_damaged_frames", "damaged", "Damaged frames from the camera."),
        ("svev_resent_packets", "resent_packets", "Packets that the camera had to send again."),
        ("svev_missing_packets", "missing_packets", "Packets that never came."),
        ("svev_reconnects", "reconnects", "How often the camera was connected again."),
        ("svev_queue_overflows", "queue_overflows", "Records that found the camera's queue full."),
    ):
        yield _counters(name, text, "camera", {report.name: getattr(report, field) for report in reports})
    queued = {report.name: report.slots_queued for report in reports}
    yield _gauges("svev_ring_frames_queued", "Frames that wait in the camera's ring.", "camera", queued)
    warmth = {c.name: c.temperature_c for c in status.cameras if c.temperature_c is not None}
    yield _gauges("svev_camera_temperature_celsius", "Inside the camera.", "camera", warmth)
    answers = [(camera.name, camera.actions) for camera in status.cameras if camera.actions is not None]
    for name, field, text in (
        ("svev_actions_acknowledged", "acknowledged", "Action commands that the camera took."),
        ("svev_actions_late", "late", "Action commands whose time was past when they came."),
        ("svev_actions_refused", "refused", "Action commands that the camera did not take."),
        ("svev_actions_unanswered", "unanswered", "Action commands that the camera did not answer in time."),
    ):
        if answers:
            yield _counters(name, text, "camera", {camera: getattr(counts, field) for camera, counts in answers})
    offsets = {c.name: c.clock_offset_us / 1e6 for c in status.cameras if c.clock_offset_us is not None}
    yield _gauges("svev_clock_offset_seconds", "Trigger time minus the pulse's.", "camera", offsets)


def _of_recorder(status: Status, health: Health | None) -> Iterator[Metric]:
    if health is not None:
        yield GaugeMetricFamily("svev_triplet_buffers_free", "Free buffers for triplets.", health.free_triplets)
        yield CounterMetricFamily("svev_unpublished", "Triplets dropped before a slow subscriber.", health.unpublished)
    yield CounterMetricFamily("svev_pulses", "Pulses since arming.", status.pulses.number)
    if status.pulses.fired is not None:
        yield CounterMetricFamily("svev_pulses_fired", "Pulses that their source says it made.", status.pulses.fired)
    if (made := status.pulses.made) is not None:
        yield CounterMetricFamily("svev_pulses_left_out", "Pulses that would have come too late.", made.skipped)
    if health is not None:
        yield HistogramMetricFamily(
            "svev_latency_seconds",
            "From the last frame in memory to the publication.",
            sorted(health.latency.buckets_s.items(), key=lambda bucket: float(bucket[0])),
            health.latency.sum_s,
        )
    if status.recording is not None:
        counts = status.recording.counts
        triplets = {"complete": counts.complete, "partial": counts.partial}
        yield _gauges("svev_recording_triplets", "Of the recording in progress.", "state", triplets)


def _gauges(name: str, text: str, label: str, values: Mapping[str, float]) -> Metric:
    return _labelled(GaugeMetricFamily(name, text, labels=(label,)), values)


def _counters(name: str, text: str, label: str, values: Mapping[str, float]) -> Metric:
    return _labelled(CounterMetricFamily(name, text, labels=(label,)), values)


def _labelled(family: GaugeMetricFamily | CounterMetricFamily, values: Mapping[str, float]) -> Metric:
    for label, value in values.items():
        family.add_metric((label,), value)
    return family
