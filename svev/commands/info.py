"""`svev info`: what a log is and holds."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from recorder.info import LogInfo, info
from rig.clocks import NS_PER_S
from rig.errors import LogDamagedError
from svev import console
from svev.commands.truncation import truncated


def info_command(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="the log, a .mcap file", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="print one JSON object instead")] = False,
) -> None:
    """Say what a log is and holds: pulses, causes of what is missing, rate, spread of the triggers, session, rig.

    Reads tags only, so it takes a moment even on a long log; `svev verify` checks every byte.

    Exit codes: 0; 2 no such file, no log of svev, or truncated; 3 the log was not closed or is damaged. What can be
    read is printed all the same.

    Example: svev info recordings/jump.mcap
    """
    found = info(log)
    if as_json:
        console.print_json(found.to_json())
    else:
        for name, text in _lines(found):
            console.say(f"{name:<10} {text}")
    if found.truncated:
        raise truncated(log)
    if not found.closed:
        raise LogDamagedError(f"{log}: the log was not closed, or is still being written; check it with `svev verify`")
    if found.damaged_bytes:
        raise LogDamagedError(f"{log}: {found.damaged_bytes} bytes are damaged; see which pulses with `svev verify`")


def _lines(found: LogInfo) -> Iterator[tuple[str, str]]:
    ledger, spread = found.ledger, found.ledger.spread_us()
    yield "log", f"{found.path} ({found.bytes / 1e6:.1f} MB, by {found.library})"
    yield "state", "closed" if found.closed else "not closed"
    yield "recording", found.recording or "no pulse"
    if ledger.first_time is not None:
        start = datetime.fromtimestamp(ledger.first_time / NS_PER_S, UTC)
        yield "first", f"{start:%Y-%m-%d %H:%M:%S.%f} UTC"
    rate = "" if ledger.rate_hz is None else f", {ledger.rate_hz:.3f} Hz"
    yield "duration", f"{ledger.duration_s:.3f} s{rate}"
    yield "pulses", ledger.summary_line()
    if missing := sum(last - first + 1 for first, last in ledger.missing):
        yield "no tag", f"{missing} pulses"
    if spread is not None:
        yield "offset", f"{spread['median']} us median, {spread['max']} us at most, from the pulse"
    if found.shape is not None:
        yield "triplet", f"{found.shape[1]} x {found.shape[0]} px of {', '.join(found.cameras)}"
    for name, fields in (("session", found.session), ("rig", found.rig)):
        if text := ", ".join(f"{key} {value}" for key, value in fields.items() if value):
            yield name, text
