"""`svev replay`: publishes a log as it was published live, or serves it to workers."""

from pathlib import Path
from typing import Annotated

import typer

from recorder.publishing.keys import exposure, load_keys
from recorder.publishing.replay import ReplayOptions, ReplayReport, replay
from rig.errors import BadInputError, LogDamagedError
from rig.topics import DEFAULT_PUBLISH
from svev import console
from svev.commands.logs.contents import AlsoJson, LogPath, check_pulses, truncated

_INTERRUPTED = 130
_SLOWEST, _FASTEST = 0.1, 10.0


def replay_command(
    log: LogPath,
    speed: Annotated[
        str, typer.Option(metavar="1|max|X", help="1: as recorded; 0.1 to 10: slower or faster; max: no waiting")
    ] = "1",
    reliable: Annotated[bool, typer.Option("--reliable", help="serve over PUSH: no message is lost")] = False,
    bind: Annotated[str, typer.Option(metavar="ADDRESS", help="ZeroMQ address to bind")] = DEFAULT_PUBLISH,
    loop: Annotated[bool, typer.Option("--loop", help="begin again at the end, until interrupted")] = False,
    first: Annotated[int | None, typer.Option("--from", metavar="N", min=1, help="first pulse")] = None,
    last: Annotated[int | None, typer.Option("--to", metavar="N", min=1, help="last pulse")] = None,
    wait: Annotated[float, typer.Option(metavar="S", min=0, help="seconds to wait for the first listener")] = 10.0,
    curve_key_file: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="secret keys (svev keys): serve only those who have the public key"),
    ] = None,
    as_json: AlsoJson = False,
) -> None:
    """Send the triplets, events and health of a log over ZeroMQ, exactly as in live operation.

    Without --reliable the socket is a PUB: subscribers that are too slow miss messages, as in live operation; if nobody
    subscribes in time, the log is published without subscribers. With --reliable it is a PUSH: workers connect a PULL
    socket, svev waits for them however slow they are, and each message goes to one of them.

    Exit codes: 0; 2 no such log, truncated, address in use, no such pulses, or no worker came; 3 the log was not
    closed or is damaged; 130 interrupted. What can be read is sent in any case.

    Example: svev replay recordings/jump.mcap --speed 0.5 --loop
    """
    check_pulses(first, last)
    keys = None if curve_key_file is None else load_keys(curve_key_file)
    options = ReplayOptions(bind, _speed(speed), reliable, loop, first, last, wait, keys)
    if exposed := exposure(bind, keys):
        console.say(f"warning: {exposed}", aside=True)
    with console.progress("replaying", None) as done:
        report = replay(log, options, ready=lambda address: _announce(address, reliable=reliable), progress=done)
    if as_json:
        console.print_json(report.to_json())
    else:
        _print(report)
    if report.interrupted and not loop:
        raise typer.Exit(_INTERRUPTED)
    if report.truncated:
        raise truncated(log)
    if report.damaged_bytes or not report.closed:
        raise LogDamagedError(f"{log}: not closed or damaged, sent as far as it can be read; see `svev verify`")


def _speed(text: str) -> float | None:
    """The factor; None for max."""
    if text == "max":
        return None
    try:
        factor = float(text)
    except ValueError:
        factor = 0.0
    if not _SLOWEST <= factor <= _FASTEST:
        raise BadInputError(f'--speed {text}: not a speed; say a number from {_SLOWEST:g} to {_FASTEST:g}, or "max"')
    return factor


def _announce(address: str, *, reliable: bool) -> None:
    console.say(f"{'serving workers' if reliable else 'publishing'} at {address}; end with Ctrl-C", aside=True)


def _print(report: ReplayReport) -> None:
    listeners = "" if report.attended else "; nobody had subscribed when it began"
    rounds = f" in {report.rounds} rounds" if report.rounds > 1 else ""
    console.say(
        f"sent {report.triplets} triplets ({report.bytes / 1e6:.1f} MB), {report.messages} messages{rounds} "
        f"in {report.seconds:.2f} s{listeners}"
    )
