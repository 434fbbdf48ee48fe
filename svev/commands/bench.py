"""`svev bench`: figures beside their baselines."""

from pathlib import Path
from typing import Annotated

import typer

from bench.suites import SUITES
from rig.errors import BadInputError
from svev import console


def bench(
    suites: Annotated[list[str] | None, typer.Argument(help=f"which of {', '.join(SUITES)}; all if left out")] = None,
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
    api: how fast the service answers while it records at 30 Hz, beside the same while idle.
    adjustment: free networks with full covariance, beside scipy's least_squares on the same problem.

    Example: svev bench saturated --seconds 10
    """
    if unknown := [name for name in suites or () if name not in SUITES]:
        raise BadInputError(f"no benchmark is called {unknown[0]}: choose from {', '.join(SUITES)}")
    out.mkdir(parents=True, exist_ok=True)
    results = {}
    for name in suites or SUITES:
        console.say(f"{name} ...", aside=True)
        results[name] = SUITES[name](seconds, out)
    if as_json:
        console.print_json(results)
    else:
        for name, lines in results.items():
            console.say(f"\n{name}")
            for line in lines["table"]:
                console.say(f"  {line}")
        console.say(f"\nresults in {out}")
