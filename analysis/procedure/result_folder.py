"""Writes everything that an analysis found into a folder."""

from collections.abc import Callable, Sequence
from pathlib import Path

from analysis.export import motion_files
from analysis.measurements.file import write_measurements
from analysis.procedure.analyze import Analysis
from analysis.procedure.renaming import write_cameras
from analysis.report import overlay_file
from analysis.report.coach import write_report
from analysis.report.kinogram.earlier import EarlierJump
from analysis.report.kinogram.folder import write_kinograms
from analysis.report.protocol import write_protocol
from analysis.result import file as result_file
from analysis.result.naming import CAMERAS
from photogrammetry.network.file_writer import write_network
from rig.errors import StorageError

#: Name of the overlay video: WebM plays in browsers.
VIDEO = "overlay.webm"


def write_folder(
    analysis: Analysis,
    log: Path,
    folder: Path,
    *,
    earlier: Sequence[EarlierJump] = (),
    video: bool = False,
    progress: Callable[[str, float], None] | None,
) -> list[Path]:
    """Write the result, what it was computed from, and the pages for people.

    Args:
        analysis: what was found.
        log: where the images are.
        folder: made if it does not exist; files of an earlier analysis are replaced.
        earlier: measured jumps of the same athlete, for the marks of the kinogram.
        video: write the overlay video too.
        progress: told what is being done.

    Returns:
        The files.

    Raises:
        StorageError: the disk refuses.
        BadInputError: the log can no longer be read.
    """
    tell = progress or (lambda _step, _share: None)
    tell("writing", 0.0)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        written = [folder / "jumper.json", folder / "measurements.json", folder / "network.json"]
        result_file.write(analysis.result, written[0])
        write_measurements(analysis.measurements, written[1])
        write_network(analysis.scene.network, written[2])
        written.append(folder / CAMERAS)
        write_cameras(analysis.system, written[-1])
        written += motion_files.write(analysis.result, folder)
        written += write_kinograms(
            analysis.result,
            analysis.measurements,
            analysis.system,
            log,
            folder,
            perpendicular=analysis.perpendicular,
            earlier=earlier,
        )
    except OSError as error:
        raise StorageError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from error
    tell("writing", 0.5)
    page = folder / "report.html"
    write_report(
        analysis.result, analysis.measurements, analysis.system, log, page, perpendicular=analysis.perpendicular
    )
    overlay = folder / overlay_file.NAME
    try:
        overlay_file.write_overlay(analysis.result, analysis.standings, overlay)
    except OSError as error:
        raise StorageError(f"{folder}: cannot be written ({error.strerror}); choose another folder") from error
    written += [page, overlay, *write_protocol(analysis.result, analysis.measurements, folder, analysis.orientation)]
    if video:
        from analysis.report.video import write_video  # noqa: PLC0415 - where there is no video, nobody waits for its libraries

        film = folder / VIDEO
        write_video(
            analysis.result,
            analysis.measurements,
            analysis.system,
            log,
            film,
            progress=lambda done, of: tell("drawing the video", done / max(1, of)),
        )
        written.append(film)
    tell("writing", 1.0)
    return written
