"""The program that computes a calibration from the kept pictures, as `svev calibrate` does; started by `helper`."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.background.program import Teller, serve
from rig.phrase import as_plain
from service.calibrating.folder import PICTURES, RESULT

if TYPE_CHECKING:
    from analysis.targets.calibrating import PictureCalibration


def _compute(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Calibrate with the pictures in `folder` of targets of `layout`; writes network, result and protocol into it."""
    from analysis.targets.calibrating import calibrate_pictures  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.targets.pattern import Layout  # noqa: PLC0415
    from analysis.targets.pictures import read_pictures  # noqa: PLC0415
    from analysis.targets.report import report, to_json  # noqa: PLC0415
    from photogrammetry.network.file_writer import write_network  # noqa: PLC0415
    from photogrammetry.reports.document import write_report  # noqa: PLC0415
    from photogrammetry.reports.record.provenance import provenance, signature  # noqa: PLC0415
    from photogrammetry.reports.result_file import write_result  # noqa: PLC0415

    folder, layout = Path(asked["folder"]), Layout(**asked["layout"])
    pictures, left_out = read_pictures([folder / PICTURES], layout, done=lambda count: tell(pictures=count))
    tell(last=True, pictures=len(pictures))
    made = calibrate_pictures(pictures, layout)
    tell(last=True, pictures=len(pictures))
    network = folder / "network.json"
    write_network(made.network, network)
    result = to_json(made)
    result["notes"] = [*left_out, *result["notes"]]
    words = (
        f"svev calibrate --pictures {PICTURES} --board {layout.columns}x{layout.rows} --square-mm {layout.board_mm:g}"
    )
    origin = provenance(words, {"network": network}).with_result(result, folder / RESULT)
    whole = report(made)
    write_report(replace(whole, sections=(origin.section(), *whole.sections, signature())), folder)
    write_result(result, folder / RESULT)
    return {"lenses": [_said(made, i) for i in range(len(made.verdicts))]}


def _said(made: "PictureCalibration", number: int) -> dict[str, Any]:
    """The verdict on a camera, and the mean residuals over its picture: x, y in the pixel frame, dx, dy; px."""
    from photogrammetry.reports.drawing.residuals import cell_means  # noqa: PLC0415 - as above

    verdict, a = made.verdicts[number], made.calibration.outcome.adjustment
    rows = a.problem.camera == number
    places, means = cell_means(a.problem.xy[rows], a.image_residuals()[rows])
    width, height = next(each.sight.size for each in made.pictures if each.camera == verdict.camera)
    return {
        "camera": verdict.camera,
        "good": verdict.good,
        "verdict": as_plain(verdict.said),
        "advice": [as_plain(each) for each in verdict.advice],
        "residuals": [
            (round((width - 1) / 2 + x, 1), round((height - 1) / 2 - y, 1), round(dx, 4), round(-dy, 4))
            for (x, y), (dx, dy) in zip(places.tolist(), means.tolist(), strict=True)
        ],
    }


if __name__ == "__main__":
    serve(_compute)
