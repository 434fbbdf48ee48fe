"""`svev calibrate`: interior orientations from images of a 3D frame, measured already or found in pictures."""

from pathlib import Path
from typing import Annotated

import typer

from photogrammetry.network.file import read_network
from photogrammetry.procedures.calibration import calibrate as calibrate_network
from photogrammetry.reports.adjusted import Wishes
from photogrammetry.reports.procedures import calibration_lines, calibration_report, calibration_to_json
from photogrammetry.reports.result_extras import named_points
from rig.errors import BadInputError
from svev.commands.networks.delivery import (
    CovarianceOption,
    DetectableOption,
    JsonOption,
    ReportOption,
    as_record,
    deliver,
    origin,
    refuse_overwriting,
    with_extras,
    written,
)
from svev.commands.networks.layout import BoardOption, SquareOption, TargetOption, columns_and_rows
from svev.overwriting import ForceOption, in_report, refuse_existing


def calibrate(
    context: typer.Context,
    network: Annotated[
        list[Path],
        typer.Argument(
            metavar="NETWORK.json|FOLDER|LOG...",
            help="network file (svev-network/1) with images of the frame; with --pictures: folders of pictures, each "
            "named as its camera, or logs",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--out",
            metavar="FILE|DIR",
            help="result file (svev-adjustment/1) to write; with --pictures the folder for calibration.json, "
            "network.json and the report (calibration, if left out)",
        ),
    ] = None,
    pictures: Annotated[bool, typer.Option("--pictures", help="find the targets of svev target in pictures")] = False,
    board: BoardOption = "9x6",
    square_mm: SquareOption = 30.0,
    target_mm: TargetOption = 80.0,
    distance: Annotated[
        list[str] | None,
        typer.Option(
            "--distance",
            metavar="A,B,MM",
            help="measured distance of two corners, for the scale; a fourth value: sigma, mm; repeatable",
        ),
    ] = None,
    flat: Annotated[bool, typer.Option("--flat", help="the board is flat (glass, or checked with a ruler)")] = False,
    camera: Annotated[
        str | None, typer.Option("--camera", metavar="NAME", help="name of the camera, if its folder has another")
    ] = None,
    detectable: DetectableOption = False,
    covariance: CovarianceOption = None,
    report: ReportOption = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Calibrate cameras: principal distance, principal point and distortion, each with its sigma.

    With --pictures the targets of svev target are found in pictures or logs, and the last lines say whether it is good
    enough, or which pictures to take. Else a network file is adjusted: free, with self-calibration.

    Exit codes: 0 calibrated, 2 bad input, 3 not solvable (the result says what is missing), 4 not converged, or refused
    because the images contradict each other.

    Example: svev calibrate --pictures K1 K2 K3 -o calibration
    """
    if pictures:
        # Imported here: whoever has a network needs no image processing.
        from analysis.targets.pattern import Layout  # noqa: PLC0415
        from svev.commands.networks.calibrate_pictures import from_pictures  # noqa: PLC0415

        if detectable or covariance or report:
            raise BadInputError(
                "--pictures writes its report into the folder of -o; for --detectable, --covariance or --report call "
                "svev calibrate again with the network.json in it"
            )
        layout = Layout(*columns_and_rows(board), square_mm, target_mm)
        from_pictures(
            context,
            network,
            output or Path("calibration"),
            layout,
            distance or (),
            camera,
            flat=flat,
            force=force,
            as_json=as_json,
        )
        return
    if any(path.is_dir() or path.suffix.lower() == ".mcap" for path in network):
        raise BadInputError(f"{network[0]}: holds pictures and is no network file; add --pictures")
    if len(network) != 1 or output is None:
        raise BadInputError("name one network file and -o RESULT.json, or pictures with --pictures")
    refuse_overwriting(output, network[0])
    refuse_existing(output, *in_report(report), force=force)
    _from_network(context, network[0], output, report, covariance, detectable=detectable, as_json=as_json)


def _from_network(
    context: typer.Context,
    network: Path,
    output: Path,
    report: Path | None,
    covariance: list[str] | None,
    *,
    detectable: bool,
    as_json: bool,
) -> None:
    given = read_network(network)
    came_from = origin(context, network=network)
    named_points(given, covariance or (), "--covariance")  # before anything is computed

    def calibrated() -> tuple[dict[str, object], list[str]]:
        calibration = calibrate_network(given)
        adjustment = calibration.outcome.adjustment
        result = with_extras(calibration_to_json(calibration), adjustment, detectable=detectable, covariance=covariance)
        wishes = Wishes(detectable, covariance or ())
        told = written(lambda: as_record(calibration_report(calibration, wishes), came_from, result, output), report)
        return result, [*calibration_lines(calibration), *told]

    deliver(calibrated, output, as_json=as_json)
