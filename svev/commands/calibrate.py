"""`svev calibrate`: interior orientations from images of a 3D frame."""

from pathlib import Path
from typing import Annotated, Any

import typer

from photogrammetry.network.file import read_network
from photogrammetry.network.model import Network
from photogrammetry.procedures.calibration import calibrate as calibrate_network
from photogrammetry.reports.procedures import calibration_lines, calibration_report, calibration_to_json
from svev.commands.delivery import JsonOption, OutputOption, ReportOption, deliver, refuse_overwriting, written


def calibrate(
    network: Annotated[Path, typer.Argument(help="network file (svev-network/1) with images of the frame")],
    output: OutputOption,
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
    deliver(lambda: _calibrated(given, report), output, as_json=as_json)


def _calibrated(network: Network, report: Path | None) -> tuple[dict[str, Any], list[str]]:
    calibration = calibrate_network(network)
    lines = calibration_lines(calibration)
    lines += written(lambda: calibration_report(calibration), report)
    return calibration_to_json(calibration), lines
