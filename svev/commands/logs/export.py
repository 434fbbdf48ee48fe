"""`svev export`: a recording as video, pictures, table or contact sheet."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Final

import typer
from pydantic import ValidationError

from analysis.film.export import export, in_file_name
from analysis.film.shots import Recording
from recorder.reading.info import info
from rig.api.export import ENDINGS, ExportOrder, Kind, Quality
from rig.api.language import Language
from rig.errors import BadInputError
from svev import console
from svev.commands.logs.contents import AlsoJson, LogPath, check_pulses
from svev.overwriting import ForceOption, refuse_existing

_FILES: Final = {".mp4": Kind.H264, ".mkv": Kind.FFV1, ".csv": Kind.CSV}
_VIDEOS: Final = (Kind.H264, Kind.FFV1)


class Images(StrEnum):
    """Format of single pictures."""

    PNG = "png"
    TIFF = "tiff"


def export_command(
    log: LogPath,
    out: Annotated[
        Path,
        typer.Option(
            "-o",
            "--out",
            metavar="FILE|DIR",
            help="X.mp4: H.264; X.mkv: FFV1 without loss; X.csv: table of tags; otherwise a new folder for pictures",
            show_default=False,
        ),
    ],
    camera: Annotated[
        list[str] | None, typer.Option("--camera", metavar="NAME", help="only this camera; may be repeated")
    ] = None,
    separate: Annotated[bool, typer.Option("--separate", help="a video for each camera: X_K1.mp4, ...")] = False,
    first: Annotated[int | None, typer.Option("--from", metavar="PULSE", help="first pulse")] = None,
    last: Annotated[int | None, typer.Option("--to", metavar="PULSE", help="last pulse")] = None,
    slow: Annotated[
        float, typer.Option("--slow", metavar="X", min=1, max=10, help="so many times slower (videos)")
    ] = 1.0,
    quality: Annotated[
        Quality, typer.Option("--quality", metavar="small|good|best", help="of H.264; the worse, the smaller")
    ] = Quality.GOOD,
    burn_in: Annotated[
        bool, typer.Option("--burn-in", help="write bib, pulse and time into the pictures (videos)")
    ] = False,
    language: Annotated[
        Language, typer.Option("--language", metavar="en|nb", help="of words in the pictures (videos)")
    ] = Language.EN,
    images: Annotated[
        Images, typer.Option("--images", metavar="png|tiff", help="format of pictures in a folder")
    ] = Images.PNG,
    contact_sheet: Annotated[
        bool, typer.Option("--contact-sheet", help="only a page with triplets of the jump; OUT is a .png")
    ] = False,
    force: ForceOption = False,
    as_json: AlsoJson = False,
) -> None:
    """Export a recording: a video for people or without loss, pictures of each camera, a table, a contact sheet.

    A video has one picture for each pulse, at the time of the pulse; where a frame is missing it is black and says why.
    In H.264 several cameras side by side are at most 4096 px wide, made smaller if need be; one alone never is.
    Without loss, every pixel is that of the log. A folder gets a picture of each frame that came, and tags.csv.
    A file or folder is there under its name only when it is complete.

    Exit codes: 0 exported; 2 bad input; 3 the log has nothing to export; 4 the disk is full or fails.

    Example: svev export recordings/jump.mcap --out jump.mp4 --slow 5 --burn-in
    """
    check_pulses(first, last)
    kind = _kind(out, Kind(images.value), contact_sheet=contact_sheet)
    if kind not in _VIDEOS and (separate or burn_in or slow > 1):
        raise BadInputError(f"{out}: --separate, --burn-in and --slow are for videos: name a .mp4 or .mkv")
    try:
        order = ExportOrder(
            kind=kind,
            cameras=tuple(camera or ()),
            first=first,
            last=last,
            slow=slow,
            quality=quality,
            burn_in=burn_in,
            language=language,
        )
    except ValidationError as error:
        raise BadInputError(f"{error.errors()[0]['loc'][0]}: {error.errors()[0]['msg']}; see --help") from None
    if part_said := info(log, whole=True).part_said.text:
        console.say(f"{log}: {part_said}; this one alone is exported", aside=True)
    written: list[Path] = []
    pulses = 0
    parts = _parts(log, order, out, separate=separate)
    refuse_existing(*(file for _, file in parts if not file.is_dir()), force=force)  # a folder is for pictures
    for part, file in parts:
        pulses = _export(log, part, file)
        written.append(file)
        console.say(f"{file}: {pulses} pulses", aside=as_json)
    if as_json:
        console.print_json({"log": str(log), "files": [str(file) for file in written], "pulses": pulses})


def _export(log: Path, order: ExportOrder, file: Path) -> int:
    with console.steps() as tell:
        return export(log, order, file, lambda done, all_: tell(f"writing {file.name}", done / all_))


def _kind(out: Path, pictures: Kind, *, contact_sheet: bool) -> Kind:
    """What comes out, by the ending of its name."""
    if contact_sheet:
        if out.suffix.lower() != ENDINGS[Kind.CONTACT_SHEET]:
            raise BadInputError(f"{out}: a contact sheet is a .png; choose another name")
        return Kind.CONTACT_SHEET
    if out.is_dir() or not out.suffix:
        return pictures
    if out.suffix.lower() not in _FILES:
        raise BadInputError(f"{out}: name a .mp4, a .mkv, a .csv, a .png with --contact-sheet, or a folder")
    return _FILES[out.suffix.lower()]


def _parts(log: Path, order: ExportOrder, out: Path, *, separate: bool) -> list[tuple[ExportOrder, Path]]:
    """Orders and names of the files: one, or one for each camera."""
    if not separate:
        return [(order, out)]
    names = Recording(log, order).cameras
    return [
        (order.model_copy(update={"cameras": (name,)}), out.with_name(f"{out.stem}_{in_file_name(name)}{out.suffix}"))
        for name in names
    ]
