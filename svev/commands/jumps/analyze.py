"""`svev analyze`: measures the jumps of a recording."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import typer

from analysis.cameras.source import read_source
from analysis.measurements.file import read_measurements
from analysis.procedure.analyze import Analysis, analyze
from analysis.procedure.result_folder import write_folder
from analysis.report.course import course_of
from analysis.report.figures import five_figures, plus_minus
from analysis.report.kinogram.earlier import read_earlier
from analysis.result import file as result_file
from analysis.worker.findings import summary
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from recorder.log.beside import measured_path
from rig.errors import StorageError
from rig.host.endings import interrupted_by_endings
from service.measuring.keeping import keep_own_result
from service.measuring.results import names_of
from svev import console
from svev.clock_warning import warn_of_clock
from svev.commands.logs.contents import AlsoJson, LogPath
from svev.commands.networks.delivery import (
    NOT_CONVERGED,
    NOT_SOLVABLE,
    Alternative,
    AlternativeOption,
    PosesOption,
    SurveyOption,
)
from svev.overwriting import ForceOption, refuse_existing


def analyze_command(
    log: LogPath,
    out: Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="folder for the results")],
    survey: SurveyOption = None,
    calibration: PosesOption = None,
    alternative: AlternativeOption = Alternative.STATIC,
    measurements: Annotated[
        Path | None, typer.Option(metavar="FILE", help="compute from these measurements; do not look at the jumper")
    ] = None,
    by_hand: Annotated[
        Path | None, typer.Option(metavar="FILE", help="use these measurements beside the automatic ones, first")
    ] = None,
    earlier: Annotated[
        list[Path] | None,
        typer.Option(metavar="DIR", help="result of an earlier jump of this athlete, for the marks of the kinogram"),
    ] = None,
    video: Annotated[bool, typer.Option("--video", help="write the overlay video too")] = False,
    force: ForceOption = False,
    as_json: AlsoJson = False,
) -> None:
    """Measure the jumps of a recording: points, skis, angles, height and speed, each with its sigma.

    The balls in the log's own images and their survey orient the cameras; nothing is to be clicked. The folder gets
    jumper.json and .csv, .c3d and .trc, report.html and the kinogram for the coach, protocol.html for the geodesist.
    Results in LOG.measured beside the log are listed and found by the service like its own.

    Exit codes: 0 measured; 2 bad input; 3 nobody jumps in the log, or the balls do not determine the cameras; 4 the
    adjustment did not converge, or the disk refuses.

    Example: svev analyze recordings/jump.mcap --survey survey.json --out results/jump
    """
    refuse_existing(out / result_file.NAME, force=force)
    warn_of_clock(file for file in (log, survey, calibration) if file is not None)
    source = read_source(survey, calibration)
    by_hand_only = None if measurements is None else read_measurements(measurements)
    more = None if by_hand is None else read_measurements(by_hand)
    is_beside = out.resolve() == measured_path(log.resolve())
    names = names_of(log) if is_beside else {}
    before = [jump for folder in earlier or () for jump in read_earlier(folder)]
    with interrupted_by_endings(), console.steps() as tell:
        try:
            analysis = analyze(
                log,
                source,
                by_hand=more if by_hand_only is None else by_hand_only,
                images=by_hand_only is None,
                helmet=alternative is Alternative.MOVING_TOO,
                progress=tell,
            )
        except (NotSolvableError, NotConvergedError) as error:
            console.complain(f"{log}: the balls do not determine the cameras: {error}")
            raise typer.Exit(NOT_CONVERGED if isinstance(error, NotConvergedError) else NOT_SOLVABLE) from None
        files = write_folder(analysis, log, out, earlier=before, video=video, progress=tell)
    if is_beside:
        _note_beside(analysis, log, names)
    for line in _lines(analysis):
        console.say(line, aside=as_json)
    if as_json:
        console.print_json(_summary(analysis, out, files))
    else:
        console.say(f"results in {out}; open {out / 'report.html'}")


def _note_beside(analysis: Analysis, log: Path, names: Mapping[str, str]) -> None:
    """Let the service list and find what was measured, as if it had measured the log itself.

    Raises:
        StorageError: the disk refuses.
    """
    result = analysis.result
    jumps = tuple(
        summary(log.stem, result.rate_hz, jump, analysis.perpendicular.get(jump.number)) for jump in result.jumps
    )
    try:
        keep_own_result(log, jumps, names)
    except OSError as error:
        raise StorageError(f"{measured_path(log)}: cannot be written ({error.strerror}); run it again") from error


def _lines(analysis: Analysis) -> list[str]:
    result = analysis.result
    lines = [*result.orientation.messages, *(move.message for move in result.orientation.moved)]
    lines += [offset.message for offset in result.synchrony.values() if offset.message is not None]
    for jump in result.jumps:
        lines.append(f"jump {jump.number}: {jump.verdict.message}")
        figures = five_figures(course_of(jump, result.rate_hz), analysis.perpendicular.get(jump.number))
        lines += [f"  {figure.title}: {plus_minus(figure.quantity, figure.unit)}" for figure in figures]
    return lines


def _summary(analysis: Analysis, out: Path, files: list[Path]) -> dict[str, object]:
    return {
        "recording": analysis.result.recording,
        "out": str(out),
        "files": [str(file) for file in files],
        "messages": list(analysis.result.orientation.messages),
        "jumps": [
            {
                "number": jump.number,
                "ok": jump.verdict.ok,
                "message": jump.verdict.message,
                "takeoff_pulse": None if jump.takeoff is None else jump.takeoff.pulse,
                "phases": {phase.value: dict(figures) for phase, figures in jump.verdict.phases.items()},
            }
            for jump in analysis.result.jumps
        ],
    }
