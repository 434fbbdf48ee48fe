"""More cameras, and faster ones, than the paper's three at 30 Hz: whether all frames come, and what that costs.

Simulated GigE Vision cameras send over loopback what they drew beforehand. Their work is told apart.
"""

import tempfile
import time
from contextlib import nullcontext
from pathlib import Path
from typing import Any, Final

from bench.recording.loads import PRERENDERED, SCENARIO, Load
from bench.recording.processes import cpu_seconds
from recorder.publishing.subscriber import free_address
from rig.clocks import host_now
from service.headless import HeadlessRig
from service.processes.simulation import simulated_hill
from service.recordings.storage import new_log_path

#: A camera beside the table; each of more than the scenario's three stands a metre farther down.
_CAMERA: Final = """
[[cameras]]
name = "K{number}"
c = 1400.0
X0 = [{x:.1f}, -33.0, -9.0]
look_at = [11.0, 0.0, -2.7]
gain = 1.0
offset_s = {offset:.1f}
drift_ppm = {drift:.1f}
exposure_jitter_us = 1.0
"""


def run_many(load: Load, seconds: float, directory: Path) -> dict[str, Any]:
    """Record once under a load; the log is removed afterwards.

    Returns:
        Frames expected, complete and lost; seconds of processor time by process; bytes per second to the disk.
    """
    directory.mkdir(parents=True, exist_ok=True)
    pulses = round(seconds * load.rate_hz)
    with tempfile.TemporaryDirectory() as folder:
        scenario = SCENARIO if load.cameras == 3 else scenario_of(Path(folder), load.cameras)
        rig = load.rig(directory, free_address(), scenario)
        path = new_log_path(directory)
        hill = simulated_hill(rig, host_now(), prerendered=PRERENDERED, link_mbit_s=load.link_mbit_s)
        try:
            with hill as cameras, HeadlessRig(rig, "", _ignore, lambda _: nullcontext({})) as running:
                assert cameras is not None  # noqa: S101  (for the type checker: these rigs have simulated cameras)
                running.wait_until_warm()
                pids = dict(running.pids)
                simulated = sorted(set(cameras.pids.values()))
                before, simulated_before = _each(pids), cpu_seconds(simulated)
                began = time.monotonic()
                running.start_recording(path, session={}, pulses=pulses, seconds=seconds)
                report = running.wait_until_finished(_ignore, lambda: False)
                elapsed = time.monotonic() - began
                cpu = {name: round(spent - before[name], 2) for name, spent in _each(pids).items()}
                simulation = round(cpu_seconds(simulated) - simulated_before, 2)
                written = path.stat().st_size
        finally:
            path.unlink(missing_ok=True)
    expected, causes = pulses * load.cameras, report.counts.causes.model_dump()
    complete = report.counts.pulses * load.cameras - sum(causes.values())
    return {
        "load": load.name,
        "cameras": f"{load.cameras} x {load.width} x {load.height} at {load.rate_hz:g} Hz, GigE Vision over loopback",
        "seconds": seconds,
        "frames": {"expected": expected, "complete": complete, "lost": expected - complete},
        "pulses": {"expected": pulses, "complete": report.counts.complete},
        "causes": causes,
        "cpu_s": cpu,
        "simulation_cpu_s": simulation,
        "disk_MB_per_s": round(written / 1e6 / elapsed, 1),
    }


def many_table(result: dict[str, Any]) -> list[str]:
    """The result for people."""
    frames = result["frames"]
    spent = ", ".join(f"{name} {seconds:.2f}" for name, seconds in result["cpu_s"].items())
    came = f"{frames['complete']} of {frames['expected']}, {frames['lost']} lost"
    return [
        f"{result['cameras']} for {result['seconds']:g} s",
        f"frames: {came}; to the disk {result['disk_MB_per_s']} MB/s",
        f"CPU-s: {spent}; simulated cameras {result['simulation_cpu_s']:.2f}",
    ]


def scenario_of(folder: Path, count: int) -> Path:
    """The training hill with so many cameras."""
    tables = [
        _CAMERA.format(number=number, x=38.0 + number, offset=100.0 * number, drift=7.0 * (number - count / 2))
        for number in range(1, count + 1)
    ]
    path = folder / "scenario.toml"
    path.write_text(f'base = "{SCENARIO}"\nname = "{count} cameras"\n{"".join(tables)}')
    return path


def _each(pids: dict[str, int]) -> dict[str, float]:
    return {name: cpu_seconds([pid]) for name, pid in pids.items()}


def _ignore(_: object) -> None:
    """Nobody is told."""
