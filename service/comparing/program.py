"""The program that compares measured jumps, started by `service.comparing.asking`."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rig.background.program import Teller, serve

if TYPE_CHECKING:
    from analysis.comparison.aligned import MeasuredJump


def _answer(asked: dict[str, Any], _: Teller) -> dict[str, Any]:
    return _page(asked) if "language" in asked else _compare(asked)


def _compare(asked: dict[str, Any]) -> dict[str, Any]:
    """Compare the first two of `groups` of jumps; the others tell the scatter."""
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


def _page(asked: dict[str, Any]) -> dict[str, Any]:
    """The page in `language` that shows the first two of `jumps`; the others tell the athlete's own scatter."""
    from analysis.comparison.alignment import align  # noqa: PLC0415 - as above
    from analysis.comparison.difference import difference  # noqa: PLC0415
    from analysis.comparison.report import Comparison  # noqa: PLC0415
    from analysis.comparison.scatter import scatter  # noqa: PLC0415
    from analysis.report.compared.page import comparison_page  # noqa: PLC0415
    from analysis.report.compared.places import images_beside  # noqa: PLC0415

    alignment = align([_jump(each) for each in asked["jumps"]])
    found = difference(alignment)
    comparison = Comparison(alignment, found, scatter(alignment.jumps[2:], found.times))
    one, other = (images_beside(Path(each["log"]), Path(each["file"]).parent) for each in asked["jumps"][:2])
    return {"page": comparison_page(comparison, (one, other), "nb" if asked["language"] == "nb" else "en")}


def _jump(asked: dict[str, Any]) -> "MeasuredJump":
    """A jump by `file` and number (`jump`), with `athlete` and `bib` as they are at present."""
    from analysis.comparison.aligned import measured_jump  # noqa: PLC0415
    from analysis.result.file import read  # noqa: PLC0415

    recording = read(Path(asked["file"]))
    session = {**recording.session, "athlete": asked["athlete"], "bib": asked["bib"]}
    return measured_jump(replace(recording, session=session), asked["jump"], asked["athlete"] or recording.recording)


if __name__ == "__main__":
    serve(_answer)
