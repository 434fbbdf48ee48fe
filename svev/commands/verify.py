"""`svev verify`: checks a log from the first to the last byte."""

from pathlib import Path
from typing import Annotated

import typer

from recorder.verify import VerifyReport, verify
from rig.errors import LogDamagedError
from svev import console
from svev.commands.truncation import truncated

_LINES_MAX = 60


def verify_command(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="the log, a .mcap file", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object instead")] = False,
) -> None:
    """Check every byte of a log and say, pulse by pulse, what is missing.

    Checks that pulses have no gaps, tags against images, checksums, message indexes, summary and statistics. The
    verdict is "clean" (every pulse complete), "partial" (the log is sound; its tags say which frames are missing and
    why) or "damaged" (not closed, unreadable in part, or inconsistent).

    Exit codes: 0 clean or partial; 2 no such file, no log of svev, or truncated; 3 damaged otherwise (a recorder that
    was killed leaves a log that is not closed). What can be read is printed all the same.

    Example: svev verify recordings/jump.mcap
    """
    with console.progress("checking", log.stat().st_size if log.is_file() else None) as done:
        report = verify(log, done)
    if as_json:
        console.print_json(report.to_json())
    else:
        _print(report)
    if report.truncated:
        raise truncated(log)
    if report.damaged:
        raise LogDamagedError(f"{log}: damaged: {_first_flaw(report)}; the pulses counted above are readable")


def _print(report: VerifyReport) -> None:
    ledger = report.ledger
    console.say(f"{report.path}: {report.verdict.value}")
    console.say(f"{ledger.summary_line()}; {report.bytes / 1e6:.1f} MB; {'' if report.closed else 'not '}closed")
    lines = [*ledger.in_words(), *report.findings]
    for line in lines[:_LINES_MAX]:
        console.say(f"  {line}")
    if len(lines) > _LINES_MAX:
        console.say(f"  and {len(lines) - _LINES_MAX} more; see all with --json")
    for event in report.events[:_LINES_MAX]:
        console.say(f"  {event.level.value}: {event.name}: {event.message}")


def _first_flaw(report: VerifyReport) -> str:
    if not report.closed:
        return "it was not closed, or is still being written"
    if report.findings:
        more = len(report.findings) - 1
        return report.findings[0] + (f" (and {more} more)" if more else "")
    return "pulses have no tag"
