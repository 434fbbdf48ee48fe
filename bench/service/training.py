"""A training that nobody touches: recorded by motion, named by the start list, measured by itself, or not measured.

Run it on a quiet machine: `python -m bench.service.training --jumpers 20 --out FOLDER`. It writes `training.json`:
whether every jump has its log, its name and its result, how long after the take-off the figures are there, and which
frames the analysis cost. Both halves record the same jumps of the simulated hill with three simulated GigE cameras.
"""

import argparse
import json
import shutil
import time
from datetime import datetime
from pathlib import Path
from statistics import median
from typing import Any, Final

from bench.results import write_results
from bench.service.serving import ServedRig, served_rig
from rig.errors import ProcessDiedError
from rig.settings.file import CONFIG
from simrig.world.scenario import load_scenario
from simrig.world.survey import survey

_LOOK_S: Final = 0.5
#: Measuring one log takes less, also on a slow computer.
_MEASURED_S: Final = 300.0


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jumpers", type=int, default=20)
    parser.add_argument("--every", type=float, default=30.0, help="seconds from one jump to the next")
    parser.add_argument("--out", type=Path, default=Path("bench/results"))
    arguments = parser.parse_args()
    cases = [
        run_training(arguments.jumpers, arguments.every, arguments.out / "training", analysis=analysis)
        for analysis in (False, True)
    ]
    write_results("training", cases, arguments.out)
    print(json.dumps(cases, indent=2))


def run_training(jumpers: int, every_s: float, folder: Path, *, analysis: bool) -> dict[str, Any]:
    """Record a training, and wait until everything is measured.

    Args:
        jumpers: so many jump.
        every_s: from one jump to the next, s.
        folder: where everything is kept meanwhile; removed afterwards.
        analysis: whether the logs are measured.

    Returns:
        Counts of recordings, names, results and frames, and seconds from the take-off to the figures.

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
            found = [_measured(service, each["id"]) for each in recordings] if analysis else []
            return _figures(recordings, found, names) | {"analysis": analysis, "jumpers": jumpers}
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


def _measured(service: ServedRig, recording: str) -> dict[str, Any]:
    """The measurement of a recording, once it has come to an end."""
    deadline = time.monotonic() + _MEASURED_S
    while True:
        found: dict[str, Any] = service.json("GET", f"/api/recordings/{recording}/measurement")
        if found["state"] in {"done", "failed"}:
            return found
        if time.monotonic() > deadline:
            raise ProcessDiedError(f"{recording} is not measured within {_MEASURED_S:g} s")
        time.sleep(_LOOK_S)


def _figures(recordings: list[dict[str, Any]], found: list[dict[str, Any]], names: list[str]) -> dict[str, Any]:
    frames = {name: sum(each["counts"][name] for each in recordings) for name in ("pulses", "complete", "partial")}
    waits = [
        (datetime.fromisoformat(each["measured"]) - datetime.fromisoformat(figure["time"])).total_seconds()
        for each in found
        for figure in each["figures"]
    ]
    return {
        "recordings": len(recordings),
        "right_names": sum(each["session"]["athlete"] == name for each, name in zip(recordings, names, strict=True)),
        **frames,
        "measured": sum(each["state"] == "done" for each in found),
        "measured_well": sum(any(figure["ok"] for figure in each["figures"]) for each in found),
        "jumps": sum(len(each["figures"]) for each in found),
        "figures_after_takeoff_s": {"median": round(median(waits), 1), "most": round(max(waits), 1)} if waits else None,
    }


if __name__ == "__main__":
    main()
