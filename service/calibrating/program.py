"""The programs of the calibration helper: one finds targets in live pictures, the other computes a calibration."""

import os
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from rig.api.calibrating import CalibratedLens, CalibratingOrder
from rig.background.messages import End
from rig.background.program import Teller, serve
from rig.transport.preview import PreviewSlot
from service.calibrating.folder import PICTURES, RESULT
from service.calibrating.messages import Compute, Computed, Find, stated

if TYPE_CHECKING:
    from analysis.targets.calibrating import PictureCalibration
    from analysis.targets.pattern import Layout

#: The recorder goes on copying images for so long after each request.
_LEASE_S: Final = 3.0
_POLL_S: Final = 0.02
#: As the live analysis has it: recorder and grabbers come first. Somebody holds the target still meanwhile, so it does
#: not wait until nobody else wants the processor; while a recording runs it stands still.
_NICE: Final = 10


def _find(asked: Find, tell: Teller) -> End:
    os.nice(_NICE)
    import cv2  # noqa: PLC0415 - these start their threads with our low priority

    from service.calibrating.look import Look  # noqa: PLC0415

    cv2.setNumThreads(1)  # the other processors are for cameras and recorder
    look = Look(asked.rig, _layout(asked.printed), asked.folder)
    slot, last = PreviewSlot(asked.fd), 0
    while True:
        slot.want(_LEASE_S)
        newest = slot.newest() not in {0, last}
        if not newest or (image := slot.read()) is None or image.pixels.shape != asked.rig.triplet_shape:
            time.sleep(_POLL_S)
            continue
        last = image.pulse
        tell(look.at(image), last=True)


def _compute(asked: Compute, _: Teller) -> Computed:
    from analysis.targets.calibrating import calibrate_pictures  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.targets.pictures import read_pictures  # noqa: PLC0415
    from analysis.targets.report import report, to_json  # noqa: PLC0415
    from photogrammetry.network.file_writer import write_network  # noqa: PLC0415
    from photogrammetry.reports.document import write_report  # noqa: PLC0415
    from photogrammetry.reports.record.provenance import provenance, signature  # noqa: PLC0415
    from photogrammetry.reports.result_file import write_result  # noqa: PLC0415

    folder, layout = asked.folder, _layout(asked.printed)
    pictures, left_out = read_pictures([folder / PICTURES], layout)
    made = calibrate_pictures(pictures, layout)
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
    return Computed(lenses=tuple(_lens(made, i) for i in range(len(made.verdicts))))


def _layout(printed: CalibratingOrder) -> "Layout":
    from analysis.targets.pattern import Layout  # noqa: PLC0415 - as above

    return Layout(printed.columns, printed.rows, printed.square_mm, printed.target_mm)


def _lens(made: "PictureCalibration", number: int) -> CalibratedLens:
    """The verdict on a camera, and the mean residuals over its picture: x, y in the pixel frame, dx, dy; px."""
    from photogrammetry.reports.drawing.residuals import cell_means  # noqa: PLC0415 - as above

    verdict, a = made.verdicts[number], made.calibration.outcome.adjustment
    rows = a.problem.camera == number
    places, means = cell_means(a.problem.xy[rows], a.image_residuals()[rows])
    width, height = next(each.sight.size for each in made.pictures if each.camera == verdict.camera)
    return CalibratedLens(
        camera=verdict.camera,
        good=verdict.good,
        verdict=stated(verdict.said),
        advice=tuple(stated(each) for each in verdict.advice),
        residuals=tuple(
            (round((width - 1) / 2 + x, 1), round((height - 1) / 2 - y, 1), round(dx, 4), round(-dy, 4))
            for (x, y), (dx, dy) in zip(places.tolist(), means.tolist(), strict=True)
        ),
    )


def main() -> None:
    """Find, or compute."""
    serve({Find: _find, Compute: _compute})


if __name__ == "__main__":
    main()
