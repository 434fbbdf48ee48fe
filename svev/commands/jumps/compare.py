"""`svev compare`: two measured jumps."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from analysis.comparison.aligned import MeasuredJump, comparable, measured_jump
from analysis.comparison.alignment import align
from analysis.comparison.difference import difference
from analysis.comparison.report import Comparison, summary, to_json
from analysis.comparison.scatter import scatter
from analysis.report.compared.page import comparison_page
from analysis.report.compared.places import Images, images_beside
from analysis.result.file import read
from analysis.result.model import MeasuredRecording
from rig.api.language import Language
from rig.errors import BadInputError
from svev import console
from svev.overwriting import ForceOption, refuse_existing

_FOLDER: Final = "folder that svev analyze wrote, or its jumper.json"


def compare(
    dir_a: Annotated[Path, typer.Argument(metavar="DIR_A", help=_FOLDER, show_default=False)],
    dir_b: Annotated[Path, typer.Argument(metavar="DIR_B", help=_FOLDER, show_default=False)],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="DIR", help="folder for comparison.json and comparison.html")
    ],
    jump_a: Annotated[int, typer.Option("--jump-a", metavar="N", min=1, help="number of the jump in DIR_A")] = 1,
    jump_b: Annotated[int, typer.Option("--jump-b", metavar="N", min=1, help="number of the jump in DIR_B")] = 1,
    also: Annotated[
        list[Path] | None,
        typer.Option("--also", metavar="DIR", help="further jumps, for the athlete's own scatter; may be repeated"),
    ] = None,
    language: Annotated[
        Language,
        typer.Option(
            "--language", metavar="en|nb", help="that the page shows first; a reader can choose the other one"
        ),
    ] = Language.EN,
    force: ForceOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="end with one JSON object: the result without series")
    ] = False,
) -> None:
    """Compare two measured jumps: aligned at the take-off, differences with their significance.

    The page has pictures of both if their logs are beside the folders of the results.

    Exit codes: 0 compared, whether they differ or not; 2 bad input.

    Example: svev compare monday tuesday --also wednesday --out compared
    """
    refuse_existing(out / "comparison.json", out / "comparison.html", force=force)
    recordings = {path: read(path) for path in dict.fromkeys((dir_a, dir_b))}
    twice = _read_further(also or (), recordings)
    if recordings[dir_a] is recordings[dir_b] and jump_a == jump_b:
        raise BadInputError(f"{dir_a}: this is one jump; choose another to compare it with by --jump-b")
    a = measured_jump(recordings[dir_a], jump_a, str(dir_a))
    b = measured_jump(recordings[dir_b], jump_b, str(dir_b))
    alignment = align([a, b, *_others(recordings, a, b)])
    found = difference(alignment)
    comparison = Comparison(alignment, found, scatter(alignment.jumps[2:], found.times))
    result = to_json(comparison)
    page = comparison_page(
        comparison, (_images(dir_a, a), _images(dir_b, b)), "nb" if language is Language.NB else "en"
    )
    out.mkdir(parents=True, exist_ok=True)
    written = json.dumps(result, allow_nan=False, ensure_ascii=False) + "\n"
    (out / "comparison.json").write_text(written, encoding="utf-8")
    (out / "comparison.html").write_text(page, encoding="utf-8")
    for line in [*twice, *summary(comparison), f"result in {out / 'comparison.json'} and {out / 'comparison.html'}"]:
        console.say(line, aside=as_json)
    if as_json:
        console.print_json(_without_series(result))


def _read_further(also: Sequence[Path], recordings: dict[Path, MeasuredRecording]) -> list[str]:
    """Add recordings to those that are read, each once: a jump that counts twice would make the scatter too small.

    Args:
        also: folders of results; several may be of one recording.
        recordings: by folder; gets the new ones.

    Returns:
        What was left out, in words.
    """
    there = {recording.recording: path for path, recording in reversed(recordings.items())}
    said = []
    for path in dict.fromkeys(also):
        if path in recordings:
            continue
        recording = read(path)
        if (before := there.setdefault(recording.recording, path)) == path:
            recordings[path] = recording
        else:
            said.append(f"{path}: is recording {recording.recording}, as {before} is; it counts once")
    return said


def _images(result: Path, jump: MeasuredJump) -> Images | None:
    """The images of a jump, if its log is where it is wanted: beside the folder of the result, or in it."""
    folder = result if result.is_dir() else result.parent
    beside = folder.resolve()
    logs = [
        beside.with_suffix(".mcap"),
        *(place / f"{jump.recording.recording}.mcap" for place in (beside.parent, beside)),
    ]
    return next((images_beside(log, folder) for log in logs if log.is_file()), None)


def _others(recordings: dict[Path, MeasuredRecording], *compared: MeasuredJump) -> list[MeasuredJump]:
    """All jumps that can be compared but the two that are."""
    chosen = [jump.jump for jump in compared]
    return [
        measured_jump(recording, jump.number, str(path))
        for path, recording in recordings.items()
        for jump in recording.jumps
        if comparable(jump) and not any(jump is other for other in chosen)
    ]


def _without_series(result: dict[str, Any]) -> dict[str, Any]:
    quantities = {
        name: {key: value for key, value in found.items() if not isinstance(value, list)}
        for name, found in result["quantities"].items()
    }
    return {key: value for key, value in result.items() if key != "since_takeoff_s"} | {"quantities": quantities}
