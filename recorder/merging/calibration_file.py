"""The calibration of a merged log: where the two logs have different ones, one file that is good for all cameras.

Interior orientations belong to a camera each, so those of both files go together. Poses do not: they hold in the frame
of their own adjustment, and no covariance joins those of two. They stay in both files, which the new one holds whole.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from rig.errors import LogDamagedError

_FORMAT: Final = "svev-adjustment/1"


@dataclass(frozen=True, slots=True)
class Attached:
    """The calibration of one log.

    Attributes:
        source: name of the log.
        cameras: the log's cameras, for which it is good.
        content: the file; None: the log has none.
    """

    source: str
    cameras: Sequence[str]
    content: bytes | None


def joined_calibration(parts: Sequence[Attached]) -> bytes | None:
    """The calibration of all cameras: as it was attached if there is only one, else made of both.

    Raises:
        LogDamagedError: one cannot be read, so that it cannot be joined with the other.
    """
    contents = {part.content for part in parts if part.content is not None}
    if len(contents) < len(parts):
        return contents.pop() if contents else None
    results = [_read(part) for part in parts]
    cameras = {
        name: body
        for part, result in zip(parts, results, strict=True)
        for name, body in result.get("cameras", {}).items()
        if name in part.cameras
    }
    joined = {
        "format": _FORMAT,
        "converged": all(result.get("converged", False) for result in results),
        "status": f"interior orientations of {' and '.join(part.source for part in parts)}; poses stand in merged_from",
        "cameras": cameras,
        "merged_from": [{"source": part.source, "result": result} for part, result in zip(parts, results, strict=True)],
    }
    doubtful = [test for result in results if (test := result.get("global_test")) and not test.get("usable", True)]
    return json.dumps(joined | ({"global_test": doubtful[0]} if doubtful else {})).encode() + b"\n"


def _read(part: Attached) -> dict[str, Any]:
    try:
        result = json.loads(part.content or b"")
    except ValueError:
        result = None
    if not isinstance(result, dict) or not isinstance(result.get("cameras", {}), dict):
        raise LogDamagedError(f"{part.source}: its calibration.json cannot be read; look at `svev verify`")
    return result
