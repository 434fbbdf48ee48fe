"""Measures how long a service takes to find among 20 000 recordings and their jumps, as a page asks for them."""

import json
import os
import shutil
import time
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from statistics import median
from typing import Any, Final

from bench.service.catalogue import write_jump
from bench.service.listing import some_jump
from bench.service.serving import ServedRig, served_rig
from recorder.catalogue.folder import Catalogue
from recorder.log.beside import measured_path
from recorder.log.session_changes import session_path
from rig.api.recordings import RecordingQuery
from rig.errors import BadInputError
from service.measuring.outcome import Outcome, outcome_path
from service.recordings.measured_jumps import LogJudge

_LOGS: Final = 20_000
_PULSES: Final = 30
_SHAPE: Final = (24, 96)
_ATHLETES: Final = ("Anna Berg", "Bjørn Lie", "Kari Moe", "Ola Nordmann")
_REPEATS: Final = 20
_PAGE: Final = "/api/recordings?limit=50"
_QUERIES: Final = {
    "newest": _PAGE,
    "words": f"{_PAGE}&search=berg%2017",
    "words that nobody wrote": f"{_PAGE}&search=nowhere",
    "bib": f"{_PAGE}&search=bib:17",
    "date": f"{_PAGE}&search=date:2026-11",
    "note": f"{_PAGE}&search=note:%22jump%201234%22",
    "verdict": f"{_PAGE}&search=verdict:good",
    "alpha > 30": f"{_PAGE}&search=alpha%20%3E%2030",
    "alpha > 30 of an athlete": f"{_PAGE}&search=alpha%20%3E%2030%20berg",
    "by bib, last page": f"{_PAGE}&sort=bib&offset=19950",
    "jumps of an athlete with alpha > 30": "/api/jumps?athlete=anna%20berg&search=alpha%20%3E%2030&limit=50",
}


def run_finding(directory: Path) -> list[dict[str, Any]]:
    """Find among 20 000 logs, all one file under as many names, each with its own session and measured jump.

    Returns:
        A case for each query: the median time by clock, beside the longest. Then a list after a log has come, by hand,
        and the first one of a service that has just been started, beside that of one that must read all logs.

    Raises:
        ProcessDiedError: the service fails.
    """
    folder = directory / "finding"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _write_logs(folder)
        reading = _read_all(folder)
        with served_rig(folder) as service:
            started = _ask(service, _PAGE)
            cases = [_case(service, name, path) for name, path in _QUERIES.items()]
            cases.append(_after_changes(service, folder))
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    restart = {"name": "newest, just started", "unit": "ms", "value": round(started, 1)}
    return [*cases, restart | {"baseline_is": "reading all logs", "baseline": round(reading, 1)}]


def _write_logs(folder: Path) -> None:
    first = folder / "first"
    write_jump(first, _PULSES, _SHAPE)
    for number in range(_LOGS):
        log = folder / f"jump-{number:05}.mcap"
        os.link(first, log)
        fields = {"athlete": _ATHLETES[number % 4], "bib": str(number % 60), "notes": f"jump {number}"}
        session_path(log).write_text(json.dumps(fields), encoding="utf-8")
        measured_path(log).mkdir()  # without the care that makes a result last, which takes an hour for so many
        outcome = Outcome(measured=datetime.now(UTC), version="bench", jumps=(some_jump(log, number),))
        outcome_path(log).write_text(outcome.model_dump_json(), encoding="utf-8")


def _read_all(folder: Path) -> float:
    """How long it takes to read all logs into the catalogue, ms; longer than a client waits."""
    began = time.perf_counter()
    with closing(Catalogue(folder, LogJudge())) as catalogue:
        catalogue.find(RecordingQuery(limit=1))
    return (time.perf_counter() - began) * 1e3


def _case(service: ServedRig, name: str, path: str) -> dict[str, Any]:
    times = [_ask(service, path) for _ in range(_REPEATS)]
    return {
        "name": f"{name}, of {_LOGS}", "unit": "ms", "value": round(median(times), 1),
        "baseline_is": "the longest", "baseline": round(max(times), 1),
    }  # fmt: skip


def _after_changes(service: ServedRig, folder: Path) -> dict[str, Any]:
    """The list after a log was put into the folder by hand, each time another one."""
    times = []
    for number in range(_REPEATS):
        os.link(folder / "first", folder / f"by-hand-{number}.mcap")
        times.append(_ask(service, _PAGE))
    if (total := service.call("GET", _PAGE).headers["x-total-count"]) != str(_LOGS + _REPEATS):
        raise BadInputError(f"{total} recordings are listed: name an --out without a folder finding")
    return {
        "name": f"newest, after one has come, of {_LOGS}", "unit": "ms", "value": round(median(times), 1),
        "baseline_is": "the longest", "baseline": round(max(times), 1),
    }  # fmt: skip


def _ask(service: ServedRig, path: str) -> float:
    """Time of an answer by clock, ms."""
    began = time.perf_counter()
    service.call("GET", path)
    return (time.perf_counter() - began) * 1e3
