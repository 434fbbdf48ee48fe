"""Measures how long a service takes to list 2000 recordings and their jumps, and for what pages of jumps ask it."""

import os
import shutil
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path
from statistics import median
from typing import Any, Final

from bench.service.catalogue import write_jump
from bench.service.rendering import rendered
from bench.service.serving import ServedRig, served_rig
from recorder.reading.corrected_log import corrected_log
from rig.api.jump import LastJump, MeasuredValue
from rig.errors import BadInputError
from service.measuring.keeping import keep_result

_LOGS: Final = 2000
_PULSES: Final = 30
_SHAPE: Final = (24, 96)
_ATHLETES: Final = ("Anna Berg", "Bjørn Lie", "Kari Moe", "Ola Nordmann")
_REPEATS: Final = 20
_FIRST_DAY: Final = datetime(2026, 1, 10, 10, tzinfo=UTC)
_A_DAY: Final = 50  # jumps
_ALL: Final = ("/api/recordings", "/api/jumps")
_QUERIES: Final = {
    "first page of 50": "/api/recordings?limit=50",
    "search, first page": "/api/recordings?limit=50&search=berg%2017",
    "by bib, last page": "/api/recordings?limit=50&sort=bib&offset=1950",
    "all": _ALL[0],
    "athletes": "/api/athletes",
    "jumps of an athlete": "/api/jumps?athlete=anna%20berg",
    "jumps of a day": "/api/jumps?since=2026-02-01T00:00:00Z&until=2026-02-02T00:00:00Z",
    "all jumps": _ALL[1],
}
_LAST: Final = "/api/recordings/jump-1999"
#: What a page asks for when it is opened, one after the other.
_PAGES: Final = {
    "athlete's page": ("/api/status", "/api/jumps?athlete=anna%20berg"),
    "table of a day": ("/api/status", "/api/jumps?limit=1", _QUERIES["jumps of a day"]),
    "jump's page": (
        "/api/status", _LAST, f"{_LAST}/pulses", f"{_LAST}/moment?jump=1", f"{_LAST}/measurement?jumps=false",
        f"{_LAST}/notes", f"{_LAST}/voice-notes", f"{_LAST}/links",
    ),
    "coach's screen": (
        "/api/status", "/api/recordings?limit=2", f"{_LAST}/measurement?jumps=false", f"{_LAST}/pulses",
        f"{_LAST}/moment", "/api/rig",
    ),
}  # fmt: skip


def run_listing(directory: Path) -> list[dict[str, Any]]:
    """List 2000 logs of their own, each with its athlete, bib and a measured jump.

    Returns:
        A case for each query, and for all that a page asks for: the median time by clock once the service was asked the
        same before, beside that of the first answer of a service that has just been started; and the processor's time
        of both. Then a case for each page that a browser draws, where the computer has one.

    Raises:
        ProcessDiedError: the service fails.
    """
    folder = directory / "listing"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write_logs(folder)
        with served_rig(folder) as service:  # reads all logs, and keeps what it read
            [_ask(service, (path,)) for path in _ALL]
            drawn = rendered(service, _LOGS)
        return [
            *(_measure(folder, name, (path,)) for name, path in _QUERIES.items()),
            *(_measure(folder, name, paths) for name, paths in _PAGES.items()),
            *drawn,
        ]
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _write_logs(folder: Path) -> None:
    first = folder / "first"
    write_jump(first, _PULSES, _SHAPE)
    for number in range(_LOGS):
        fields = {"athlete": _ATHLETES[number % len(_ATHLETES)], "bib": str(number % 60)}
        with corrected_log(first, fields).open() as log:
            path = folder / f"jump-{number:04}.mcap"
            path.write_bytes(log.read())
        _keep_jump(path, number)


def _keep_jump(log: Path, number: int) -> None:
    """Keep main figures beside a log, of a jump on its day."""
    made = log.parent / "made"
    made.mkdir()
    keep_result(made, log, (some_jump(log, number),))


def some_jump(log: Path, number: int) -> LastJump:
    """Main figures of a jump on its day."""
    days, minutes = divmod(number, _A_DAY)
    figures = {
        name: MeasuredValue(value=25 + number % 7, sigma=0.05)
        for name in ("takeoff_speed", "perpendicular", "speed_20_m", "angle_of_attack", "ski_to_body")
    }
    return LastJump(
        recording=log.stem, jump=1, time=_FIRST_DAY + timedelta(days=days, minutes=minutes), ok=True,
        verdict="measured well: all points in 35 of 35 pulses", **figures,
    )  # fmt: skip


def _measure(folder: Path, name: str, paths: tuple[str, ...]) -> dict[str, Any]:
    with served_rig(folder) as service:
        first = _ask(service, paths)
        again = [_ask(service, paths) for _ in range(_REPEATS)]
    return {
        "name": f"{name}, of {_LOGS}", "unit": "ms", "value": round(median(wall for wall, _ in again), 1),
        "cpu_ms": round(sum(cpu for _, cpu in again) / _REPEATS, 1),
        "baseline_is": "just started", "baseline": round(first[0], 1), "baseline_cpu_ms": round(first[1], 1),
    }  # fmt: skip


def _ask(service: ServedRig, paths: tuple[str, ...]) -> tuple[float, float]:
    """Times of the answers together, by clock and by the service's processor, ms."""
    cpu, began = _cpu_ms(service.pid), time.perf_counter()
    answers = [service.call("GET", path) for path in paths]
    taken = (time.perf_counter() - began) * 1e3, _cpu_ms(service.pid) - cpu
    if paths[0] in _ALL and len(answers[0].json()) != _LOGS:
        raise BadInputError(f"not all {_LOGS} recordings are listed: name an --out without a folder listing")
    return taken


def _cpu_ms(pid: int) -> float:
    """Time that a process has computed so far, in steps of 10 ms (proc(5))."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) * 1e3 / os.sysconf("SC_CLK_TCK")
