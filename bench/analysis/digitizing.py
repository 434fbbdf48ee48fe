"""Measuring by hand over HTTP: from a click to its sigma, from the pointer to the curve, with little and much marked.

A real `svev digitize` serves a rendered jump on loopback. Each case has as its baseline the same with nothing marked,
measured in the same run.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np

from analysis.digitizing.journal import SUFFIX, Entered, Journal, Key
from analysis.digitizing.session import Session
from bench.analysis.hill_logs import HillLog, write_hill_log
from recorder.reading.info import info
from rig.api.digitizing import MarkState
from rig.errors import ProcessDiedError
from simrig.world.scenario import load_scenario

_SCENARIO: Final = Path("config/scenarios/training.toml")
_HILL_PULSES: Final = range(20, 58)
_PULSE: Final = 20
_MARKED: Final = 100_000
_START_S: Final = 60.0
_CALLS: Final = 200


def run_digitizing() -> list[dict[str, Any]]:
    """Measure each call with nothing and with 100 000 points marked.

    Returns:
        One case for each call: 99th percentile, ms.

    Raises:
        ProcessDiedError: the page does not answer, or refuses.
    """
    with tempfile.TemporaryDirectory() as folder:
        scenario = load_scenario(_SCENARIO).model_copy(update={"stamp": False})
        log = write_hill_log(Path(folder) / "jump", scenario, _HILL_PULSES)
        bare = _measured(log, marked=0)
        full = _measured(log, marked=_MARKED)
    return [
        {
            "name": name,
            "value": full[name],
            "unit": "ms",
            "baseline": bare[name],
            "baseline_is": "with nothing marked",
            "marked": _MARKED,
        }
        for name in full
    ]


def _measured(log: HillLog, marked: int) -> dict[str, float]:
    folder = log.path.with_suffix(f".{marked}")
    if marked:
        recording = info(log.path).recording
        session = Session(Journal(folder / f"Anna{SUFFIX}", recording, "Anna"))
        marks = [
            (Key(pulse, "K1", "P1"), Entered(MarkState.MEASURED, (1.0, 2.0))) for pulse in range(1000, 1000 + marked)
        ]
        session.put(marks)
        session.close()
    with _served(log, folder) as client:
        sight = _sight(log)
        place = {"do": "place", "pulse": _PULSE, "sigma": [0.3, 0.3]}
        clicks = [place | {"camera": camera, "thing": thing, "xy": xy} for (camera, thing), xy in sight.items()]
        drags = [
            {"operator": "Anna", "pulse": _PULSE, "camera": camera, "thing": thing, "x": xy[0], "y": xy[1]}
            for (camera, thing), xy in sight.items()
        ]
        return {
            "click to sigma, 99 %": _p99(lambda i: client.post("sessions/Anna/actions", json=clicks[i % len(clicks)])),
            "pointer to curves, 99 %": _p99(lambda i: client.get("geometry", params=drags[i % len(drags)])),
            "undo, 99 %": _p99(lambda i: client.post("sessions/Anna/actions", json={"do": ("undo", "redo")[i % 2]})),
            "step to another pulse, 99 %": _p99(lambda i: client.get(f"sessions/Anna/pulses/{_PULSE - i % 3}")),
            "frame without loss, 99 %": _p99(lambda i: client.get(f"frames/{10 + i % 20}/K{1 + i % 3}.png")),
        }


def _sight(log: HillLog) -> dict[tuple[str, str], list[float]]:
    """Some place in each image for each point in sight: what is computed takes the same time wherever it is."""
    seen = log.truth[_PULSE]["in_sight"]
    return {
        (camera, thing): [300.0 + 10 * i, 200.0 + 5 * i]
        for camera, things in seen.items()
        for i, (thing, there) in enumerate(things.items())
        if there
    }


def _p99(call: Any) -> float:
    taken = []
    for i in range(_CALLS):
        began = time.perf_counter()
        answer = call(i)
        taken.append(time.perf_counter() - began)
        if answer.is_error:
            raise ProcessDiedError(f"{answer.request.url}: {answer.status_code} {answer.text}")
    return float(np.quantile(taken, 0.99) * 1e3)


@contextmanager
def _served(log: HillLog, folder: Path) -> Iterator[httpx.Client]:
    command = [sys.executable, "-m", "svev", "digitize", str(log.path), "--survey", str(log.survey)]
    process = subprocess.Popen([*command, "--marks", str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None  # noqa: S101 - a pipe was asked for
    try:
        said = process.stdout.readline()
        _, _, address = said.partition("measure at ")
        url = httpx.URL(address.strip())
        recording = url.params["recording"]
        base = f"http://{url.host}:{url.port}/api/recordings/{recording}/digitizing/"
        with httpx.Client(base_url=base, timeout=_START_S, trust_env=False) as client:
            deadline = time.monotonic() + _START_S
            while client.get("../digitizing").json()["orientation"]["state"] == "working":
                if time.monotonic() > deadline:
                    raise ProcessDiedError("the cameras are not oriented in time")
                time.sleep(0.1)
            yield client
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()
