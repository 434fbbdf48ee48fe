"""`svev bench`: measures the speed of the program, each figure beside a baseline."""

from pathlib import Path
from typing import Annotated

import typer

from bench.suites import DRAWN, FIRED, JUMPED, SPREAD, SUITES
from rig.errors import BadInputError
from svev import console
from svev.spreading import SchedulerOption, WorkersOption, spread

_NAMES = (*SUITES, *SPREAD, *DRAWN, *FIRED, *JUMPED)


def bench(
    suites: Annotated[
        list[str] | None, typer.Argument(metavar="SUITE", help=f"which of {', '.join(_NAMES)}; all if left out")
    ] = None,
    seconds: Annotated[float, typer.Option(metavar="S", min=1, max=600, help="length of each run, seconds")] = 20.0,
    draws: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=1,
            max=10_000,
            help="number of jumps that smoothing and jump-repeats draw, of networks of each kind for gross-errors",
        ),
    ] = 18,
    pulses: Annotated[
        int, typer.Option(metavar="N", min=100, max=10_000_000, help="pulses of each case of pairing")
    ] = 5000,
    jumpers: Annotated[
        int, typer.Option(metavar="N", min=1, max=100, help="jumpers of training; each takes a minute")
    ] = 5,
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="DIR", help="folder for the results, and for logs that are removed again"),
    ] = Path("bench/results"),
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Measure how fast this computer records and computes; each figure stands beside a baseline of the same run.

    paper, saturated, double: record three simulated GigE Vision cameras; the baseline is gst-launch-1.0 (aravissrc to
    fakesink and to filesink) with the same cameras. Figures are CPU-seconds per GB of image data, without the work of
    the simulated cameras. firewire: the same on an emulated FireWire bus. cameras-8, hertz-200: eight cameras 640 x 480
    at 30 Hz, three at 200 Hz: frames expected, complete and lost, processor time of each process, and bytes to the
    disk. parts: pairing, composing, checksum and drawing, each alone. api: answer times of the service while it records
    at 30 Hz; the baseline is the idle service. catalogue, listing, finding: lists of many recordings and jumps, what
    pages of jumps ask for, searches among 20 000; the baseline is a service that has just been started. intersection,
    planning: intersections of rays and planned networks. adjustment: free networks with full covariance; the baseline
    is scipy's least_squares.
    jumps, jump-faults: rendered jumps are measured, without and with faults. jump-honesty: the same with many drawn
    surveys, errors beside their sigmas (alone spread by --workers or --scheduler). jump-repeats: one jump filmed again
    and again, and with another leg angle: how often comparisons find a difference; about seven seconds a draw. live:
    how soon a worker tells the state of each pulse at 30 Hz. smoothing: whether the sigmas of smoothed jumps hold, with
    all measurements and with a marker or a ski missing for a while; about two seconds a draw. gross-errors: hills with
    exchanged names, wrong survey, wrong image points or wrong units: what the search for gross errors makes of them.
    pairing: triplets mixed, not found and invented under clocks that are set and rates that the rig file does not name.
    digitizing: measuring by hand over HTTP with nothing and with 100 000 points marked, from a click to its sigma, from
    the pointer to the curves, a step to another pulse; processor times beside, which other programs change little.

    Example: svev bench saturated --seconds 10
    """
    if unknown := [name for name in suites or () if name not in _NAMES]:
        raise BadInputError(f"no benchmark is called {unknown[0]}: choose from {', '.join(_NAMES)}")
    out.mkdir(parents=True, exist_ok=True)
    results = {}
    for name in suites or _NAMES:
        console.say(f"{name} ...", aside=True)
        if name in SUITES:
            results[name] = SUITES[name](seconds, out)
        if name in SPREAD:
            with spread(workers, scheduler) as each:
                results[name] = SPREAD[name](seconds, out, each)
        for counted, number in ((DRAWN, draws), (FIRED, pulses), (JUMPED, jumpers)):
            if name in counted:
                results[name] = counted[name](number, out)
    if as_json:
        console.print_json(results)
    else:
        for name, lines in results.items():
            console.say_text(f"\n{name}")
            for line in lines["table"]:
                console.say(f"  {line}")
        console.say("")
        console.say(f"results in {out}")
