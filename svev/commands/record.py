"""`svev record`: one recording with the cameras of a rig file."""

from pathlib import Path
from typing import Annotated

import typer

from rig.clocks import host_now
from rig.control import Message
from rig.rigfile import load_rig
from rig.settings import RigSettings
from svev import console
from svev.recording_run import new_log_path, run_recording
from svev.running_rig import RunningRig
from svev.simulation import environment, simulated_hill


def record(
    rig: Annotated[Path, typer.Option(help="rig file, e.g. config/rigs/sim.toml")],
    seconds: Annotated[float, typer.Option(min=0.1, max=86400, help="how long to record")],
    out: Annotated[Path, typer.Option(help="directory for the log; made if missing")],
    allow_absent: Annotated[bool, typer.Option(help="record with the cameras that are there")] = False,
    session: Annotated[str, typer.Option(help="name of the session, kept in the log")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Record for some seconds: one log with every pulse, tagged camera by camera.

    Ctrl-C ends the recording early; the log is finished properly.

    Exit codes: 0 recorded (also with pulses that are not complete: see the counts), 2 bad input or a camera that is
    not there, 4 the disk failed, 5 cameras without pulses, 6 the recorder died; the log until then is readable.

    Example: svev record --rig config/rigs/hill-gige.toml --seconds 10 --out recordings
    """
    settings = load_rig(rig)
    result = record_once(
        settings, rig.read_text(encoding="utf-8"), seconds, out, allow_absent=allow_absent, session={"session": session}
    )
    if as_json:
        console.print_json(result)
    else:
        _print_result(result)


def record_once(
    rig: RigSettings, rig_toml: str, seconds: float, out: Path, *, allow_absent: bool, session: dict[str, str]
) -> Message:
    """Start the rig, record once, stop the rig.

    Returns:
        The result in the form of the command line's contract.
    """
    path = new_log_path(out)
    epoch = host_now()
    with simulated_hill(rig, epoch) as hill, RunningRig(rig, rig_toml, _aside, epoch, environment(hill)) as running:
        return run_recording(running, rig, path, seconds, allow_absent=allow_absent, session=session)


def _aside(line: str) -> None:
    console.say(line, aside=True)


def _print_result(result: Message) -> None:
    causes = ", ".join(f"{count} {cause}" for cause, count in result["causes"].items() if count)
    console.say(
        f"{result['pulses']} pulses, {result['complete']} complete" + (f" (frames: {causes})" if causes else "")
    )
    console.say(f"{result['bytes'] / 1e6:.1f} MB in {result['log']}")
    console.say(f"check it: svev verify {result['log']}")
