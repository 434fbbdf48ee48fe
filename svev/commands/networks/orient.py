"""`svev orient`: poses of the cameras on the hill."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from photogrammetry.network.calibration_file import read_calibration
from photogrammetry.network.file import read_network
from photogrammetry.procedures.calibrated_cameras import with_calibration
from photogrammetry.procedures.orientation import orient as orient_network
from photogrammetry.reports.adjusted import Wishes
from photogrammetry.reports.procedures import orientation_lines, orientation_report, orientation_to_json
from photogrammetry.reports.result_extras import named_points
from svev.commands.networks.delivery import (
    Alternative,
    AlternativeOption,
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


def orient(
    context: typer.Context,
    network: Annotated[
        Path, typer.Argument(metavar="NETWORK.json", help="network file (svev-network/1) with reference points")
    ],
    output: OutputOption,
    calibration: Annotated[
        Path | None,
        typer.Option(
            "--calibration",
            metavar="FILE",
            help="result file of svev calibrate; if left out, the network's own cameras",
        ),
    ] = None,
    alternative: AlternativeOption = Alternative.STATIC,
    moving: Annotated[
        str | None,
        typer.Option("--moving", metavar="PATTERN", help="names of the moving points (* and ?); H* if left out"),
    ] = None,
    uncertain_interior: Annotated[
        bool,
        typer.Option(
            "--uncertain-interior",
            help='interior parameters in "estimate" that have a "sigma" are weighted observations instead of constants',
        ),
    ] = False,
    reweight: ReweightOption = False,
    paper: PaperOption = False,
    detectable: DetectableOption = False,
    covariance: CovarianceOption = None,
    report: ReportOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Estimate the cameras' poses from reference points, with a search for gross errors in three stages.

    Exit codes: 0 oriented, 2 bad input, 3 not solvable (the result says what is missing, or which poses are possible
    where several are), 4 not converged, or refused because images and survey contradict each other.

    Example: svev orient network.json --calibration calibration.json -o poses.json --report orientation
    """
    refuse_overwriting(output, network, calibration)
    refuse_existing(output, *in_report(report), force=force)
    given = read_network(network)
    left_out: list[str] = []
    if calibration is not None:
        given, left_out = with_calibration(given, read_calibration(calibration, given.image_frame))
    given = with_weights(given, reweight=reweight, paper=paper)
    came_from = origin(context, network=network, calibration=calibration)
    named_points(given, covariance or (), "--covariance")  # before anything is computed

    def oriented() -> tuple[dict[str, object], list[str]]:
        orientation = orient_network(given, int(alternative), moving, uncertain_interior=uncertain_interior)
        orientation = replace(orientation, notes=(*left_out, *orientation.notes))
        result = with_extras(
            orientation_to_json(orientation),
            orientation.outcome.adjustment,
            detectable=detectable,
            covariance=covariance,
        )
        wishes = Wishes(detectable, covariance or ())
        told = written(lambda: as_record(orientation_report(orientation, wishes), came_from, result, output), report)
        return result, [*orientation_lines(orientation), *told]

    deliver(oriented, output, as_json=as_json)
