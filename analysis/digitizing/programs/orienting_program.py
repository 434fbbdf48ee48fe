"""The program that orients the cameras of one log, started by `analysis.digitizing.programs.orienting`."""

from pathlib import Path
from typing import TYPE_CHECKING

from rig.background.errands import run_errand
from rig.background.program import Teller
from rig.errors import BadInputError, SvevError
from rig.phrase import phrase, plain

if TYPE_CHECKING:
    from analysis.digitizing.programs.orienting import OrientedCameras, OrientingOrder


def _orient(order: "OrientingOrder", _: Path, __: Teller) -> "OrientedCameras":
    from analysis.cameras.frames import LogFrames  # noqa: PLC0415 - its libraries start their threads with our priority
    from analysis.digitizing.programs.clicked_balls import clicks_can_help, orient_by_clicks  # noqa: PLC0415
    from analysis.digitizing.programs.orienting import OrientedCameras  # noqa: PLC0415
    from analysis.procedure.log_facts import log_facts  # noqa: PLC0415
    from analysis.procedure.orienting import oriented  # noqa: PLC0415
    from analysis.scene.static_image import static_images  # noqa: PLC0415

    sizes = {name: camera.size for name, camera in log_facts(order.log).cameras.items()}
    if order.marks is None:
        try:
            found = oriented(static_images(order.log), order.source, LogFrames(order.log))
        except SvevError as error:
            if not clicks_can_help(sizes, order.source):
                raise
            text = "{why}; or click four or more balls in each image, and orient by them"
            raise BadInputError(phrase("hand_or_click", text, why=error.said)) from None
        findings = [*found.scene.messages, *(move.said for move in found.steadiness.moved)]
        return OrientedCameras(found.scene.system, tuple(findings), by_clicks=False)
    system, notes = orient_by_clicks(sizes, order.source, order.marks)
    return OrientedCameras(system, tuple(map(plain, notes)), by_clicks=True)


def main() -> None:
    """Do one errand."""
    run_errand(_orient)


if __name__ == "__main__":
    main()
