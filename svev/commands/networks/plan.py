"""`svev plan`: predict how accurate a network will be."""

from pathlib import Path
from typing import Annotated, Final

import typer

from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network.file_writer import write_network
from photogrammetry.planning.description import read_description
from photogrammetry.planning.monte_carlo import SAMPLES, simulate
from photogrammetry.planning.plan import Plan, hidden, plan_from
from photogrammetry.planning.prediction import adjusted_plan, predict
from photogrammetry.planning.simulated import simulated_network
from photogrammetry.reports.document import as_text
from photogrammetry.reports.plan import plan_report, plan_to_json
from svev import console
from svev.commands.networks.delivery import NOT_CONVERGED, NOT_SOLVABLE, refuse_overwriting, written
from svev.overwriting import ForceOption, in_report, refuse_existing
from svev.spreading import SchedulerOption, WorkersOption, spread

_SEED: Final = 2009


def plan(
    network: Annotated[
        Path, typer.Argument(metavar="PLAN.toml", help="planned network (TOML), e.g. config/networks/hill-1.toml")
    ],
    samples: Annotated[
        int, typer.Option(metavar="N", min=100, max=100_000, help="repetitions of the Monte-Carlo simulation")
    ] = SAMPLES,
    report: Annotated[
        Path | None,
        typer.Option("--report", metavar="DIR", help="folder for the report, as text and as a page with drawings"),
    ] = None,
    simulated_file: Annotated[
        Path | None,
        typer.Option(
            "--simulate",
            metavar="FILE",
            help="instead of predicting, write a network with errors (svev-network/1), as it would be measured",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="of the random errors")] = _SEED,
    workers: WorkersOption = None,
    scheduler: SchedulerOption = None,
    force: ForceOption = False,
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object instead of the tables")] = False,
) -> None:
    """Predict the accuracy of cameras, jumper points, skis and body angles, by covariance and by Monte Carlo.

    With --workers or --scheduler the simulation runs on other processors; its figures stay the same to the last bit.

    Exit codes: 0 done, 2 bad input, 3 the network does not determine its unknowns, 4 a simulation did not converge,
    6 the Dask scheduler is gone.

    Example: svev plan config/networks/hill-2.toml --report plan
    """
    if simulated_file is not None:
        refuse_overwriting(simulated_file, network)
    refuse_existing(simulated_file, *in_report(report), force=force)
    planned = plan_from(read_description(network))
    if simulated_file is not None:
        _simulate(planned, seed, simulated_file, as_json=as_json)
        return
    try:
        adjusted = adjusted_plan(planned)
        predicted = predict(planned, adjusted)
        with spread(workers, scheduler) as each, console.progress("samples", samples) as done:
            simulated = simulate(planned, adjusted, samples=samples, seed=seed, done=done, each=each)
    except NotSolvableError as error:
        console.complain(f"not solvable: {error}")
        raise typer.Exit(NOT_SOLVABLE) from None
    except NotConvergedError as error:
        console.complain(f"not converged: {error}")
        raise typer.Exit(NOT_CONVERGED) from None
    tables = plan_report(planned, adjusted, predicted, simulated, samples)
    unseen = hidden(planned)
    if as_json:
        more = {"hidden": unseen} if planned.obstacles else {}
        console.print_json(plan_to_json(planned, predicted, simulated, samples) | more)
    else:
        console.say_text(as_text(tables))
        for image, names in unseen.items():
            console.say(f"hidden from {image}: {', '.join(names)}")
    for line in written(lambda: tables, report):
        console.say(line, aside=as_json)


def _simulate(planned: Plan, seed: int, path: Path, *, as_json: bool) -> None:
    """Write the network as it would be measured, and say what it holds."""
    made = simulated_network(planned, seed)
    write_network(made, path)
    counts = {"images": len(made.images), "points": len(made.points), "observations": len(made.observations.xy)}
    if as_json:
        console.print_json({"network": str(path), "seed": seed, **counts})
        return
    console.say(f"network with errors in {path}: " + ", ".join(f"{n} {what}" for what, n in counts.items()))
