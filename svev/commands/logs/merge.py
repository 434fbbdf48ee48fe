"""`svev merge`: one log of two that two computers recorded of the same pulses."""

from pathlib import Path
from typing import Annotated

import typer

from recorder.merging.merge import MergeReport, merge
from recorder.reading.info import info
from svev import console
from svev.commands.logs.contents import AlsoJson


def merge_command(
    first: Annotated[Path, typer.Argument(metavar="A", help="a log; its times stay as they are", show_default=False)],
    second: Annotated[Path, typer.Argument(metavar="B", help="the log of the other computer", show_default=False)],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="LOG", help="the new log; must not exist", show_default=False)
    ],
    as_json: AlsoJson = False,
) -> None:
    """Make one log of two that two computers recorded of the same pulses, with the cameras of both.

    Finds by how much the clocks of the two computers differ, from the times of the pulses, from what both logs say of
    their UTC, and from pulses that one of them has while the other was recording without. The cameras of A stand on the
    left, those of B on the right; times are those of A. Pulses are numbered anew. Where a log does not have a pulse,
    its cameras are absent. A and B are only read.

    Pulses that come evenly fit at every whole period. Then both clocks must be known well enough (NTP, PTP), or the
    pulses must have paused; what cannot be decided is refused, never guessed.

    Exit codes: 0; 2 no such file, the cameras do not fit together, or it cannot be decided which pulses are the same; 3
    A or B was not closed or is damaged; 4 the disk is full or fails.

    Example: svev merge left/jump.mcap right/jump.mcap -o jump.mcap
    """
    pulses = sum(info(log).ledger.pulses for log in (first, second))
    with console.progress("merging", pulses) as done:
        report = merge(first, second, out, done)
    if as_json:
        console.print_json(report.to_json())
    else:
        _print(report)


def _print(report: MergeReport) -> None:
    alignment = report.alignment
    console.say(f"{report.path}: {report.ledger.summary_line()}; {report.bytes / 1e6:.1f} MB")
    one, two = report.sources
    console.say(
        f"{alignment.common} pulses are in both logs, {report.alone[0]} in {one} only, {report.alone[1]} in {two} only"
    )
    where, went = "ahead of" if alignment.offset_ns < 0 else "behind", "fast" if alignment.drift_ppm < 0 else "slow"
    console.say(
        f"the clock of {two} was {abs(alignment.offset_ns) / 1e6:.3f} ms (+- {alignment.sigma_ns / 1e3:.1f} us) "
        f"{where} that of {one}, and ran {abs(alignment.drift_ppm):.2f} ppm {went}; "
        f"without that the times of a pulse differ by {alignment.residual_ns / 1e3:.1f} us (1 sigma)"
    )
    console.say(f"check it: svev verify --ledger {report.path}")
