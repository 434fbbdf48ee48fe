"""Measures how long a service that has just been started takes to list many recordings."""

import os
import shutil
import time
from pathlib import Path
from typing import Any, Final

from bench.service.serving import served_rig
from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import DeviceNs, UtcNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag

_LOGS: Final = 500
_PULSES: Final = 300
_SHAPE: Final = (48, 192)
_CAMERAS: Final = ("K1", "K2", "K3")
_START_NS: Final = 1_795_216_434_399_239_000
_PERIOD_NS: Final = 33_333_333


def run_catalogue(directory: Path) -> list[dict[str, Any]]:
    """List 500 logs of 300 pulses, with small images: what the list reads does not depend on their size.

    All are one file under 500 names, so that it stays in the page cache.

    Returns:
        One case: the first answer of a service that finds the entries which an earlier one kept, beside that of one
        which must read all logs.

    Raises:
        ProcessDiedError: the service fails.
    """
    folder = directory / "catalogue"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_jump(folder / "jump-1.mcap", _PULSES, _SHAPE)
        for number in range(2, _LOGS + 1):
            os.link(folder / "jump-1.mcap", folder / f"jump-{number}.mcap")
        reading = _first_list(folder)
        kept = _first_list(folder)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    name = f"first list of {_LOGS} logs of {_PULSES} pulses"
    return [{"name": name, "unit": "ms", "value": kept, "baseline_is": "reading all logs", "baseline": reading}]


def _first_list(folder: Path) -> float:
    """How long a new service takes for its first list, ms."""
    with served_rig(folder) as service:
        began = time.perf_counter()
        found = service.json("GET", "/api/recordings")
        taken = time.perf_counter() - began
    if len(found) != _LOGS:
        raise BadInputError(f"{len(found)} of {_LOGS} recordings are listed: name an --out without a folder catalogue")
    return round(taken * 1e3, 1)


def write_jump(path: Path, pulses: int, shape: tuple[int, int]) -> None:
    """Write a log of three cameras, all pulses complete, with what happens to be in memory for pixels."""
    buffers = TripletBuffers(shape, 16)
    description = LogDescription({"athlete": "Anna Berg", "bib": "17"}, {"name": "bench"}, b'name = "bench"\n')
    with LogWriter(path, description, buffers) as log:
        for pulse in range(1, pulses + 1):
            tag = _tag(pulse, shape)
            log.write_pulse(tag, buffers.acquire(timeout_s=10.0), UtcNs(tag.time + 5_000_000))
    buffers.close()


def _tag(pulse: int, shape: tuple[int, int]) -> TripletTag:
    time_ns, width = UtcNs(_START_NS + pulse * _PERIOD_NS), shape[1] // len(_CAMERAS)
    device_time = DeviceNs(pulse * _PERIOD_NS)
    cameras = (
        CameraTag(
            name, (place * width, (place + 1) * width), FrameStatus.OK, pulse, pulse, device_time, time_ns, place - 1.0
        )
        for place, name in enumerate(_CAMERAS)
    )
    return TripletTag(PulseNumber(pulse), time_ns, "bench", "jump-1", shape, tuple(cameras))
