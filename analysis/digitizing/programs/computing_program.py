"""The program that computes one jump from marks, started by `analysis.digitizing.programs.computing`."""

from pathlib import Path
from typing import TYPE_CHECKING

from analysis.procedure.steps import STEPS
from rig.background.errands import run_errand
from rig.background.messages import Progress
from rig.background.program import Teller

if TYPE_CHECKING:
    from analysis.digitizing.programs.computing import ComputedJump, JumpOrder


def _compute(order: "JumpOrder", folder: Path, tell: Teller) -> "ComputedJump":
    from analysis.digitizing.programs.computing import RESULT, ComputedJump  # noqa: PLC0415 - loaded with our priority
    from analysis.procedure.analyze import analyze  # noqa: PLC0415
    from analysis.procedure.result_folder import write_folder  # noqa: PLC0415

    def progress(step: str, share: float) -> None:
        tell(Progress(step=STEPS[step], share=share), last=share in {0.0, 1.0})

    found = analyze(order.log, order.source, by_hand=order.measurements, images=False, progress=progress)
    files = write_folder(found, order.log, folder / RESULT, progress=progress)
    said = tuple(each for jump in found.result.jumps for each in jump.verdict.said)
    return ComputedJump(said, tuple(sorted(file.name for file in files)))


def main() -> None:
    """Do one errand."""
    run_errand(_compute)


if __name__ == "__main__":
    main()
