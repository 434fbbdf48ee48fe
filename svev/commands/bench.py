"""`svev bench`: figures beside their baselines."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from bench.suites import SUITES
from svev import console

Suite = StrEnum("Suite", {name: name for name in SUITES})


def bench(
    suites: Annotated[list[Suite] | None, typer.Argument(help="which; all if left out")] = None,
    seconds: Annotated[float, typer.Option(min=1, max=600, help="length of each run")] = 20.0,
    out: Annotated[Path, typer.Option(help="directory for results and for the logs, which are removed")] = Path(
        "bench/results"
    ),
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Measure speed, each figure side by side with its baseline in the same run.

    paper, saturated, double: three GigE Vision cameras received, paired, composed, checksummed, published and written,
    beside gst-launch-1.0 aravissrc ! fakesink and ! filesink for the same cameras. CPU-seconds per GB of image data;
    the simulated cameras are not counted. parts: pairing, composing, checksum, and drawing on their own.

    Example: svev bench saturated --seconds 10
    """
    out.mkdir(parents=True, exist_ok=True)
    results = {}
    for suite in suites or list(Suite):
        console.say(f"{suite.value} ...", aside=True)
        results[suite.value] = SUITES[suite.value](seconds, out)
    if as_json:
        console.print_json(results)
    else:
        for name, lines in results.items():
            console.say(f"\n{name}")
            for line in lines["table"]:
                console.say(f"  {line}")
        console.say(f"\nresults in {out}")
