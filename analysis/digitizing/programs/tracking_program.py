"""The program that follows things through the images of one log, started by `analysis.digitizing.programs.tracking`."""

from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING

from rig.background.errands import run_errand
from rig.background.messages import Progress
from rig.background.program import Teller

if TYPE_CHECKING:
    from analysis.digitizing.programs.tracking import Followed, TrackingOrder


def _track(order: "TrackingOrder", _: Path, tell: Teller) -> "Followed":
    from analysis.digitizing.following.follow import follow, steps_of  # noqa: PLC0415 - loaded with our priority
    from analysis.digitizing.following.pursuit import Pursuit  # noqa: PLC0415
    from analysis.digitizing.opened_log import OpenedLog  # noqa: PLC0415
    from analysis.digitizing.programs.tracking import Followed  # noqa: PLC0415

    steps, done = steps_of(order.order), count()

    def step() -> None:
        tell(Progress(share=min(1.0, next(done) / steps)))

    pursuit = Pursuit(OpenedLog(order.log), order.system, order.marks, order.measured, order.order, step)
    return Followed(order.order, follow(pursuit))


def main() -> None:
    """Do one errand."""
    run_errand(_track)


if __name__ == "__main__":
    main()
