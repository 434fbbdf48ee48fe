"""`svev recover`: makes a whole log of an unfinished or damaged one."""

from pathlib import Path
from typing import Annotated

import typer

from recorder.recover import RecoverReport, recover
from rig.errors import LogDamagedError
from svev import console


def recover_command(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="the log; it is only read", show_default=False)],
    out: Annotated[Path, typer.Option("-o", "--out", help="the new log; must not exist", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Make a whole log of one that was not closed or is damaged: closed, indexed, everything in it checked.

    Everything that is sound is copied. Where the image of a pulse is destroyed but not its tag, the tag is kept, and
    says "damaged" of the frames that were there. What is lost is printed, and stands in the new log too.

    Exit codes: 0 nothing was lost; 2 no such file, or no pulse in it that can be read, or the new log cannot be made;
    3 recovered, but something was lost; 4 the disk is full or fails.

    Example: svev recover recordings/jump.mcap -o recordings/jump-recovered.mcap
    """
    with console.progress("recovering", log.stat().st_size if log.is_file() else None) as done:
        report = recover(log, out, done)
    if as_json:
        console.print_json(report.to_json())
    else:
        _print(report)
    if not report.lossless:
        raise LogDamagedError(f"{log}: recovered into {out}, but this is lost: {report.in_words()}")


def _print(report: RecoverReport) -> None:
    console.say(f"{report.path}: {report.ledger.summary_line()}; {report.bytes / 1e6:.1f} MB")
    if not report.was_closed:
        console.say(f"the recording was not closed; its last pulse is {report.ledger.last_pulse}")
    for finding in report.findings:
        console.say(f"  {finding}")
    console.say(f"check it: svev verify {report.path}")
