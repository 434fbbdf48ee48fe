"""`svev calibrate`: interior orientations from images of a 3D frame."""

from pathlib import Path
from typing import Annotated, Any

import typer

from photogrammetry.network import Network
from photogrammetry.network_file import read_network
from photogrammetry.procedures.calibration import calibrate as calibrate_network
from photogrammetry.protocol.calibration import calibration_lines, calibration_protocol, calibration_to_json
from photogrammetry.protocol.page import write_protocol
from svev.commands.delivery import JsonOption, OutputOption, ReportOption, deliver


def calibrate(
    network: Annotated[Path, typer.Argument(help="network file (svev-network/1) with images of the frame")],
    output: OutputOption,
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Calibrate cameras: free adjustment of a frame of unknown targets with self-calibration.

    Exit codes: 0 calibrated, 2 bad input, 3 not solvable (what is missing stands in the result), 4 not converged.

    Example: svev calibrate frame.json -o cameras.json --report protocol
    """
    given = read_network(network)
    deliver(lambda: _calibrated(given, report), output, as_json=as_json)


def _calibrated(network: Network, report: Path | None) -> tuple[dict[str, Any], list[str]]:
    calibration = calibrate_network(network)
    lines = calibration_lines(calibration)
    if report is not None:
        text, page = write_protocol(calibration_protocol(calibration), report)
        lines.append(f"protocol in {text} and {page}")
    return calibration_to_json(calibration), lines
