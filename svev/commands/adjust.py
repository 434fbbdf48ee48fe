"""`svev adjust`: adjust any photogrammetric network."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from photogrammetry.adjustment.result_file import failure_to_json, outcome_to_json, write_result
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.run import adjust as adjust_network
from photogrammetry.adjustment.state import state_of
from photogrammetry.adjustment.summary import summarise
from photogrammetry.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network import Network, Reweight
from photogrammetry.network_file import read_network
from photogrammetry.start_values import complete
from svev import console

_NOT_SOLVABLE: Final = 3
_NOT_CONVERGED: Final = 4


def adjust(
    network: Annotated[Path, typer.Argument(help="network file (svev-network/1)")],
    output: Annotated[Path, typer.Option("-o", "--output", help="result file (svev-adjustment/1) to write")],
    paper: Annotated[bool, typer.Option("--paper", help="estimate the weights by D5 as the paper prints it")] = False,
    snoop: Annotated[
        bool,
        typer.Option("--snoop", help="take the worst locatable gross error out, adjust again, until there is none"),
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="end with one JSON object: the result without its lists")
    ] = False,
) -> None:
    """Adjust a network of images: bundle adjustment with covariance, tests and variance components.

    Exit codes: 0 adjusted, 2 bad input, 3 not solvable (what is missing stands in the result), 4 not converged.

    Example: svev adjust network.json -o result.json
    """
    given = read_network(network)
    if paper:
        given = replace(given, reweight=Reweight.PAPER)
    code = 0
    try:
        outcome = _adjusted(given, snoop=snoop)
        result, lines = outcome_to_json(outcome), summarise(outcome)
    except NotSolvableError as error:
        code, result = _NOT_SOLVABLE, failure_to_json(f"not solvable: {error}", error.defects)
        lines = ["not solvable", *(f"  {defect.message}" for defect in error.defects)]
    except NotConvergedError as error:
        code, result, lines = _NOT_CONVERGED, failure_to_json(f"not converged: {error}"), [f"not converged: {error}"]
    write_result(result, output)
    for line in lines:
        console.say(line, aside=as_json)
    if as_json:
        console.print_json(_without_lists(result))
    else:
        console.say(f"result in {output}")
    if code:
        raise typer.Exit(code)


def _adjusted(network: Network, *, snoop: bool) -> Outcome:
    poses = all(image.position is not None and image.rotation is not None for image in network.images)
    points = all(point.xyz is not None for point in network.points)
    started = network if poses and points else complete(network)
    return adjust_network(network, state_of(started), snoop=snoop)


def _without_lists(result: dict[str, Any]) -> dict[str, Any]:
    """What fits on a screen; the rest stands in the file."""
    return {key: value for key, value in result.items() if key not in ("observations", "points", "images")}
