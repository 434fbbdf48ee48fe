"""A training that nobody touches: recorded by motion, named by the start list, measured by itself, or not measured.

Both halves record the same jumps of the simulated hill with three simulated GigE cameras on a quiet machine: whether
every jump has its log, its name and its pages, when the figures are there, and which frames the analysis costs.
"""

import json
import shutil
import time
from collections import Counter
from datetime import datetime, timedelta
from pathlib import Path
from statistics import median
from typing import Any, Final

from bench.service.serving import ServedRig, served_rig
from rig.errors import ProcessDiedError
from rig.settings.file import CONFIG
from simrig.world.scenario import load_scenario
from simrig.world.survey import survey

_LOOK_S: Final = 0.5
#: From one jump to the next.
_EVERY_S: Final = 30.0
#: Measuring one log takes less, also on a slow computer.
_MEASURED_S: Final = 300.0
#: What people look at.
_PAGES: Final = ("kinogram.html", "report.html")


def run_trainings(jumpers: int, directory: Path, every_s: float = _EVERY_S) -> list[dict[str, Any]]:
    """Record a training without analysis, then the same one with it.

    Args:
        jumpers: so many jump.
        directory: where everything is kept meanwhile, and removed afterwards.
        every_s: from one jump to the next, s.

    Returns:
        A case of each, as `run_training` gives it.

    Raises:
        ProcessDiedError: the service ends, or a jump is not recorded or measured in time.
    """
    folder = directory / "training"
    return [run_training(jumpers, every_s, folder, analysis=analysis) for analysis in (False, True)]


def run_training(jumpers: int, every_s: float, folder: Path, *, analysis: bool) -> dict[str, Any]:
    """Record a training, and wait until everything is measured.

    Args:
        jumpers: so many jump.
        every_s: from one jump to the next, s.
        folder: where everything is kept meanwhile; removed afterwards.
        analysis: whether the logs are measured.

    Returns:
        Counts of recordings, names, results, pages with the right name, frames and logs that still wait at the end;
        seconds from the take-off and from the last pulse to the figures, with which the pages come.

    Raises:
        ProcessDiedError: the service ends, or a jump is not recorded or measured in time.
    """
    shutil.rmtree(folder, ignore_errors=True)
    try:
        with served_rig(folder, _rig_text(folder, every_s, analysis=analysis)) as service:
            names = [f"Jumper {bib}" for bib in range(1, jumpers + 1)]
            lines = "".join(f"{bib};{name}\n" for bib, name in enumerate(names, 1))
            service.put_table("/api/start-list", f"bib;athlete\n{lines}".encode())
            service.call("POST", "/api/arm")
            service.await_state("armed")
            service.call("PUT", "/api/automatic", {"on": True})
            recordings = _recorded(service, jumpers, every_s)
            service.call("PUT", "/api/automatic", {"on": False})
            case = {"name": "measured" if analysis else "not measured", "jumpers": jumpers}
            case |= _frames(recordings) | {"right_names": _right_names(recordings, names)}
            if analysis:
                deadline = time.monotonic() + jumpers * _MEASURED_S
                found = [_measured(service, each["id"], deadline) for each in recordings]
                case |= _figures(recordings, found) | {"right_pages": _right_pages(service, recordings, names)}
                case["still_waiting"] = _still_waiting(service)
            return case
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _rig_text(folder: Path, every_s: float, *, analysis: bool) -> str:
    """The tables of the rig file beside those of the cameras; writes scenario and survey."""
    folder.mkdir(parents=True)
    scenario = folder / "scenario.toml"
    base = CONFIG / "scenarios" / "training.toml"
    scenario.write_text(f'base = "{base}"\nname = "a training"\njump_every_s = {every_s}\n', encoding="utf-8")
    text = '[automatic]\nbefore_s = 5.0\nafter_s = 5.0\n\n[automatic.motion]\ncamera = "K1"\n\n'
    if analysis:
        (folder / "survey.json").write_text(json.dumps(survey(load_scenario(scenario))), encoding="utf-8")
        text += '[analysis]\nsurvey = "survey.json"\n\n'
    return f'{text}[simulation]\nscenario = "{scenario}"\n'


def _recorded(service: ServedRig, jumpers: int, every_s: float) -> list[dict[str, Any]]:
    """The recordings of all jumpers, in order, once they have ended."""
    deadline = time.monotonic() + (jumpers + 3) * every_s
    while True:
        recordings: list[dict[str, Any]] = service.json("GET", f"/api/recordings?limit={jumpers + 10}")
        ended = [each for each in recordings if each["state"] == "finished"]
        if len(ended) >= jumpers:
            return sorted(ended, key=lambda each: str(each["started"]))[:jumpers]
        if time.monotonic() > deadline:
            raise ProcessDiedError(f"{len(ended)} of {jumpers} jumps are recorded: see the service's log")
        time.sleep(_LOOK_S)


def _measured(service: ServedRig, recording: str, deadline: float) -> dict[str, Any]:
    """The measurement of a recording, once it has come to an end."""
    while True:
        found: dict[str, Any] = service.json("GET", f"/api/recordings/{recording}/measurement")
        if found["state"] in {"done", "failed"}:
            return found
        if time.monotonic() > deadline:
            raise ProcessDiedError(f"{recording} is not measured yet, {_MEASURED_S:g} s a jumper after the last one")
        time.sleep(_LOOK_S)


def _frames(recordings: list[dict[str, Any]]) -> dict[str, Any]:
    """How many logs and pulses there are, and which frames are missing, by cause."""
    missing: Counter[str] = Counter()
    for each in recordings:
        missing.update(each["counts"]["causes"])
    pulses, complete = (sum(each["counts"][name] for each in recordings) for name in ("pulses", "complete"))
    return {"recordings": len(recordings), "pulses": pulses, "complete": complete, "frames_missing": dict(missing)}


def _right_names(recordings: list[dict[str, Any]], names: list[str]) -> int:
    return sum(each["session"]["athlete"] == name for each, name in zip(recordings, names, strict=True))


def _right_pages(service: ServedRig, recordings: list[dict[str, Any]], names: list[str]) -> int:
    """How many recordings have all pages, each with the name of who jumped."""
    return sum(
        all(
            name in service.call("GET", f"/api/recordings/{each['id']}/measurement/files/{page}").text
            for page in _PAGES
        )
        for each, name in zip(recordings, names, strict=True)
    )


def _still_waiting(service: ServedRig) -> int:
    """How many logs are being measured or wait for it."""
    queue = service.json("GET", "/api/status")["measuring"]
    return int(queue["waiting"]) + (queue["recording"] is not None)


def _figures(recordings: list[dict[str, Any]], found: list[dict[str, Any]]) -> dict[str, Any]:
    measured = [datetime.fromisoformat(each["measured"]) for each in found]
    ends = [datetime.fromisoformat(each["started"]) + timedelta(seconds=each["duration_s"]) for each in recordings]
    takeoffs = [[datetime.fromisoformat(figure["time"]) for figure in each["figures"]] for each in found]
    return {
        "measured": sum(each["state"] == "done" for each in found),
        "measured_well": sum(any(figure["ok"] for figure in each["figures"]) for each in found),
        "jumps": sum(map(len, takeoffs)),
        "after_takeoff_s": _spread(
            [(at - takeoff).total_seconds() for at, own in zip(measured, takeoffs, strict=True) for takeoff in own]
        ),
        "after_last_pulse_s": _spread([(at - end).total_seconds() for at, end in zip(measured, ends, strict=True)]),
    }


def _spread(waits: list[float]) -> dict[str, float] | None:
    return {"median": round(median(waits), 1), "most": round(max(waits), 1)} if waits else None
