"""The rig file in use: reads the calibration that it names, and writes into it what was changed while the rig runs."""

import os
from collections.abc import Callable
from pathlib import Path

from rig.errors import StorageError
from rig.host.disk import replace_file
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from rig.settings.strict_toml import read_text
from rig.transport.recorder_commands import Calibration


def keep(path: Path, edit: Callable[[str], str], by_hand: Phrase) -> None:
    """Edit the rig file, as it is by then: what else was edited in it stays.

    Args:
        path: of the rig file.
        edit: makes the new text of the present one.
        by_hand: the same as an order to a person, if the file cannot be written.

    Raises:
        BadInputError: the file has become unreadable.
        StorageError: it cannot be written.
    """
    text = edit(read_text(path, "TOML", "the rig file in use"))
    try:
        # Renewing a file asks for rights to its folder alone. Here those of the file decide, as its owner expects.
        os.close(os.open(path, os.O_WRONLY | os.O_CLOEXEC))
        replace_file(path, text.encode(), links=True)
    except OSError as error:
        text = "{path}: cannot be written ({why}); {by_hand}, or a restart of the service loses the change"
        why = error.strerror or str(error)
        raise StorageError(phrase("why_not_kept", text, path=str(path), why=why, by_hand=by_hand)) from error


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
