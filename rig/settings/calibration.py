"""The calibration that a rig file names, changed while the rig runs, and written into the text of the rig file."""

from collections.abc import Collection
from pathlib import Path

import tomlkit

from rig.settings.editing import camera_table, editable
from rig.settings.model import RigSettings


def with_calibration(rig: RigSettings, path: Path, cameras: Collection[str]) -> RigSettings:
    """The rig with another calibration.

    Args:
        rig: the rig.
        path: of the result file.
        cameras: that were calibrated with the regions that they have now.
    """
    anew = tuple(
        camera.model_copy(update={"calibrated_region": None}) if camera.name in cameras else camera
        for camera in rig.cameras
    )
    return rig.model_copy(update={"calibration": path, "cameras": anew})


def written_calibration(text: str, path: Path, cameras: Collection[str]) -> str:
    """The text of a rig file with another calibration; everything else in it stays as it is.

    Args:
        text: of the rig file (TOML).
        path: of the result file; it stands there as it is.
        cameras: as above.

    Raises:
        BadInputError: the text is not TOML, or lacks a camera.
    """
    document = editable(text)
    document["calibration"] = str(path)
    for name in cameras:
        camera_table(document, name).pop("calibrated_region", None)
    return tomlkit.dumps(document)
