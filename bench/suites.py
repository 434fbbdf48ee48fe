"""The suites of `svev bench` by name: each measures, writes its JSON, and makes a table for people."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from bench.analysis.digitizing import run_digitizing
from bench.analysis.faults import run_faults
from bench.analysis.honesty import run_honesty
from bench.analysis.jumps import run_jumps
from bench.analysis.live import run_live
from bench.analysis.repeats import run_repeats
from bench.analysis.smoothing import run_smoothing
from bench.photogrammetry.adjustment import run_adjustment
from bench.photogrammetry.gross_errors import run_gross_errors
from bench.photogrammetry.intersection import run_intersection
from bench.photogrammetry.planning import run_planning
from bench.recording.capture import SPLIT, run_capture
from bench.recording.firewire import run_firewire
from bench.recording.gstreamer import SINKS
from bench.recording.loads import LOADS, MANY
from bench.recording.many import many_table, run_many
from bench.recording.parts import run_parts
from bench.results import write_results
from bench.service.api import run_api
from bench.service.catalogue import run_catalogue
from bench.service.finding import run_finding
from bench.service.listing import run_listing
from bench.service.training import run_trainings
from bench.triggering.pairing import pairing_table, run_pairing
from recorder.publishing.subscriber import free_address
from rig.each import Each

Suite = Callable[[float, Path], dict[str, Any]]
SpreadSuite = Callable[[float, Path, Each], dict[str, Any]]
DrawnSuite = Callable[[int, Path], dict[str, Any]]


def _capture(name: str, seconds: float, directory: Path) -> dict[str, Any]:
    result = run_capture(LOADS[name], seconds, directory, free_address())
    result["file"] = str(write_results(f"capture-{name}", [result], directory))
    return result | {"table": _capture_table(result)}


def _many(name: str, seconds: float, directory: Path) -> dict[str, Any]:
    result = run_many(MANY[name], seconds, directory)
    return result | {"file": str(write_results(name, [result], directory)), "table": many_table(result)}


def _capture_table(result: dict[str, Any]) -> list[str]:
    lines = [f"{result['MB_per_s']} MB/s for {result['seconds']:g} s", f"{'':28}{'CPU-s/GB':>9}{'MB/s':>8}  triplets"]
    for name in ("svev", "svev, one subscriber", SPLIT, *SINKS):
        case = result[name]
        triplets = f"{case['complete']} of {case['pulses']}" if "pulses" in case else ""
        if "latency_ms" in case:
            memory, cable = case["latency_ms"], case["latency_from_cable_ms"]
            triplets += f"; subscriber got {case['received']}; latency, median and 99 %, from the frame in memory "
            triplets += f"{memory['median']} and {memory['p99']} ms, "
            triplets += f"from the last packet sent {cable['median']} and {cable['p99']} ms"
        lines.append(f"{name:28}{case['cpu_s_per_GB']:9.3f}{case['MB_per_s']:8.1f}  {triplets}")
    return lines + [f"{name}: {ratio}" for name, ratio in result["ratios"].items()]


def _parts(seconds: float, directory: Path) -> dict[str, Any]:
    cases = run_parts(seconds)
    path = write_results("parts", cases, directory)
    table = [f"{c['name']:22}{c['value']:9.2f}   {c['baseline_is']}: {c['baseline']:.2f}" for c in cases]
    return {"cases": cases, "file": str(path), "table": table}


def _timed(name: str, run: Callable[[float], list[dict[str, Any]]], seconds: float, directory: Path) -> dict[str, Any]:
    cases = run(seconds)
    path = write_results(name, cases, directory)
    table = [f"{c['name']:46}{c['value']:9.3f} {c['unit']:3} {c['baseline_is']}: {c['baseline']:.3f}" for c in cases]
    return {"cases": cases, "file": str(path), "table": table}


def _firewire(seconds: float, directory: Path) -> dict[str, Any]:
    return _timed("firewire", lambda duration: run_firewire(duration, directory), seconds, directory)


def _api(seconds: float, directory: Path) -> dict[str, Any]:
    cases = run_api(seconds, directory)
    path = write_results("api", cases, directory)
    table = [f"{c['name']:46}{c['value']:9.2f} ms  {c['baseline_is']}: {c['baseline']:.2f}" for c in cases]
    table.append(f"meanwhile recorded: {cases[0]['complete']} of {cases[0]['pulses']} triplets complete")
    return {"cases": cases, "file": str(path), "table": table}


def _intersection(seconds: float, directory: Path) -> dict[str, Any]:
    cases = run_intersection(seconds)
    path = write_results("intersection", cases, directory)
    table = [f"{c['name']:14}{c['value']:12,}   {c['baseline_is']}: {c['baseline']:,}" for c in cases]
    return {"cases": cases, "file": str(path), "table": table}


def _jumps(seconds: float, directory: Path) -> dict[str, Any]:
    cases = run_jumps(seconds)
    path = write_results("jumps", cases, directory)
    table = []
    for case in cases:
        table.append(f"{case['name']}: {case['value']} {case['unit']}, {case['baseline_is']}: {case['baseline']}")
        table.append("  " + ", ".join(f"{step} {spent:.2f}" for step, spent in case["stages_cpu_s"].items()))
        table.append(
            f"  {case['found']} of {case['jumps']} jumps found; of points in sight {case['solved']:.1%} solved, "
            f"{case['within_0.02_m'] or 0:.1%} of them within 0.02 m"
        )
    return {"cases": cases, "file": str(path), "table": table}


def _honesty(seconds: float, directory: Path, each: Each) -> dict[str, Any]:
    cases = run_honesty(seconds, each)
    path = write_results("jump-honesty", cases, directory)
    table = []
    for case in cases:
        table.append(f"{case['name']}, {case['found']} of {case['draws']} times found")
        table += [
            f"  {key:32}{of['n']:7} mean square {of['mean_square']:6.2f}, within 2 sigma {of['within_2_sigma']:6.1%}, "
            f"sigma / scatter {of['sigma_over_scatter']:5.2f}"
            for key, of in case["honesty"].items()
        ]
    return {"cases": cases, "file": str(path), "table": table}


def _repeats(draws: int, directory: Path) -> dict[str, Any]:
    cases = run_repeats(draws)
    path = write_results("jump-repeats", cases, directory)
    table = [
        f"{case['name']}: found different in {case['found']:.1%} of {case['pairs']} comparisons, expected "
        f"{case['expected']:.1%}"
        for case in cases
    ]
    return {"cases": cases, "file": str(path), "table": table}


def _faults(_seconds: float, directory: Path) -> dict[str, Any]:
    cases = run_faults()
    path = write_results("jump-faults", cases, directory)
    table = [f"{case['name']}: exit {case['code']}, {'; '.join(case['said'])}" for case in cases]
    return {"cases": cases, "file": str(path), "table": table}


def _pairing(pulses: int, directory: Path) -> dict[str, Any]:
    cases = run_pairing(pulses)
    path = write_results("pairing", cases, directory)
    return {"cases": cases, "file": str(path), "table": pairing_table(cases)}


def _training(jumpers: int, directory: Path) -> dict[str, Any]:
    cases = run_trainings(jumpers, directory)
    path = write_results("training", cases, directory)
    table = []
    for case in cases:
        missing = ", ".join(f"{count} {cause}" for cause, count in case["frames_missing"].items())
        table.append(
            f"{case['name']}: {case['recordings']} logs of {case['jumpers']} jumpers, {case['right_names']} names "
            f"right, {case['complete']} of {case['pulses']} pulses complete; frames missing: {missing}"
        )
        if "measured" in case:
            takeoff, pulse = case["after_takeoff_s"] or {}, case["after_last_pulse_s"] or {}
            table.append(
                f"  {case['measured']} measured, {case['measured_well']} well, {case['right_pages']} pages under the "
                f"right name, {case['still_waiting']} still waiting; figures and kinogram after the take-off, median "
                f"and most: {takeoff.get('median')} and {takeoff.get('most')} s, after the last pulse: "
                f"{pulse.get('median')} and {pulse.get('most')} s"
            )
    return {"cases": cases, "file": str(path), "table": table}


def _smoothing(draws: int, directory: Path) -> dict[str, Any]:
    cases = run_smoothing(draws)
    path = write_results("smoothing", cases, directory)
    table = []
    for case in cases:
        table.append(f"{case['name']}, {case['draws']} draws: mean square, within 2 sigma, sigma over scatter")
        table += [
            f"  {quantity:24}{of['mean_square']:8.2f} ± {of['known_to'] or np.nan:4.2f}"
            f"{of['within_2_sigma']:8.1%}{of['sigma_over_scatter']:8.2f}"
            for quantity, of in case["honesty"].items()
        ]
    return {"cases": cases, "file": str(path), "table": table}


def _gross_errors(draws: int, directory: Path) -> dict[str, Any]:
    cases = run_gross_errors(draws)
    path = write_results("gross-errors", cases, directory)
    columns = ("culprits", "removed", "named", "undetected", "innocents", "refused", "wrong")
    table = [f"{'of ' + str(draws) + ' networks each':34}" + "".join(f"{column:>11}" for column in columns)]
    table += [f"{case['name']:34}" + "".join(f"{case[column]:11}" for column in columns) for case in cases]
    return {"cases": cases, "file": str(path), "table": table}


#: Suites that go on for some seconds.
SUITES: dict[str, Suite] = {
    **{name: partial(_capture, name) for name in LOADS},
    **{name: partial(_many, name) for name in MANY},
    "firewire": _firewire,
    "parts": _parts,
    "api": _api,
    "catalogue": lambda seconds, directory: _timed("catalogue", lambda _: run_catalogue(directory), seconds, directory),
    "finding": lambda seconds, directory: _timed("finding", lambda _: run_finding(directory), seconds, directory),
    "listing": lambda seconds, directory: _timed("listing", lambda _: run_listing(directory), seconds, directory),
    "adjustment": partial(_timed, "adjustment", run_adjustment),
    "intersection": _intersection,
    "planning": partial(_timed, "planning", run_planning),
    "jumps": _jumps,
    "jump-faults": _faults,
    "live": lambda seconds, directory: _timed("live", lambda _: run_live(), seconds, directory),
    "digitizing": lambda seconds, directory: _timed("digitizing", lambda _: run_digitizing(), seconds, directory),
}
#: Suites that go on for some seconds, here or elsewhere.
SPREAD: dict[str, SpreadSuite] = {"jump-honesty": _honesty}
#: Suites that draw jumps or networks and the errors of their measurements.
DRAWN: dict[str, DrawnSuite] = {"smoothing": _smoothing, "jump-repeats": _repeats, "gross-errors": _gross_errors}
#: Suites that fire a number of simulated pulses.
FIRED: dict[str, DrawnSuite] = {"pairing": _pairing}
#: Suites in which a number of jumpers jump.
JUMPED: dict[str, DrawnSuite] = {"training": _training}
