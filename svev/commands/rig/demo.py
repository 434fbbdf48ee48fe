"""`svev demo`: record jumps on the simulated hill and measure them."""

import shlex
from pathlib import Path
from typing import Annotated

import typer

from svev import console
from svev.commands.rig.record import aside, causes
from svev.demo import Bus, Shown, run_demo
from svev.demo_analysis import Measured


def demo(
    seconds: Annotated[
        float, typer.Option(metavar="S", min=0.5, max=3600, help="length of the recording, seconds")
    ] = 10.0,
    bus: Annotated[
        Bus, typer.Option(metavar="gige|firewire|sim", help="how the simulated cameras are connected")
    ] = "gige",
    scenario: Annotated[
        Shown, typer.Option(metavar="training|hard|faults", help="what the simulated hill shows: a good day, a bad one")
    ] = "training",
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="folder for the files; made if missing")
    ] = Path("demo"),
    analyze: Annotated[bool, typer.Option(help="measure the jumps after recording them")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Record jumps on the simulated hill, measure them and show the result. Needs no camera.

    Three simulated cameras send their frames as real ones do: as GigE Vision packets over this computer's network, or,
    with --bus firewire, over an emulated FireWire bus. The frames are paired by trigger pulse, written to a log and
    published; a subscriber counts what it receives. Then the balls in the log's images orient the cameras, the jumper
    is measured, and what was found is printed beside the truth. Beside the log you find a contact sheet (a picture of
    its frames), the survey of the balls, the truth, and a folder with the results: open report.html there.

    Example: svev demo --seconds 5

    Example: svev demo --bus firewire

    Example: svev demo --scenario hard --seconds 12
    """
    result = run_demo(bus, scenario, seconds, out, aside, analyze=analyze)
    if as_json:
        console.print_json(result.to_json())
        return
    counts, size = result.recorded.report.counts, result.recorded.report.bytes
    counted, latency = result.subscriber, result.subscriber.latency_ms
    console.say("")
    console.say(f"pulses             {counts.pulses} at {result.rate_hz:g} Hz")
    console.say(f"complete triplets  {counts.complete}{causes(counts.causes.model_dump())}")
    console.say(f"subscriber got     {counted.received}, missing {counted.missing}")
    if latency["median"] is not None:
        console.say(f"latency            {latency['median']:.1f} ms median, {latency['p99']:.1f} ms at 99 %")
    console.say(f"log                {result.log} ({size / 1e6:.1f} MB), {result.verdict}")
    console.say(f"contact sheet      {result.contact_sheet}")
    console.say(f"truth              {result.truth}")
    if result.analysis is not None:
        _say_measured(result.analysis)
    again = ["svev", "analyze", str(result.log), "--survey", str(result.survey)]
    again += ["-o", f"{result.log.with_suffix('')}-again"]
    console.say(f"survey             {result.survey}")
    console.say(f"measure it again   {shlex.join(again)}")


def _say_measured(analysis: Measured) -> None:
    """What was measured, beside the truth."""
    if analysis.message:
        console.say(f"nothing measured   {analysis.message}")
        return
    for jump in analysis.jumps:
        console.say("")
        console.say(f"jump {jump.number}             {jump.verdict}")
        if jump.figures:
            console.say(f"                   at {jump.at}:")
        for figure in jump.figures:
            console.say(f"                   {figure.words()}")
    console.say("")
    console.say(f"results            {analysis.out}")
    console.say(f"for the coach      {analysis.report}")
