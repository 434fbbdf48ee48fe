"""Soak test: do memory and processor time of the service stay flat, ten minutes idle and ten minutes recording?

Run it on a quiet machine: `python -m bench.service.soak --minutes 10 --out FOLDER`. It writes `soak.json`.
Recordings are removed when they end: the disk needs room for half a minute only.
"""

import argparse
import json
import shutil
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import pairwise
from pathlib import Path
from statistics import linear_regression, mean
from typing import Any, Final

from bench.recording.processes import cpu_seconds
from bench.service.serving import ServedRig, served_rig

_EVERY_S: Final = 5.0
_RECORDING_S: Final = 30.0
_MB: Final = 1024 * 1024
_HOUR_S: Final = 3600.0


@dataclass(frozen=True, slots=True)
class Sample:
    """One measurement of the processes.

    Attributes:
        time_s: since the phase began.
        memory_mb: anonymous memory of each process: heap, stacks, triplet buffers. Pages of libraries are left out,
            because the kernel divides them among all programs that use them at the moment.
        cpu_s: user and system time of all processes since they were started.
    """

    time_s: float
    memory_mb: dict[str, float]
    cpu_s: float


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--out", type=Path, default=Path("bench/results"))
    arguments = parser.parse_args()
    folder = arguments.out / "soak"
    try:
        with served_rig(folder) as service:
            result = {"idle": _phase(service, arguments.minutes * 60, lambda _: None)}
            service.call("POST", "/api/arm")
            service.await_state("armed")
            result["recording"] = _phase(service, arguments.minutes * 60, _Recordings(service).turn)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    (arguments.out / "soak.json").write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
    for name, phase in result.items():
        print(name, json.dumps({key: value for key, value in phase.items() if key != "samples"}, indent=2))


class _Recordings:
    """Makes one recording after the other, and removes each when it has ended."""

    def __init__(self, service: ServedRig) -> None:
        self._service, self._current, self._began = service, "", 0.0
        self.counts = {"pulses": 0, "complete": 0}

    def turn(self, result: dict[str, Any]) -> None:
        """End the recording that is long enough, and begin the next."""
        if self._current and time.monotonic() > self._began + _RECORDING_S:
            ended = self._service.json("POST", f"/api/recordings/{self._current}/stop")
            (self._service.data / f"{self._current}.mcap").unlink()
            for name in self.counts:
                self.counts[name] += ended["counts"][name]
            self._current = ""
            result["triplets"] = self.counts
        if not self._current:
            self._current = self._service.json("POST", "/api/recordings", {"preroll_s": 0})["id"]
            self._began = time.monotonic()


def _phase(service: ServedRig, seconds: float, turn: Callable[[dict[str, Any]], None]) -> dict[str, Any]:
    began, samples, result = time.monotonic(), list[Sample](), dict[str, Any]()
    while (now := time.monotonic() - began) < seconds:
        turn(result)
        samples.append(_look(service, now))
        time.sleep(_EVERY_S)
    return result | _figures(samples) | {"samples": [asdict(sample) for sample in samples]}


def _look(service: ServedRig, now: float) -> Sample:
    rows = service.json("GET", "/api/status")["processes"]
    pids = {"service": service.pid, **{row["name"]: row["pid"] for row in rows}}
    return Sample(now, {name: _memory_mb(pid) for name, pid in pids.items()}, cpu_seconds(pids.values()))


def _memory_mb(pid: int) -> float:
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines():
        if line.startswith("Pss_Anon:"):
            return round(int(line.split()[1]) * 1024 / _MB, 2)
    raise ValueError(f"process {pid} has no Pss_Anon")


def _figures(samples: list[Sample]) -> dict[str, Any]:
    """Memory at both ends, and its slope after the first third, when all buffers have been set up."""
    totals = [(sample.time_s, sum(sample.memory_mb.values())) for sample in samples]
    later = totals[len(totals) // 3 :]
    slope = linear_regression([t for t, _ in later], [m for _, m in later]).slope * _HOUR_S
    cpu = [(after.cpu_s - before.cpu_s) / (after.time_s - before.time_s) * 100 for before, after in pairwise(samples)]
    third = max(1, len(cpu) // 3)
    return {
        "memory_first_mb": round(totals[0][1], 1),
        "memory_last_mb": round(totals[-1][1], 1),
        "memory_slope_mb_per_hour": round(slope, 2),
        "service_last_mb": samples[-1].memory_mb["service"],
        "cpu_percent_of_a_core_first_third": round(mean(cpu[:third]), 2),
        "cpu_percent_of_a_core_last_third": round(mean(cpu[-third:]), 2),
    }


if __name__ == "__main__":
    main()
