"""`svev adjust`: adjust any photogrammetric network."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from photogrammetry.adjustment.result_extras import in_datum_of, joint_covariance, named_points, with_detectable
from photogrammetry.adjustment.result_file import outcome_to_json
from photogrammetry.adjustment.run import adjust as adjust_network
from photogrammetry.adjustment.state import state_of
from photogrammetry.adjustment.summary import summarise
from photogrammetry.network import Network
from photogrammetry.network_file import read_network
from photogrammetry.protocol.adjusted import adjusted_sections
from photogrammetry.protocol.document import Protocol
from photogrammetry.protocol.page import write_protocol
from photogrammetry.start_values.search import complete
from svev.commands.delivery import JsonOption, OutputOption, ReportOption, deliver
from svev.commands.weights import PaperOption, ReweightOption, with_weights


def adjust(
    network: Annotated[Path, typer.Argument(help="network file (svev-network/1)")],
    output: OutputOption,
    reweight: ReweightOption = False,
    paper: PaperOption = False,
    snoop: Annotated[
        bool,
        typer.Option("--snoop", help="take the worst locatable gross error out, adjust again, until there is none"),
    ] = False,
    detectable: Annotated[
        bool, typer.Option("--detectable", help="give the smallest error of each observation that would be found")
    ] = False,
    covariance: Annotated[
        list[str] | None,
        typer.Option("--covariance", help="give the joint covariance of the points so called (* and ?); repeatable"),
    ] = None,
    datum: Annotated[
        list[str] | None,
        typer.Option("--datum", help="give the sigmas of a free network in the datum of these points; repeatable"),
    ] = None,
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Adjust a network of images: bundle adjustment with covariance, tests and variance components.

    Exit codes: 0 adjusted, 2 bad input, 3 not solvable (what is missing stands in the result), 4 not converged.

    Example: svev adjust network.json -o result.json
    """
    given = with_weights(read_network(network), reweight=reweight, paper=paper)
    wishes = _Wishes(snoop, detectable, tuple(covariance or ()), tuple(datum or ()), report)
    deliver(lambda: _adjusted(given, wishes), output, as_json=as_json)


@dataclass(frozen=True, slots=True)
class _Wishes:
    """The options that do not change the network."""

    snoop: bool
    detectable: bool
    covariance: tuple[str, ...]
    datum: tuple[str, ...]
    report: Path | None


def _adjusted(network: Network, wishes: _Wishes) -> tuple[dict[str, Any], list[str]]:
    named_points(network, wishes.datum, "--datum")  # before anything is computed
    named_points(network, wishes.covariance, "--covariance")
    poses = all(image.position is not None and image.rotation is not None for image in network.images)
    points = all(point.xyz is not None for point in network.points)
    started = network if poses and points else complete(network)
    outcome = adjust_network(network, state_of(started), snoop=wishes.snoop)
    if wishes.datum:
        outcome = in_datum_of(outcome, wishes.datum)
    lines = summarise(outcome)
    if wishes.report is not None:
        text, page = write_protocol(Protocol("Adjustment", adjusted_sections(outcome)), wishes.report)
        lines.append(f"protocol in {text} and {page}")
    result = outcome_to_json(outcome)
    if wishes.detectable:
        result = with_detectable(result, outcome.adjustment)
    if wishes.covariance:
        result["joint_covariance"] = joint_covariance(outcome.adjustment, wishes.covariance)
    return result, lines
