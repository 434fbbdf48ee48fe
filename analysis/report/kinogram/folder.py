"""Writes the kinograms of a recording into its folder: page, pictures, and figures for later ones."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

from analysis.measurements.model import Measurements
from analysis.report.kinogram import earlier as kinogram_file
from analysis.report.kinogram.earlier import EarlierJump
from analysis.report.kinogram.model import kinogram_of, to_json
from analysis.report.kinogram.page import page_text
from analysis.report.kinogram.picture import jpeg_of
from analysis.result.model import MeasuredRecording, Quantity
from analysis.scene.camera_system import CameraSystem
from recorder.reading.parts import RecordingReader
from rig.topics import RIG_METADATA


def write_kinograms(
    result: MeasuredRecording,
    measurements: Measurements,
    system: CameraSystem,
    log: Path,
    folder: Path,
    *,
    perpendicular: Mapping[int, Quantity] | None = None,
    earlier: Sequence[EarlierJump] = (),
) -> list[Path]:
    """Write `kinogram.html`, `kinogram.jpg` and `kinogram.json`; a second jump is in `kinogram-2.jpg`.

    Args:
        result: what was measured.
        measurements: what was measured in the images of its jumps.
        system: the oriented cameras.
        log: where the images are.
        folder: of the results.
        perpendicular: by number of the jump its velocity perpendicular to the table, m/s.
        earlier: jumps of the same athlete, for the marks.

    Returns:
        The files written; none if no jump has a pulse.

    Raises:
        BadInputError: the log cannot be read.
        OSError: the disk refuses.
    """
    measured = {jump.number: jump for jump in measurements.jumps}
    across = perpendicular or {}
    kinograms = [
        kinogram_of(
            jump,
            result.rate_hz,
            measured.get(jump.number),
            system,
            log,
            perpendicular=across.get(jump.number),
            earlier=earlier,
        )
        for jump in result.jumps
        if jump.pulses
    ]
    if not kinograms:
        return []
    hill = _hill(log)
    content = {
        "format": kinogram_file.FORMAT,
        "recording": result.recording,
        "athlete": result.session.get("athlete", ""),
        "bib": result.session.get("bib", ""),
        "jumps": [to_json(kinogram) for kinogram in kinograms],
    }
    written = [folder / "kinogram.html", folder / kinogram_file.NAME]
    written[0].write_text(page_text(kinograms, result, hill), encoding="utf-8")
    written[1].write_text(json.dumps(content, allow_nan=False, ensure_ascii=False, indent=1) + "\n", encoding="utf-8")
    for order, kinogram in enumerate(kinograms, 1):
        written.append(folder / ("kinogram.jpg" if order == 1 else f"kinogram-{order}.jpg"))
        written[-1].write_bytes(jpeg_of(kinogram, result, hill))
    return written


def _hill(log: Path) -> str:
    """Name of the rig that recorded the log, as a rule its hill's; empty if it has none."""
    with RecordingReader(log, skim=True) as reader:
        for _ in reader.items():
            if RIG_METADATA in reader.metadata:
                break
        return reader.metadata.get(RIG_METADATA, {}).get("name", "").strip()
