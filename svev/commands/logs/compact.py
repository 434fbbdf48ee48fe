"""`svev compact`: a log for the archive, half as large, every frame to the last bit."""

from pathlib import Path
from typing import Annotated, Final

import typer

from recorder.compacting.compact import compact
from recorder.log.beside import named, numbered
from svev import console
from svev.commands.logs.contents import AlsoJson, LogPath

_ENDING: Final = ".compact"


def compact_command(
    log: LogPath,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", metavar="OUT", help="the new log; must not exist  [default: LOG.compact.mcap beside LOG]"
        ),
    ] = None,
    as_json: AlsoJson = False,
) -> None:
    """Make a log about half as large, from which every frame comes back to the last bit.

    The frames are coded without loss (FFV1), each for itself; everything else stays as it is. The new log is a log as
    any other: all commands read it, and check each frame against the checksum that the recorder gave it. It is read
    back from the disk, every frame of it, before it gets its name. LOG is only read: delete it yourself when the new
    log lies where you want it.

    `svev recover OUT -o LOG` makes a log with plain frames of it again.

    Exit codes: 0; 2 no such file, compacted already, or the new log cannot be made; 3 LOG was not closed or is damaged;
    4 the disk is full or fails, or what was read back is not what was written.

    Example: svev compact recordings/jump.mcap -o archive/jump.mcap
    """
    target = _beside(log) if out is None else out
    size = log.stat().st_size if log.is_file() else 0
    with console.progress("compacting", 2 * size) as done:
        report = compact(log, target, done)
    if as_json:
        console.print_json(report.to_json())
        return
    console.say(
        f"{report.path}: {report.bytes / 1e6:.1f} MB instead of {report.bytes_before / 1e6:.1f} MB "
        f"({report.ratio:.2f} : 1); {report.ledger.summary_line()}"
    )
    console.say("read back from the disk: every frame has the checksum that the recorder gave it")


def _beside(log: Path) -> Path:
    """The new log of a part gets a name by which it is a part of the others' new logs."""
    first, number = numbered(log)
    return named(first + _ENDING, number, log)
