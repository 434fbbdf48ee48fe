"""Says what a file is that is given in place of another one: all files of ours name their format."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from rig.errors import BadInputError
from rig.settings.file_kinds import refuse_other

NETWORK: Final = "svev-network/1"
#: Results, which `svev calibrate`, `orient` and `adjust` write.
RESULT: Final = "svev-adjustment/1"
_KINDS: Final = {
    NETWORK: "a network or survey",
    RESULT: "a result of svev calibrate, orient or adjust",
    "svev-truth/1": "the truth of a simulated recording",
    "svev-jumper/1": "a measured recording",
    "svev-measurements/1": "measurements of a jumper",
    "svev-board/2": "a board or frame of svev target",
}
_REMEDIES: Final = {
    (RESULT, NETWORK): "of a calibration and the balls a survey is made by: svev network import {path} balls.csv -o "
    "survey.json",
    (NETWORK, RESULT): "a survey is given as --survey, and svev orient makes poses of a network",
}


def require_format(data: Mapping[str, Any], wanted: str, path: Path | str) -> None:
    """Refuse a file that is another one of ours; what it says wrongly beside that is of no interest.

    Args:
        data: content of the file.
        wanted: format that it should have.
        path: of the file, for messages.

    Raises:
        BadInputError: it has another known format, or is a file that people write.
    """
    refuse_other(data, _KINDS[wanted], path)
    given = data.get("format")
    if isinstance(given, str) and given != wanted and given in _KINDS:
        remedy = _REMEDIES.get((given, wanted), "name another file").format(path=path)
        raise BadInputError(f"{path}: is {_KINDS[given]}, and {_KINDS[wanted]} is wanted; {remedy}")
