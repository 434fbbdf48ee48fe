"""`svev record` and `svev demo`: one recording, with the cameras of a rig file or on the simulated hill."""

from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from pydantic import TypeAdapter, ValidationError

from recorder.publishing.keys import check_publication
from rig.errors import BadInputError, PulsesPausedError
from rig.pulse import Pause
from rig.settings.file import load_rig
from rig.status import LONGEST_LINE, Line
from service.headless import HeadlessRig
from service.headless import record as record_with
from service.recordings.storage import new_log_path
from svev import console
from svev.demo import Bus, run_demo


def record(
    rig: Annotated[Path, typer.Option(help="rig file, e.g. config/rigs/sim.toml")],
    seconds: Annotated[float, typer.Option(min=0.1, max=86400, help="length of the recording, seconds")],
    out: Annotated[Path, typer.Option(help="folder for the log; made if missing")],
    allow_absent: Annotated[bool, typer.Option(help="record even if some cameras do not answer")] = False,
    session: Annotated[str, typer.Option(help="name of the session, kept in the log")] = "",
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Record once with the cameras of a rig file, for a number of seconds.

    Makes one log (.mcap) with the frames of all trigger pulses. For each pulse and camera the log says whether the
    frame came and, if not, why. Ctrl-C ends the recording early; its log is finished properly. A second Ctrl-C does not
    wait for a disk that is slow or hangs.

    Exit codes: 0 recorded (also if frames are missing: see the counts), 2 bad input, or a camera does not answer,
    4 the disk failed, hung, was too slow or has too little room, 5 the cameras are ready, but no pulses come, or none
    came for a while (the log is whole, and "pauses" says when), 6 the recorder died; the log is readable up to that
    moment.

    Example: svev record --rig config/rigs/hill-gige.toml --seconds 10 --out recordings
    """
    settings = load_rig(rig)
    _check_session(session)
    check_publication(settings.network)
    path = new_log_path(out)
    with HeadlessRig(settings, rig.read_text(encoding="utf-8"), _aside) as running:
        result, disk_error = record_with(
            running, settings, path, seconds, allow_absent=allow_absent, session={"session": session},
            progress=console.progress,
        )  # fmt: skip
    if as_json:
        console.print_json(result)
    else:
        console.say(f"{result['pulses']} pulses, {result['complete']} complete{_causes(result)}")
        for log in result["logs"][:-1]:
            console.say(f"the first part is in {log}")
        console.say(f"{result['bytes'] / 1e6:.1f} MB in {result['log']}")
        console.say(f"check it: svev verify {result['log']}")
    if disk_error is not None:
        raise disk_error
    if result["pauses"]:
        first, more = msgspec.convert(result["pauses"][0], Pause).in_words(), len(result["pauses"]) - 1
        raise PulsesPausedError(
            f"{result['log']}: {first}{f', and {more} more pauses' if more else ''}; look at the trigger, or at what "
            "the log says of the cameras at that time: svev verify"
        )


def demo(
    seconds: Annotated[float, typer.Option(min=0.5, max=3600, help="length of the recording, seconds")] = 10.0,
    bus: Annotated[Bus, typer.Option(help="how the simulated cameras are connected")] = "gige",
    out: Annotated[Path, typer.Option(help="folder for the files; made if missing")] = Path("demo"),
    analyze: Annotated[bool, typer.Option(help="measure the jumps after recording them")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Record jumps on the simulated hill, measure them and show the result. Needs no camera.

    Three simulated cameras send their frames as real ones do: as GigE Vision packets over this computer's network, or,
    with --bus firewire, over an emulated FireWire bus. The frames are paired by trigger pulse, written to a log and
    published; a subscriber counts what it receives. Then the balls in the log's images orient the cameras, the jumper
    is measured, and what was found is printed beside the truth. Beside the log you find a contact sheet (a picture of
    its frames), the survey of the balls, the truth, and a folder with the results: open report.html there.

    Example: svev demo --seconds 5

    Example: svev demo --bus firewire
    """
    result = run_demo(bus, seconds, out, _aside, analyze=analyze)
    if as_json:
        console.print_json(result)
        return
    counted, latency = result["subscriber"], result["subscriber"]["latency_ms"]
    console.say("")
    console.say(f"pulses             {result['pulses']} at {result['rate_hz']:g} Hz")
    console.say(f"complete triplets  {result['complete']}{_causes(result)}")
    console.say(f"subscriber got     {counted['received']}, missing {counted['missing']}")
    if latency["median"] is not None:
        console.say(f"latency            {latency['median']:.1f} ms median, {latency['p99']:.1f} ms at 99 %")
    console.say(f"log                {result['log']} ({result['bytes'] / 1e6:.1f} MB), {result['verdict']}")
    console.say(f"contact sheet      {result['contact_sheet']}")
    console.say(f"truth              {result['truth']}")
    if result["analysis"] is not None:
        _say_measured(result["analysis"])


def _say_measured(analysis: dict[str, Any]) -> None:
    """What was measured, beside the truth."""
    if analysis["message"]:
        console.say(f"nothing measured   {analysis['message']}")
        return
    for jump in analysis["jumps"]:
        console.say("")
        console.say(f"jump {jump['number']}             {jump['verdict']}")
        if jump["figures"]:
            console.say(f"                   at {jump['at']}:")
        for figure in jump["figures"]:
            console.say(f"                   {figure['words']}")
    console.say("")
    console.say(f"results            {analysis['out']}")
    console.say(f"for the coach      {analysis['report']}")


def _check_session(session: str) -> None:
    """Refuse what the panel refuses as well.

    Raises:
        BadInputError: the name is too long, or holds control characters.
    """
    try:
        TypeAdapter(Line).validate_python(session)
    except ValidationError as error:
        what = f"{len(session)} characters" if len(session) > LONGEST_LINE else "a control character"
        raise BadInputError(
            f"--session has {what}: give a name of at most {LONGEST_LINE} characters in one line"
        ) from error


def _aside(line: str) -> None:
    console.say(line, aside=True)


def _causes(result: dict[str, Any]) -> str:
    """What became of the frames that are missing, in brackets; nothing if none is missing."""
    causes = ", ".join(f"{count} {cause}" for cause, count in result["causes"].items() if count)
    return f" (frames: {causes})" if causes else ""
