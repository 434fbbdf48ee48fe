"""`svev adjust`: adjust any photogrammetric network."""

from pathlib import Path
from typing import Annotated

import typer

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.run import Outcome, settled
from photogrammetry.adjustment.solution.usability import is_unusable
from photogrammetry.network.file import read_network
from photogrammetry.network.model import Network
from photogrammetry.procedures.doubtful_poses import refuse_ambiguous
from photogrammetry.procedures.minima import adjust_least
from photogrammetry.procedures.stages import snoop_network
from photogrammetry.reports.adjusted import Wishes, adjusted_sections
from photogrammetry.reports.document import Report
from photogrammetry.reports.result_extras import in_datum_of, named_points
from photogrammetry.reports.result_file import outcome_to_json
from photogrammetry.reports.summary import summarise
from photogrammetry.start_values.search import complete
from svev import console
from svev.commands.networks.delivery import (
    CovarianceOption,
    DetectableOption,
    JsonOption,
    OutputOption,
    PaperOption,
    ReportOption,
    ReweightOption,
    as_record,
    deliver,
    origin,
    refuse_overwriting,
    with_extras,
    with_weights,
    written,
)
from svev.overwriting import ForceOption, in_report, refuse_existing


def adjust(
    context: typer.Context,
    network: Annotated[Path, typer.Argument(metavar="NETWORK.json", help="network file (svev-network/1)")],
    output: OutputOption,
    reweight: ReweightOption = False,
    paper: PaperOption = False,
    snoop: Annotated[
        bool,
        typer.Option("--snoop", help="take out the worst locatable gross error and adjust again, until there is none"),
    ] = False,
    detectable: DetectableOption = False,
    covariance: CovarianceOption = None,
    datum: Annotated[
        list[str] | None,
        typer.Option(
            "--datum", metavar="NAME", help="give the sigmas of a free network in the datum of these points; repeatable"
        ),
    ] = None,
    report: ReportOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Adjust a network of images: bundle adjustment with covariance, tests and variance components.

    Exit codes: 0 adjusted, 2 bad input, 3 not solvable (the result says what is missing), 4 not converged, or with
    --snoop refused because the data contradict each other. Without --snoop such data give a result that says so.

    Example: svev adjust network.json -o result.json
    """
    refuse_overwriting(output, network)
    refuse_existing(output, *in_report(report), force=force)
    given = with_weights(read_network(network), reweight=reweight, paper=paper)
    came_from = origin(context, network=network)
    named_points(given, datum or (), "--datum")  # before anything is computed
    named_points(given, covariance or (), "--covariance")

    def adjusted() -> tuple[dict[str, object], list[str]]:
        outcome = snoop_network(given) if snoop else adjust_least(given, state_of(_started(given)), given)
        outcome = settled(outcome)
        refuse_ambiguous(given, outcome.adjustment)
        if datum:
            outcome = in_datum_of(outcome, datum)
        result = with_extras(outcome_to_json(outcome), outcome.adjustment, detectable=detectable, covariance=covariance)
        if is_unusable(outcome.adjustment):  # the contract wants the result all the same (decision 0044)
            console.complain(f"{network}: the observations contradict each other; do not use this result, try --snoop")
        wishes = Wishes(detectable, covariance or ())
        told = written(lambda: as_record(_report(outcome, wishes), came_from, result, output), report)
        return result, [*summarise(outcome), *told]

    deliver(adjusted, output, as_json=as_json)


def _report(outcome: Outcome, wishes: Wishes) -> Report:
    return Report("Adjustment", adjusted_sections(outcome, wishes))


def _started(network: Network) -> Network:
    """The network with start values; unchanged if it gives all of them."""
    poses = all(image.position is not None and image.rotation is not None for image in network.images)
    points = all(point.xyz is not None for point in network.points)
    return network if poses and points else complete(network)
