"""The calibration that is written into the logs of a rig."""

from rig.settings.model import RigSettings
from rig.transport.recorder_commands import Calibration


def read_calibration(rig: RigSettings) -> Calibration | None:
    """Read the calibration file that the rig file names; None if it names none.

    Raises:
        BadInputError: the calibration file is missing or wrong.
    """
    if rig.calibration is None:
        return None
    # Imported here because photogrammetry and its libraries take memory and a second to load.
    from analysis.export.camera_calibration import calibration_for_log  # noqa: PLC0415

    return calibration_for_log(rig.calibration, rig.cameras)
