"""`svev adjust`: adjust any photogrammetric network."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from photogrammetry.adjustment.result_file import outcome_to_json
from photogrammetry.adjustment.run import adjust as adjust_network
from photogrammetry.adjustment.state import state_of
from photogrammetry.adjustment.summary import summarise
from photogrammetry.network import Network, Reweight
from photogrammetry.network_file import read_network
from photogrammetry.protocol.adjusted import adjusted_sections
from photogrammetry.protocol.document import Protocol
from photogrammetry.protocol.page import write_protocol
from photogrammetry.start_values.search import complete
from svev.commands.delivery import deliver


def adjust(
    network: Annotated[Path, typer.Argument(help="network file (svev-network/1)")],
    output: Annotated[Path, typer.Option("-o", "--output", help="result file (svev-adjustment/1) to write")],
    paper: Annotated[bool, typer.Option("--paper", help="estimate the weights by D5 as the paper prints it")] = False,
    snoop: Annotated[
        bool,
        typer.Option("--snoop", help="take the worst locatable gross error out, adjust again, until there is none"),
    ] = False,
    report: Annotated[
        Path | None, typer.Option("--report", help="folder for the protocol, as text and as a page")
    ] = None,
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
    deliver(lambda: _adjusted(given, report, snoop=snoop), output, as_json=as_json)


def _adjusted(network: Network, report: Path | None, *, snoop: bool) -> tuple[dict[str, Any], list[str]]:
    poses = all(image.position is not None and image.rotation is not None for image in network.images)
    points = all(point.xyz is not None for point in network.points)
    started = network if poses and points else complete(network)
    outcome = adjust_network(network, state_of(started), snoop=snoop)
    lines = summarise(outcome)
    if report is not None:
        text, page = write_protocol(Protocol("Adjustment", adjusted_sections(outcome)), report)
        lines.append(f"protocol in {text} and {page}")
    return outcome_to_json(outcome), lines
