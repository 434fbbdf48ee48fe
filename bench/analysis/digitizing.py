"""Measuring by hand over HTTP: from a click to its sigma, from the pointer to the curve, with little and much marked.

Two real `svev digitize` serve a rendered jump on loopback: one in which nothing is marked, the baseline, and one with a
long journal. They are called in turn.
"""

import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import httpx
import msgspec
import numpy as np

from analysis.digitizing.marks.journal import FORMAT, SUFFIX, Entered, Entry, Key
from bench.analysis.hill_logs import HillLog, write_hill_log
from bench.recording.processes import cpu_seconds
from recorder.reading.info import info
from rig.api.digitizing import MarkState
from rig.arrays import Floats
from rig.errors import ProcessDiedError
from rig.transport.launcher import program_command
from simrig.world.scenario import Scenario, load_scenario

_SCENARIO: Final = Path("config/scenarios/training.toml")
_HILL_PULSES: Final = range(20, 58)
_PULSE: Final = 20
_MARKED: Final = 100_000
_START_S: Final = 60.0
_SIZE: Final = (640, 480)
_SCATTER_PX: Final = 0.3
#: Calls that are measured, and those before them, after which everything is loaded.
_CALLS: Final = 200
_FIRST: Final = 20


@dataclass(frozen=True, slots=True, eq=False)
class _Server:
    client: httpx.Client
    pid: int


@dataclass(frozen=True, slots=True)
class _Taken:
    """Times of a call, ms: 99th percentile and median."""

    p99: float
    median: float


def run_digitizing() -> list[dict[str, Any]]:
    """Measure each call with nothing and with 100 000 points marked.

    Returns:
        Two cases for each call, 99th percentiles, ms: to its answer, and the service's processor time for it.

    Raises:
        ProcessDiedError: the page does not answer, or refuses.
    """
    scenario = load_scenario(_SCENARIO).model_copy(update={"stamp": False})
    with tempfile.TemporaryDirectory() as name:
        log = write_hill_log(Path(name) / "jump", scenario, _HILL_PULSES, _SIZE)
        _journal(Path(name, "full"), info(log.path).recording)
        with _served(log, Path(name, "bare")) as bare, _served(log, Path(name, "full")) as full:
            found = {name: _measured((bare, full), call) for name, call in _calls(log, scenario).items()}
    return [
        {
            "name": f"{name}, 99 %{of}",
            "value": full.p99,
            "unit": "ms",
            "baseline": bare.p99,
            "baseline_is": "with nothing marked",
            "marked": _MARKED,
            "median_ms": full.median,
            "median_bare_ms": bare.median,
        }
        for name, times in found.items()
        for of, (bare, full) in zip(("", ", processor time"), times, strict=True)
    ]


def _journal(folder: Path, recording: str) -> None:
    """A journal of as many actions, each with its line, as if they had been clicked."""
    folder.mkdir()
    path = folder / f"Anna{SUFFIX}"
    head = {"format": FORMAT, "recording": recording, "operator": "Anna"}
    entered = Entered(MarkState.MEASURED, (1.0, 2.0))
    entries = (Entry("change", "", ((Key(pulse, "K1", "P1"), entered),)) for pulse in range(1000, 1000 + _MARKED))
    path.write_bytes(b"".join(msgspec.json.encode(line) + b"\n" for line in (head, *entries)))


def _calls(log: HillLog, scenario: Scenario) -> dict[str, Callable[[httpx.Client, int], httpx.Response]]:
    """What is measured: how each call is made for the i-th time. No click is at the place of an earlier one."""
    random = np.random.default_rng(1)
    scatter = random.normal(0, _SCATTER_PX, (_CALLS + _FIRST, 2))
    points, skis = _clicks(log, scenario)

    def click(places: list[dict[str, Any]], client: httpx.Client, i: int) -> httpx.Response:
        place = places[i % len(places)]
        xy = (np.array(place["xy"]) + scatter[i]).tolist()
        return client.post("sessions/Anna/actions", json=place | {"do": "place", "pulse": _PULSE, "xy": xy})

    def drag(client: httpx.Client, i: int) -> httpx.Response:
        place = points[i % len(points)]
        x, y = np.array(place["xy"]) + scatter[i]
        where = {"operator": "Anna", "pulse": _PULSE, "camera": place["camera"], "thing": place["thing"]}
        return client.get("geometry", params=where | {"x": x, "y": y})

    return {
        "point of a ski to its angles": lambda client, i: click(skis, client, i),
        "click to sigma": lambda client, i: click(points, client, i),
        "pointer to curves": drag,
        "undo": lambda client, i: client.post("sessions/Anna/actions", json={"do": ("undo", "redo")[i % 2]}),
        "step to another pulse": lambda client, i: client.get(f"sessions/Anna/pulses/{_PULSE - i % 3}"),
        "frame without loss": lambda client, i: client.get(f"frames/{10 + i % 20}/K{1 + i % 3}.png"),
    }


def _clicks(log: HillLog, scenario: Scenario) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """The points in sight, and two points of each ski, in each image, where they really are."""
    state = log.truth[_PULSE]
    points, skis = [], []
    for camera in scenario.cameras:
        projection = camera.projection(*_SIZE)
        for thing, xyz in state["points"].items():
            if state["in_sight"][camera.name][thing]:
                xy = projection.pixels(np.array(xyz)).tolist()
                points.append({"camera": camera.name, "thing": thing, "xy": xy})
        for side, ski in state["skis"].items():
            for vertex, along in enumerate((-0.9, 0.9)):
                xy = projection.pixels(np.array(ski["point"]) + along * np.array(ski["direction"])).tolist()
                skis.append({"camera": camera.name, "thing": f"{side} ski", "xy": xy, "vertex": vertex})
    return points, skis


def _measured(
    servers: Sequence[_Server], call: Callable[[httpx.Client, int], httpx.Response]
) -> tuple[list[_Taken], list[_Taken]]:
    """The same calls to all servers in turn, so that the computer is equally busy with other things.

    Whatever else runs there makes answers late; the processor time of the service tells what of it is its own.

    Returns:
        Of each server the times to the answers, and the processor times.
    """
    taken = np.empty((len(servers), _FIRST + _CALLS))
    cpu = np.empty_like(taken)
    for i in range(_FIRST + _CALLS):
        for k, server in enumerate(servers):
            used, began = cpu_seconds([server.pid]), time.perf_counter()
            answer = call(server.client, i)
            taken[k, i], cpu[k, i] = time.perf_counter() - began, cpu_seconds([server.pid]) - used
            if answer.is_error:
                raise ProcessDiedError(f"{answer.request.url}: {answer.status_code} {answer.text}")
    return _taken(taken[:, _FIRST:]), _taken(cpu[:, _FIRST:])


def _taken(times_s: Floats) -> list[_Taken]:
    """Of the times (servers, calls) of each server."""
    return [_Taken(float(p99), float(median)) for p99, median in np.quantile(times_s, (0.99, 0.5), axis=1).T * 1e3]


@contextmanager
def _served(log: HillLog, folder: Path) -> Iterator[_Server]:
    command = [*program_command("svev"), "digitize", str(log.path), "--survey", str(log.survey)]
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
            yield _Server(client, process.pid)
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()
