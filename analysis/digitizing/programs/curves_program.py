"""The program that computes curves from marks, started by `analysis.digitizing.programs.curves`."""

from pathlib import Path
from typing import TYPE_CHECKING

from rig.api.digitizing import HandCurves
from rig.background.errands import run_errand
from rig.background.program import Teller

if TYPE_CHECKING:
    from analysis.digitizing.programs.curves import CurvesOrder


def _compute(order: "CurvesOrder", _: Path, __: Teller) -> HandCurves:
    from analysis.digitizing.marks.effective import effective  # noqa: PLC0415 - loaded with our priority
    from analysis.digitizing.programs.curves import curves_of  # noqa: PLC0415
    from analysis.procedure.jump import compute_jump  # noqa: PLC0415

    measured = effective(order.automatic, order.marks, order.times)
    jumps = [compute_jump(jump, measured, order.system).jump for jump in measured.jumps]
    said = tuple(each for jump in jumps for each in jump.verdict.said)
    return HandCurves(state="done", revision=order.revision, said=said, curves=curves_of(jumps))


def main() -> None:
    """Do one errand."""
    run_errand(_compute)


if __name__ == "__main__":
    main()
