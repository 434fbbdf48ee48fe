"""`svev import`: a log of films that other cameras took."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from recorder.importing.films import BITS, ImportOrder
from recorder.importing.names import named
from recorder.importing.run import Import, ImportReport
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.settings.file import load_rig
from rig.settings.trigger import TriggerSettings
from service.rig_file import read_calibration
from svev import console
from svev.commands.logs.contents import AlsoJson, check_pulses
from svev.overwriting import ForceOption


def import_command(
    films: Annotated[
        list[str],
        typer.Argument(
            metavar="FOLDER|VIDEO",
            show_default=False,
            help="folder of images, TIFF file or video of each camera, from left to right; NAME=PATH names the camera",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="LOG", help="the new log", show_default=False)],
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="frames per second when they were taken")
    ] = None,
    rig: Annotated[
        Path | None,
        typer.Option("--rig", metavar="FILE", help="names the cameras in their order, and their calibration"),
    ] = None,
    start: Annotated[
        list[str] | None,
        typer.Option("--start", metavar="NAME=FRAME", help="frame of a camera that is pulse 1; may be repeated"),
    ] = None,
    flash: Annotated[bool, typer.Option("--flash", help="pulse 1 is the flash that every film shows once")] = False,
    first: Annotated[
        int, typer.Option("--from", metavar="PULSE", min=1, help="leave out what comes before, from the common start")
    ] = 1,
    last: Annotated[int | None, typer.Option("--to", metavar="PULSE", min=1, help="leave out what comes after")] = None,
    bits: Annotated[
        int | None,
        typer.Option("--bits", metavar="N", help="so many bits of 16-bit images hold grey values: 10, 12, 16"),
    ] = None,
    date: Annotated[
        str | None, typer.Option("--date", metavar="TIME", help="of the common start, as 2009-02-14T12:30:00+01:00")
    ] = None,
    force: ForceOption = False,
    as_json: AlsoJson = False,
) -> None:
    """Make a log of image sequences or videos that other cameras took, so that films of other years can be measured.

    A film is a folder of images (PNG, TIFF, JPEG, BMP; in the order of the numbers in their names), a TIFF file with a
    page for each frame, or a video. Frames
    of a folder have the numbers in the file names, where these differ in one number; others count from 1. The films
    begin together at their first frames, at those that --start names, or at a flash. Where a film has no more frames
    its camera is absent; an image that cannot be read, between two that can, is damaged; a number that is left out
    among the file names is lost. Colours become grey (Y = 0.299 R + 0.587 G + 0.114 B).

    No trigger stands behind such a log, and it says so: pulses are told by frame numbers, how synchronous the cameras
    were is unknown. All other commands take it as any log.

    Exit codes: 0 imported, with words on what is missing; 2 bad input; 4 the disk is full or fails. Then there is no
    new log.

    Example: svev import left.avi middle.avi K3=right/ -o old.mcap --rate 50 --start K3=120
    """
    check_pulses(first, last)
    settings = None if rig is None else load_rig(rig)
    if rate is None:
        raise BadInputError(
            "--rate is missing: how many frames per second the cameras took; what a video plays may be slow motion"
        )
    _check_rate(rate)
    if bits is not None and (bits not in BITS or bits == BITS[0]):
        raise BadInputError(f"--bits {bits}: a log holds 10, 12 or 16 bits; give one of them")
    order = ImportOrder(
        cameras=named(films, settings),
        rate_hz=rate,
        out=out,
        starts=_starts(start or ()),
        flash=flash,
        first=first,
        last=last,
        bits=bits,
        date=None if date is None else _utc(date),
        rig=None if settings is None or rig is None else (settings, rig.read_bytes()),
        calibration=None if settings is None else read_calibration(settings),
        replace=force,
    )
    prepared = Import(order)
    with console.progress("importing", prepared.frames) as done:
        report = prepared.run(done)
    if as_json:
        console.print_json(report.to_json())
    else:
        _print(report)


def _check_rate(rate: float) -> None:
    limits = {type(each).__name__: each for each in TriggerSettings.model_fields["rate_hz"].metadata}
    least, most = limits["Ge"].ge, limits["Le"].le
    if not least <= rate <= most:
        raise BadInputError(f"--rate {rate:g}: give {least:g} to {most:g} frames per second")


def _starts(given: Sequence[str]) -> dict[str, int]:
    starts: dict[str, int] = {}
    for each in given:
        name, _, number = each.partition("=")
        if not name or not re.fullmatch(r"[0-9]{1,12}", number):
            raise BadInputError(f"--start {each}: give camera and frame, as --start K1=120")
        if name in starts:
            raise BadInputError(f"--start names {name} twice; give it once")
        starts[name] = int(number)
    return starts


def _utc(text: str) -> UtcNs:
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = datetime.min
    if moment.tzinfo is None or moment < datetime(1970, 1, 1, tzinfo=UTC):
        raise BadInputError(f"--date {text}: give a date since 1970 with its time zone, as 2009-02-14T12:30:00+01:00")
    return UtcNs(round((moment - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds() * NS_PER_S))


def _print(report: ImportReport) -> None:
    console.say(f"{report.path}: {report.ledger.summary_line()}; {report.bytes / 1e6:.1f} MB")
    for finding in report.findings:
        console.say(f"  {finding}")
    fields = report.fields
    console.say(
        f"no trigger stands behind it: pulses are frame numbers; synchrony {fields['synchrony']}; date {fields['date']}"
    )
    console.say(f"check it: svev verify {report.path}")
