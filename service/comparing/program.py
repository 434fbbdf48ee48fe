"""The program that compares measured jumps, started by `service.comparing.asking`."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from service.background.program import Teller, serve

if TYPE_CHECKING:
    from analysis.comparison.aligned import MeasuredJump


def _compare(asked: dict[str, Any], _: Teller) -> dict[str, Any]:
    """Compare the first two of `groups` of jumps, each with `file`, `jump` and `name`; the others tell the scatter."""
    from analysis.comparison.alignment import align  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.comparison.groups import greatest_differences, group_difference  # noqa: PLC0415

    groups = [[_jump(each) for each in group] for group in asked["groups"]]
    alignment = align([jump for group in groups for jump in group])
    found = group_difference(alignment, [len(group) for group in groups])
    return {
        "different": found.difference.found(),
        "quantities": greatest_differences(found.difference),
        "scatter_jumps": 0 if found.scatter is None else found.scatter.jumps,
        "one_place": alignment.at_one_place,
    }


def _jump(asked: dict[str, Any]) -> "MeasuredJump":
    from analysis.comparison.aligned import measured_jump  # noqa: PLC0415
    from analysis.result.file import read  # noqa: PLC0415

    return measured_jump(read(Path(asked["file"])), asked["jump"], asked["name"])


if __name__ == "__main__":
    serve(_compare)
