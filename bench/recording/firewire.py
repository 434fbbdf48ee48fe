"""What recording from three FireWire cameras costs at the paper's rate, beside three GigE Vision cameras.

Both are simulated and show the same hill; what the simulation costs is told apart.
"""

import time
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import Any, Final

from bench.recording.processes import cpu_seconds
from recorder.publishing.subscriber import free_address
from rig.clocks import host_now
from rig.settings.file import CONFIG, load_rig
from rig.settings.model import RigSettings
from service.headless import HeadlessRig
from service.processes.simulation import simulated_hill
from service.recordings.storage import new_log_path

_RIGS: Final = {"FireWire": "sim-firewire.toml", "GigE Vision": "sim-gige.toml"}


def run_firewire(seconds: float, directory: Path) -> list[dict[str, Any]]:
    """Record 640 x 480 at 30 Hz from three cameras of each kind in turn; the logs are removed afterwards.

    Returns:
        Cases with name, value, unit, baseline and what the baseline is.
    """
    firewire, gige = (_record(load_rig(CONFIG / "rigs" / file), seconds, directory) for file in _RIGS.values())
    return [
        {"name": name, "value": firewire[name], "unit": unit, "baseline_is": "GigE Vision", "baseline": gige[name]}
        for name, unit in (
            ("complete triplets", "%"),
            ("grabber, of a core, per camera", "%"),
            ("recorder, of a core", "%"),
            ("simulation, of a core, per camera", "%"),
        )
    ]


def _record(rig: RigSettings, seconds: float, directory: Path) -> dict[str, float]:
    """One recording: what was complete, and shares of a core, all in %."""
    directory.mkdir(parents=True, exist_ok=True)
    rig = rig.model_copy(update={"network": rig.network.model_copy(update={"publish": free_address()})})
    path = new_log_path(directory)
    pulses = round(seconds * rig.trigger.rate_hz)
    with ExitStack() as stack:
        hill = stack.enter_context(simulated_hill(rig, host_now()))
        assert hill is not None  # noqa: S101  (for the type checker: these rigs have simulated cameras)
        running = stack.enter_context(HeadlessRig(rig, "", _ignore, lambda _: nullcontext(hill.environment)))
        running.wait_until_warm()
        cameras = [camera.name for camera in rig.cameras]
        # Processes, and how many cameras share their time: the FireWire cameras are one process.
        groups = {
            "grabber, of a core, per camera": ([running.pids[name] for name in cameras], len(cameras)),
            "recorder, of a core": ([running.pids["recorder"]], 1),
            "simulation, of a core, per camera": (sorted(set(hill.pids.values())), len(cameras)),
        }
        before, began = {name: cpu_seconds(pids) for name, (pids, _) in groups.items()}, time.monotonic()
        try:
            running.start_recording(path, session={}, pulses=pulses, seconds=seconds)
            report = running.wait_until_finished(_ignore, lambda: False)
        finally:
            path.unlink(missing_ok=True)
        elapsed = time.monotonic() - began
        shares = {
            name: 100 * (cpu_seconds(pids) - before[name]) / elapsed / count for name, (pids, count) in groups.items()
        }
    return shares | {"complete triplets": 100 * report.counts.complete / pulses}


def _ignore(_: object) -> None:
    """Nobody is told."""
