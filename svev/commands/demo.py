"""`svev demo`: the whole rig on the simulated hill."""

from pathlib import Path
from typing import Annotated

import typer

from rig.control import Message
from svev import console
from svev.demo import Bus, run_demo


def demo(
    seconds: Annotated[float, typer.Option(min=0.5, max=3600, help="how long to record")] = 10.0,
    bus: Annotated[Bus, typer.Option(help="how the simulated cameras are connected")] = "gige",
    out: Annotated[Path, typer.Option(help="directory for what is made")] = Path("demo"),
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Record a few jumps on the simulated hill and show what was made. No camera needed.

    Three simulated cameras speak real GigE Vision over loopback to Aravis, or, with --bus firewire, are driven by the
    unmodified libdc1394 on an emulated FireWire bus. A pulse train triggers them, the frames are paired by pulse,
    logged and published; a subscriber counts what it gets.

    Example: svev demo --seconds 5
    Example: svev demo --bus firewire
    """
    result = run_demo(bus, seconds, out, lambda line: console.say(line, aside=True))
    if as_json:
        console.print_json(result)
    else:
        _print_result(result)


def _print_result(result: Message) -> None:
    causes = ", ".join(f"{count} {cause}" for cause, count in result["causes"].items() if count)
    counted, latency = result["subscriber"], result["subscriber"]["latency_ms"]
    console.say("")
    console.say(f"pulses             {result['pulses']} at {result['rate_hz']:g} Hz")
    console.say(f"complete triplets  {result['complete']}" + (f" (frames: {causes})" if causes else ""))
    console.say(f"subscriber got     {counted['received']}, missing {counted['missing']}")
    if latency["median"] is not None:
        console.say(f"latency            {latency['median']:.1f} ms median, {latency['p99']:.1f} ms at 99 %")
    console.say(f"log                {result['log']} ({result['bytes'] / 1e6:.1f} MB), {result['verdict']}")
    console.say(f"contact sheet      {result['contact_sheet']}")
    console.say(f"truth              {result['truth']}")
