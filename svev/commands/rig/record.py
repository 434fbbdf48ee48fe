"""`svev record`: one recording with the cameras of a rig file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer
from pydantic import TypeAdapter, ValidationError

from recorder.publishing.keys import check_publication
from rig.api.fields import LONGEST_LINE, Line
from rig.errors import BadInputError, PairingAlarmError, PulsesPausedError
from rig.host.endings import counted_endings
from rig.settings.file import load_rig
from service.headless import HeadlessRig, Recorded
from service.headless import record as record_with
from service.recordings.storage import new_log_path
from svev import console
from svev.claims import folder_claims
from svev.clock_warning import warn_of_clock
from svev.doctor.cameras.exposure import exposes_on
from svev.neighbours import naming_the_publisher


def record(
    rig: Annotated[Path, typer.Option(metavar="RIG.toml", help="rig file, e.g. config/rigs/sim.toml")],
    seconds: Annotated[float, typer.Option(metavar="S", min=0.1, max=86400, help="length of the recording, seconds")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for the log; made if missing")],
    allow_absent: Annotated[
        bool, typer.Option(help="record with any camera that answers, whatever trigger.min_cameras says")
    ] = False,
    session: Annotated[str, typer.Option(metavar="TEXT", help="name of the session, kept in the log")] = "",
    part_s: Annotated[
        float | None,
        typer.Option(metavar="S", min=1, help="go on in another log, the next part, after so many seconds"),
    ] = None,
    part_gb: Annotated[
        float | None, typer.Option(metavar="GB", min=0.001, help="the same before a log is larger, 10^9 bytes")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Record once with the cameras of a rig file, for a number of seconds.

    Makes one log (.mcap) with the frames of all trigger pulses, or several that are its parts (--part-s, --part-gb).
    For each pulse and camera the log says whether the frame came and, if not, why. Ctrl-C ends the recording early; its
    log is finished properly. A second Ctrl-C does not wait for a disk that is slow or hangs.

    Exit codes: 0 recorded (also if frames are missing: see the counts), 2 bad input, another svev records into the
    folder or the one for a failed disk, or a camera does not answer,
    4 the disk failed, hung, was too slow or has too little room, 5 the cameras are ready, but no pulses come, or none
    came for a while (the log is whole, and "pauses" says when), or clocks, trigger or rate were wrong (the log is
    whole, and "alarms" says what), 6 the recorder died; the log is readable up to that moment.

    Example: svev record --rig config/rigs/hill-gige.toml --seconds 10 --out recordings
    """
    settings = load_rig(rig)
    settings = settings.without_absent() if allow_absent else settings
    settings = settings.split(part_s, part_gb)
    _check_session(session)
    check_publication(settings.network)
    for camera in settings.cameras:
        if (finding := exposes_on(camera, settings)) is not None:
            aside(f"warning: {finding.what}, so it misses pulses: {finding.remedy}")
    warn_of_clock((rig, *out.glob("*.mcap")))
    with (
        folder_claims(out, settings.recorder.fallback_directory, "svev record", "--out"),
        naming_the_publisher(settings.network.publish),
        counted_endings() as asks,
        HeadlessRig(settings, rig.read_text(encoding="utf-8"), aside) as running,
    ):
        path = new_log_path(out)
        recorded = record_with(
            running, settings, path, seconds, session={"session": session},
            progress=console.progress, asks=asks,
        )  # fmt: skip
    if as_json:
        console.print_json(recorded.to_json())
    else:
        _say(recorded)
    if recorded.disk_error is not None:
        raise recorded.disk_error
    log, pauses = recorded.report.path, recorded.report.pauses
    if pauses:
        first, more = pauses[0].in_words(), len(pauses) - 1
        raise PulsesPausedError(
            f"{log}: {first}{f', and {more} more pauses' if more else ''}; look at the trigger, or at what the log "
            "says of the cameras at that time: svev verify"
        )
    if recorded.alarms:
        raise PairingAlarmError(f"{log}: {'; '.join(recorded.alarms)}")


def _say(recorded: Recorded) -> None:
    report, counts = recorded.report, recorded.report.counts
    console.say(f"{counts.pulses} pulses, {counts.complete} complete{causes(counts.causes.model_dump())}")
    if earlier := recorded.logs[:-1]:
        console.say(f"{len(earlier)} parts before the last one, the first in {earlier[0]}")
    console.say(f"{report.bytes / 1e6:.1f} MB in {report.path}")
    console.say(f"check it: svev verify {report.path}")


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


def aside(line: str) -> None:
    """Say what happens meanwhile, on standard error."""
    console.say(line, aside=True)


def causes(missing: Mapping[str, int]) -> str:
    """What became of the frames that are missing, in brackets; nothing if none is missing."""
    words = ", ".join(f"{count} {cause}" for cause, count in missing.items() if count)
    return f" (frames: {words})" if words else ""
