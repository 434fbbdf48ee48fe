"""Measures how long the REST API takes to answer: idle, and while recording at 30 Hz with a viewer of the preview."""

import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from statistics import quantiles
from typing import Any, Final

from bench.service.serving import ServedRig, served_rig

_PACE_S: Final = 0.02
_ENDPOINTS: Final = ("/api/status", "/api/recordings", "/metrics", "/healthz", "/api/rig")
_PREVIEW: Final = "/api/preview.jpg"


def run_api(seconds: float, directory: Path) -> list[dict[str, Any]]:
    """Measure every endpoint: the 99th percentile while recording, beside the same while idle.

    Returns:
        One case for each endpoint.

    Raises:
        ProcessDiedError: the service fails.
    """
    folder = directory / "api"
    try:
        with served_rig(folder) as service:
            idle = _measure(service, _ENDPOINTS, seconds / 2)
            service.call("POST", "/api/arm")
            service.await_state("armed")
            recording = service.json("POST", "/api/recordings", {"preroll_s": 0})["id"]
            busy = _measure(service, (*_ENDPOINTS, _PREVIEW), seconds)
            changed = _timed(lambda: service.call("PATCH", f"/api/recordings/{recording}", {"bib": "17"}), 50)
            counts = service.json("POST", f"/api/recordings/{recording}/stop")["counts"]
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    cases = [_case(f"GET {path}", busy[path], idle.get(path)) for path in busy]
    cases.append(_case("PATCH /api/recordings/ID", changed, None))
    return [case | {"pulses": counts["pulses"], "complete": counts["complete"]} for case in cases]


def _measure(service: ServedRig, paths: tuple[str, ...], seconds: float) -> dict[str, list[float]]:
    """Durations by path, s. The paths are called in turn, some dozen calls a second, as a few open pages do."""
    taken: dict[str, list[float]] = {path: [] for path in paths}
    deadline, pause = time.monotonic() + seconds, threading.Event()
    while time.monotonic() < deadline:
        for path in paths:
            began = time.perf_counter()
            service.call("GET", path)
            taken[path].append(time.perf_counter() - began)
            pause.wait(_PACE_S)
    return taken


def _timed(call: Callable[[], object], times: int) -> list[float]:
    taken = []
    for _ in range(times):
        began = time.perf_counter()
        call()
        taken.append(time.perf_counter() - began)
    return taken


def _case(name: str, taken: list[float], idle: list[float] | None) -> dict[str, Any]:
    case = {"name": f"{name}, recording, 99 %", "unit": "ms", "value": _percentile(taken, 99), "calls": len(taken)}
    case |= {"median_ms": _percentile(taken, 50), "max_ms": round(max(taken) * 1e3, 2)}
    if idle is None:
        return case | {"baseline_is": "median", "baseline": case["median_ms"]}
    return case | {"baseline_is": "idle, 99 %", "baseline": _percentile(idle, 99), "idle_ms": _percentile(idle, 50)}


def _percentile(taken: list[float], percent: int) -> float:
    return round(quantiles(taken, n=100, method="inclusive")[percent - 1] * 1e3, 2)
