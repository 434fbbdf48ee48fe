"""Receive, pair, compose, checksum, index, publish and write: what it costs beside GStreamer's plain receiving.

The simulated cameras are the same for all, and are not counted.
"""

import time
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import Any, Final

from bench.recording.gstreamer import SINKS, run_gstreamer
from bench.recording.loads import PRERENDERED, Load
from bench.recording.processes import cpu_seconds
from recorder.publishing.subscriber import median_and_p99, subscriber
from recorder.reading.parts import parts_of
from rig.api.recordings import Counts
from rig.clocks import HostNs, UtcAnchor, UtcNs, host_now
from service.headless import HeadlessRig
from service.processes.simulation import simulated_hill
from service.recordings.storage import new_log_path
from simrig.programs.simulated_hill import SimulatedHill

#: A recording that is split, and how many parts it has.
SPLIT: Final = "svev, split, one subscriber"
_PARTS: Final = 4


def run_capture(load: Load, seconds: float, directory: Path, publish: str) -> dict[str, Any]:
    """Svev beside `! fakesink` and `! filesink` under one load.

    Returns:
        Figures of each, and the ratios of CPU-seconds per GB.
    """
    rig = load.rig(directory, publish)
    epoch = host_now()
    with simulated_hill(rig, epoch, prerendered=PRERENDERED, link_mbit_s=load.link_mbit_s) as hill:
        result: dict[str, Any] = {"load": load.name, "MB_per_s": round(load.bytes_per_s / 1e6, 1), "seconds": seconds}
        result["svev"] = _record(load, seconds, directory, publish)
        result["svev, one subscriber"] = _record(load, seconds, directory, publish, hill)
        result[SPLIT] = _record(load, seconds, directory, publish, hill, max(1.0, seconds / _PARTS))
        for sink in SINKS:
            result[sink] = run_gstreamer(load, rig, sink, seconds, directory)
    ours = result["svev"]["cpu_s_per_GB"]
    result["ratios"] = {f"svev / {sink}": round(ours / result[sink]["cpu_s_per_GB"], 3) for sink in SINKS}
    return result


def _record(
    load: Load,
    seconds: float,
    directory: Path,
    publish: str,
    subscribed_hill: SimulatedHill | None = None,
    part_s: float | None = None,
) -> dict[str, Any]:
    """One recording; its logs are removed afterwards. With a hill, a subscriber counts and measures latencies."""
    rig = load.rig(directory, publish).split(part_s, None)
    path = new_log_path(directory)
    pulses = round(seconds * load.rate_hz)
    try:
        with HeadlessRig(rig, "", lambda _: None, lambda _: nullcontext({})) as running, ExitStack() as stack:
            running.wait_until_warm()
            if subscribed_hill is not None:
                count_received = stack.enter_context(subscriber(publish, arrivals=True))
            before, began = cpu_seconds(running.pids.values()), time.monotonic()
            running.start_recording(path, session={}, pulses=pulses, seconds=seconds)
            report = running.wait_until_finished(lambda _: None, lambda: False)
            cpu, elapsed = cpu_seconds(running.pids.values()) - before, time.monotonic() - began
            figures = _figures(load, report.counts, cpu, elapsed)
            if subscribed_hill is not None:
                counted = count_received()
                figures |= {key: getattr(counted, key) for key in ("received", "missing", "latency_ms")}
                figures["latency_from_cable_ms"] = _latency_from_cable(counted.arrivals, subscribed_hill)
            return figures
    finally:
        for part in parts_of(path):
            part.unlink(missing_ok=True)


def _latency_from_cable(arrivals: list[tuple[int, int]], hill: SimulatedHill) -> dict[str, float | None]:
    """From the moment in which the last camera sent its last packet to the message in the subscriber, ms."""
    sent = [camera.last_packets for camera in hill.statistics().values()]
    anchor, train, latencies = UtcAnchor.take(), hill.train, []
    for pulse_utc, arrived_utc in arrivals:
        # The pulse's time is known to microseconds, the next pulse is a period away.
        pulse = train.next_index(HostNs(anchor.host(UtcNs(pulse_utc)) - round(0.5e9 / train.rate_hz)))
        times = [packets[pulse] for packets in sent if pulse in packets]
        if len(times) == len(sent):
            latencies.append((anchor.host(UtcNs(arrived_utc)) - max(times)) / 1e6)
    return median_and_p99(latencies)


def _figures(load: Load, counts: Counts, cpu: float, elapsed: float) -> dict[str, Any]:
    gigabytes = counts.pulses * load.bytes_per_s / load.rate_hz / 1e9
    return {
        "pulses": counts.pulses,
        "complete": counts.complete,
        "causes": counts.causes.model_dump(),
        "GB": round(gigabytes, 3),
        "MB_per_s": round(gigabytes * 1e3 / elapsed, 1),
        "cpu_s": round(cpu, 2),
        "cpu_s_per_GB": round(cpu / gigabytes, 3),
    }
