"""The program that compares measured jumps, started by `service.comparing.asking`."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from rig.api.comparison import Comparison, QuantityDifference
from rig.background.messages import End, Order
from rig.background.program import Teller, serve

if TYPE_CHECKING:
    from analysis.comparison.aligned import MeasuredJump


class JumpFile(msgspec.Struct, frozen=True, kw_only=True):
    """A measured jump: log, file of its result, number in it; and whose it is at present."""

    log: Path
    file: Path
    jump: int
    athlete: str
    bib: str


class CompareGroups(Order):
    """Compare the first two groups of jumps; the others tell the scatter.

    Attributes:
        left_out: jumps that are not among them, for the answer.
    """

    groups: tuple[tuple[JumpFile, ...], ...]
    left_out: int


class Compared(End):
    """The comparison of two groups."""

    comparison: Comparison


class ShowBeside(Order):
    """Make the page that shows the first two jumps; the others tell the athlete's own scatter."""

    jumps: tuple[JumpFile, ...]
    language: str


class Shown(End):
    """The page (HTML)."""

    page: str


def _compare(asked: CompareGroups, _: Teller) -> Compared:
    from analysis.comparison.alignment import align  # noqa: PLC0415 - its libraries start their threads with our low priority
    from analysis.comparison.groups import greatest_differences, group_difference  # noqa: PLC0415

    groups = [_jumps(group) for group in asked.groups]
    alignment = align([jump for group in groups for jump in group])
    found = group_difference(alignment, [len(group) for group in groups])
    comparison = Comparison(
        first=len(groups[0]),
        second=len(groups[1]),
        left_out=asked.left_out,
        scatter_jumps=0 if found.scatter is None else found.scatter.jumps,
        different=tuple(found.difference.found()),
        quantities=tuple(QuantityDifference.model_validate(each) for each in greatest_differences(found.difference)),
        one_place=alignment.at_one_place,
    )
    return Compared(comparison=comparison)


def _show(asked: ShowBeside, _: Teller) -> Shown:
    from analysis.comparison.alignment import align  # noqa: PLC0415 - as above
    from analysis.comparison.difference import difference  # noqa: PLC0415
    from analysis.comparison.report import Comparison as Report  # noqa: PLC0415
    from analysis.comparison.scatter import scatter  # noqa: PLC0415
    from analysis.report.compared.page import comparison_page  # noqa: PLC0415
    from analysis.report.compared.places import images_beside  # noqa: PLC0415

    alignment = align(_jumps(asked.jumps))
    found = difference(alignment)
    report = Report(alignment, found, scatter(alignment.jumps[2:], found.times))
    one, other = (images_beside(each.log, each.file.parent) for each in asked.jumps[:2])
    return Shown(page=comparison_page(report, (one, other), "nb" if asked.language == "nb" else "en"))


def _jumps(asked: Sequence[JumpFile]) -> "list[MeasuredJump]":
    from analysis.comparison.aligned import measured_jump  # noqa: PLC0415
    from analysis.result.file import read  # noqa: PLC0415

    found = []
    for each in asked:
        recording = read(each.file)
        session = {**recording.session, "athlete": each.athlete, "bib": each.bib}
        who = each.athlete or recording.recording
        found.append(measured_jump(replace(recording, session=session), each.jump, who))
    return found


def main() -> None:
    """Compare once."""
    serve({CompareGroups: _compare, ShowBeside: _show})


if __name__ == "__main__":
    main()
