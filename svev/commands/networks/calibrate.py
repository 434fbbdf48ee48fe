"""`svev calibrate`: interior orientations from images of a 3D frame."""

from pathlib import Path
from typing import Annotated, Any

import typer

from photogrammetry.network.file import read_network
from photogrammetry.procedures.calibration import calibrate as calibrate_network
from photogrammetry.reports.adjusted import Wishes
from photogrammetry.reports.procedures import calibration_lines, calibration_report, calibration_to_json
from photogrammetry.reports.result_extras import named_points
from svev.commands.networks.delivery import (
    CovarianceOption,
    DetectableOption,
    JsonOption,
    OutputOption,
    ReportOption,
    as_record,
    deliver,
    origin,
    refuse_overwriting,
    with_extras,
    written,
)


def calibrate(
    context: typer.Context,
    network: Annotated[Path, typer.Argument(help="network file (svev-network/1) with images of the frame")],
    output: OutputOption,
    detectable: DetectableOption = False,
    covariance: CovarianceOption = None,
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Calibrate cameras: free adjustment of a frame of unknown targets with self-calibration.

    Exit codes: 0 calibrated, 2 bad input, 3 not solvable (the result says what is missing), 4 not converged, or refused
    because the images contradict each other.

    Example: svev calibrate frame.json -o cameras.json --report calibration
    """
    refuse_overwriting(output, network)
    given = read_network(network)
    came_from = origin(context, network=network)
    named_points(given, covariance or (), "--covariance")  # before anything is computed

    def calibrated() -> tuple[dict[str, Any], list[str]]:
        calibration = calibrate_network(given)
        adjustment = calibration.outcome.adjustment
        result = with_extras(calibration_to_json(calibration), adjustment, detectable=detectable, covariance=covariance)
        wishes = Wishes(detectable, covariance or ())
        told = written(lambda: as_record(calibration_report(calibration, wishes), came_from, result, output), report)
        return result, [*calibration_lines(calibration), *told]

    deliver(calibrated, output, as_json=as_json)
