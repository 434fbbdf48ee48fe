"""Measures how long a service takes to list 2000 recordings by pages, just started and later, by clock and by CPU."""

import os
import shutil
import time
from pathlib import Path
from statistics import median
from typing import Any, Final

from bench.service.catalogue import write_jump
from bench.service.serving import ServedRig, served_rig
from recorder.reading.corrected_log import corrected_log
from rig.errors import BadInputError

_LOGS: Final = 2000
_PULSES: Final = 30
_SHAPE: Final = (24, 96)
_ATHLETES: Final = ("Anna Berg", "Bjørn Lie", "Kari Moe", "Ola Nordmann")
_REPEATS: Final = 20
_QUERIES: Final = {
    "first page of 50": "limit=50",
    "search, first page": "limit=50&search=berg%2017",
    "by bib, last page": "limit=50&sort=bib&offset=1950",
    "all": "",
}


def run_listing(directory: Path) -> list[dict[str, Any]]:
    """List 2000 logs of their own, each with its athlete and bib.

    Returns:
        A case for each query: its median time by clock once the service has listed them before, beside that of the
        first list of a service that has just been started; and the processor's time of both.

    Raises:
        ProcessDiedError: the service fails.
    """
    folder = directory / "listing"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write_logs(folder)
        with served_rig(folder) as service:  # reads all logs, and keeps what it read
            _list(service, "")
        return [_measure(folder, name, query) for name, query in _QUERIES.items()]
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _write_logs(folder: Path) -> None:
    first = folder / "first"
    write_jump(first, _PULSES, _SHAPE)
    for number in range(_LOGS):
        fields = {"athlete": _ATHLETES[number % len(_ATHLETES)], "bib": str(number % 60)}
        with corrected_log(first, fields).open() as log:
            (folder / f"jump-{number:04}.mcap").write_bytes(log.read())


def _measure(folder: Path, name: str, query: str) -> dict[str, Any]:
    with served_rig(folder) as service:
        first = _list(service, query)
        again = [_list(service, query) for _ in range(_REPEATS)]
    return {
        "name": f"{name}, of {_LOGS}", "unit": "ms", "value": round(median(wall for wall, _ in again), 1),
        "cpu_ms": round(sum(cpu for _, cpu in again) / _REPEATS, 1),
        "baseline_is": "just started", "baseline": round(first[0], 1), "baseline_cpu_ms": round(first[1], 1),
    }  # fmt: skip


def _list(service: ServedRig, query: str) -> tuple[float, float]:
    """Times of one answer by clock and by the service's processor, ms."""
    cpu, began = _cpu_ms(service.pid), time.perf_counter()
    answer = service.call("GET", f"/api/recordings?{query}")
    taken = (time.perf_counter() - began) * 1e3, _cpu_ms(service.pid) - cpu
    if not query and len(answer.json()) != _LOGS:
        raise BadInputError(f"not all {_LOGS} recordings are listed: name an --out without a folder listing")
    return taken


def _cpu_ms(pid: int) -> float:
    """Time that a process has computed so far, in steps of 10 ms (proc(5))."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * 1e3 / os.sysconf("SC_CLK_TCK")
