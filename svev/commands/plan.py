"""`svev plan`: how accurate a network will be, before it is built."""

import math
from pathlib import Path
from typing import Annotated, Final

import typer

from photogrammetry.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.planning.description import read_description
from photogrammetry.planning.monte_carlo import SAMPLES, simulate
from photogrammetry.planning.plan import plan_from
from photogrammetry.planning.prediction import adjusted_plan, predict
from photogrammetry.planning.report import plan_table, plan_to_json, worst_disagreement
from svev import console

_NOT_SOLVABLE: Final = 3
_NOT_CONVERGED: Final = 4
_SEED: Final = 2009


def plan(
    network: Annotated[Path, typer.Argument(help="planned network (TOML), e.g. config/networks/hill-1.toml")],
    samples: Annotated[
        int, typer.Option(min=100, max=100_000, help="repetitions of the Monte-Carlo simulation")
    ] = SAMPLES,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object instead of the tables")] = False,
) -> None:
    """Predict the accuracy of cameras, jumper points and skis, by covariance and by Monte Carlo.

    Exit codes: 0 done, 2 bad input, 3 the network does not determine its unknowns, 4 a simulation did not converge.

    Example: svev plan config/networks/hill-2.toml
    """
    planned = plan_from(read_description(network))
    try:
        adjusted = adjusted_plan(planned)
        predicted = predict(planned, adjusted)
        with console.progress("samples", samples) as done:
            simulated = simulate(planned, adjusted, samples=samples, seed=_SEED, done=done)
    except NotSolvableError as error:
        console.complain(f"not solvable: {error}")
        raise typer.Exit(_NOT_SOLVABLE) from None
    except NotConvergedError as error:
        console.complain(f"not converged: {error}")
        raise typer.Exit(_NOT_CONVERGED) from None
    if as_json:
        console.print_json(plan_to_json(planned, predicted, simulated, samples))
        return
    for line in plan_table(planned, predicted, simulated):
        console.say(line)
    largest = 100.0 * worst_disagreement(predicted, simulated)
    known = 100.0 / math.sqrt(2.0 * samples)
    console.say(f"\ncovariance and Monte Carlo differ by at most {largest:.1f} %")
    console.say(f"{samples} samples: each simulated sigma is known to {known:.1f} % (one sigma)")
