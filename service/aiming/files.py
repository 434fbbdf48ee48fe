"""The files that tell where the cameras should show the balls."""

from pathlib import Path
from typing import Final

from rig.settings.model import RigSettings

#: In the folder of the recordings: where the cameras showed the balls when they were oriented last.
ORIENTATION: Final = ".svev-orientation.json"


def ball_files(rig: RigSettings, folder: Path) -> list[Path]:
    """Last orientation, plan, survey and calibration, as far as the rig file names them; they need not be there.

    Args:
        rig: the rig.
        folder: of the recordings.
    """
    analysis = rig.analysis
    given = [] if analysis is None else [analysis.survey, analysis.calibration]
    return [file for file in (folder / ORIENTATION, rig.plan, *given) if file is not None]
